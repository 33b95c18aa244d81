#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# dcf-tools 2.4.2, dcfgen: a REAL32 loses what is behind the point, and a 24-bit object takes the rest of a drive's
# configuration with it.
#
# Lely's dcfgen (ros2_canopen runs it over bus.yml) makes a concise DCF of entries "sdo: {index, sub_index, value}";
# the master writes it by SDO when the drive boots. Each value goes through int() before its type is looked at: a
# gain of 0.75 is configured as 0.0, one of 1.9 as 1.0. Types of 24, 40, 48 and 56 bits are packed with four or eight
# bytes behind a length of three, five, six or seven, and what reads on takes the byte left over for an index.
# Nothing warns of either: see what "dcfgen -v" prints, and write such objects by other means.
#
# Output seen:
#   2000h REAL32 0.75: written 0.0
#   2000h REAL32 1.9: written 1.0
#   2001h INTEGER24, 2002h UNSIGNED16: read as 2001h 3 bytes, 0200h 512 bytes
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet dcf-tools==2.4.2 empy==3.3.4 PyYAML==6.0.3 setuptools==75.8.0 || exit 77
cd "$folder"
"$folder/venv/bin/python" - "$folder/venv/bin/dcfgen" <<'PYTHON'
import struct
import subprocess
import sys

FILE = """[DeviceInfo]
[MandatoryObjects]
SupportedObjects=3
1=0x1000
2=0x1001
3=0x1018
[OptionalObjects]
SupportedObjects=0
[ManufacturerObjects]
SupportedObjects=3
1=0x2000
2=0x2001
3=0x2002
[1018]
ParameterName=Identity
ObjectType=9
SubNumber=2
"""
VARIABLES = (('1000', 7), ('1001', 5), ('1018sub0', 5), ('1018sub1', 7),
             ('2000', 8), ('2001', 0x10), ('2002', 6))
with open('drive.eds', 'w', encoding='ascii') as file:
    file.write(FILE)
    for name, kind in VARIABLES:
        file.write(f'[{name}]\nParameterName={name}\nDataType={kind}\nAccessType=rw\nDefaultValue=1\n')


def configure(*values):
    """Return the entries of the concise DCF: index, size, data."""
    entries = ', '.join(f'{{index: {index}, value: {value}}}' for index, value in values)
    with open('bus.yml', 'w', encoding='ascii') as file:
        file.write(f'master: {{node_id: 1}}\naxis: {{dcf: drive.eds, node_id: 5, sdo: [{entries}]}}\n')
    subprocess.run([sys.argv[1], 'bus.yml'], check=True)
    with open('axis.bin', 'rb') as file:
        content = file.read()
    count, place, found = struct.unpack_from('<L', content)[0], 4, []
    for _ in range(count):
        index, _, size = struct.unpack_from('<HBL', content, place)
        place += 7
        found.append((index, size, content[place:place + size]))
        place += size
    return found


gains = []
for gain in (0.75, 1.9):
    (index, _, data), = configure((0x2000, gain))
    gains.append(struct.unpack('<f', data)[0])
    print(f'{index:04X}h REAL32 {gain}: written {gains[-1]}')
(first, size, _), (second, second_size, _) = configure((0x2001, 5), (0x2002, 7))
print(f'2001h INTEGER24, 2002h UNSIGNED16: read as {first:04X}h {size} bytes, {second:04X}h {second_size} bytes')
sys.exit((gains, first, size, second) != ([0.0, 1.0], 0x2001, 3, 0x0200))
PYTHON
