#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# canmatrix 1.3.3, from an EDS to a DBC: LowLimit is added to what a PDO carries, an INTEGER8 has two bits of its
# eight in SDO frames, and a REAL32 becomes an integer.
#
# The import takes LowLimit for the signal's offset, though the values on the bus are not shifted: an actual velocity
# of 1000 with LowLimit=-6000 is decoded as -5000, without a word, and only of objects that have a limit. Its table of
# types gives INTEGER8 (modes of operation, 6060h and 6061h) two bits, so that mode 8 reads as 0, and 1 as 1. Who
# decodes by a DBC that was made so sets the offsets to 0, and looks at every INTEGER8 and REAL32.
#
# Decoded by cantools 45.1.0. Output seen:
#   1.3.3: velocity 1000 is -5000, temperature 25.0 is 1103626240, mode 8 read by SDO is 0
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet canmatrix==1.3.3 canopen==2.4.1 cantools==45.1.0 || exit 77
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
from importlib.metadata import version
import sys

import canmatrix.convert
import cantools

VARIABLES = (('606C', 'velocity', 4, 'LowLimit=-6000\nHighLimit=6000\n'),
             ('6061', 'mode', 2, ''), ('2000', 'temperature', 8, ''))
RECORDS = {'1800': ((5, 2), (7, '$NODEID+0x180'), (5, 255)),
           '1A00': ((5, 2), (7, '0x606C0020'), (7, '0x20000020'))}
with open('servo.eds', 'w', encoding='ascii') as file:
    file.write('[DeviceInfo]\nProductName=Servo\n')
    for index, name, kind, more in VARIABLES:
        file.write(f'[{index}]\nParameterName={name}\nObjectType=7\nDataType={kind}\nAccessType=ro\n'
                   f'PDOMapping=1\n{more}')
    for index, entries in RECORDS.items():
        file.write(f'[{index}]\nParameterName=TPDO {index}\nObjectType=9\nSubNumber={len(entries)}\n')
        for number, (kind, value) in enumerate(entries):
            file.write(f'[{index}sub{number}]\nParameterName=TPDO {index} {number}\nObjectType=7\n'
                       f'DataType={kind}\nAccessType=rw\nDefaultValue={value}\n')
canmatrix.convert.convert('servo.eds', 'servo.dbc', eds_node_id=5)
database = cantools.database.load_file('servo.dbc')
pdo = database.decode_message(0x185, bytes.fromhex('E8030000 0000C841'))     # 1000, 25.0
sdo = database.decode_message(0x585, bytes.fromhex('4F616000 08000000'))     # 6061h is 8
found = pdo['velocity'], pdo['temperature'], sdo['mode']
print(f'{version("canmatrix")}: velocity 1000 is {found[0]}, temperature 25.0 is {found[1]}, '
      f'mode 8 read by SDO is {found[2]}')
sys.exit(found != (-5000, 0x41C80000, 0))
PYTHON
