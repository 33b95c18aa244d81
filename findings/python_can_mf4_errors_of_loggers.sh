#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# python-can 4.6.1, MF4Reader: of the errors in an .mf4 of a logger nothing is left, or the file ends there.
#
# Bus logging of ASAM MDF 4.1 tells what kind of error it was in CAN_ErrorFrame.ErrorType (1 bit, 2 form, 3 stuff,
# 4 CRC, 5 acknowledgement); CANedge writes that and the bus, no more. The reader hands out an error frame of
# identifier 0 without data: it looks for the members that its own writer puts there, SocketCAN's error classes in
# the place of the identifier. Where a logger does write an identifier it is that of the destroyed frame, and is
# handed out in the same place: 040h reads as bus-off. Where asammdf makes one number of the four data bytes
# (github.com/hardbyte/python-can, issue 1913), the reader raises IndexError, and frames behind it are never seen.
#
# Seen with asammdf 8.8.28, which wrote the files. Output seen:
#   4.6.1: ErrorType 3 handed out as (0, ''), destroyed frame 040h as (64, '05'), bytes as a number IndexError
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet python-can==4.6.1 asammdf==8.8.28 || exit 77
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import sys

from asammdf import MDF, Signal, Source
from asammdf.blocks.v4_constants import BUS_TYPE_CAN, FLAG_CG_BUS_EVENT, SOURCE_BUS
import can
import numpy

FRAME = (('ID', '<u4'), ('IDE', 'u1'), ('DLC', 'u1'), ('DataLength', 'u1'))
FILES = {
    'ErrorType 3': ((('ErrorType', 'u1'),), (3,)),
    'destroyed frame 040h': ((*FRAME, ('DataBytes', '(8,)u1')), (0x40, 0, 1, 1, [5] * 8)),
    'bytes as a number': ((*FRAME, ('DataBytes', '<u4')), (0x123, 0, 4, 4, 0x01000000)),
}


def read(columns, entry):
    source = Source(source_type=SOURCE_BUS, bus_type=BUS_TYPE_CAN, name='', path='', comment='')
    samples = numpy.zeros(1, [(f'CAN_ErrorFrame.{name}', kind)
                              for name, kind in (('BusChannel', 'u1'), *columns)])
    for (name, _), value in zip(columns, entry):
        samples[f'CAN_ErrorFrame.{name}'] = value
    file = MDF(version='4.11')
    file.append([Signal(samples=samples, timestamps=numpy.array([0.5]), name='CAN_ErrorFrame', source=source)])
    for group in file.groups:
        group.channel_group.flags = FLAG_CG_BUS_EVENT
    file.save('a.mf4', overwrite=True)
    file.close()
    try:
        message, = can.MF4Reader('a.mf4')
        return message.arbitration_id, message.data.hex()
    except IndexError:
        return 'IndexError'


found = {name: read(*what) for name, what in FILES.items()}
print(f'{can.__version__}: ErrorType 3 handed out as {found["ErrorType 3"]}, destroyed frame 040h as '
      f'{found["destroyed frame 040h"]}, bytes as a number {found["bytes as a number"]}')
sys.exit(found != {'ErrorType 3': (0, ''), 'destroyed frame 040h': (64, '05'), 'bytes as a number': 'IndexError'})
PYTHON
