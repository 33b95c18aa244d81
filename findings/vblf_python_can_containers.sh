#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# vblf 0.3.1 and python-can 4.6.1, Vector's .blf: what is not compressed is read by its writer alone.
#
# The frames of a .blf stand in containers, and each container says how its content is packed: 0, not at all; 2, by
# zlib. python-can writes and reads that. vblf goes by a byte in the header of the file, and has flags and time stamp
# of an ordinary object where a container has the kind of packing and the unpacked size: the 2 there means
# nanoseconds, for packed content as for content that is not. Its default is not to compress. Compressed files go
# both ways as long as they have one container; behind the first of vblf's (128 KiB unpacked) up to seven bytes fill
# up to a multiple of eight, and python-can, which expects others, ends with BLFParseError. So write with
# Compression.DEFAULT, and a buffer_size that everything fits into; and never compression_level=0 for vblf.
#
# Output seen, of 1000 frames:
#   written by vblf: NONE error, DEFAULT 1000 read, DEFAULT in small containers BLFParseError
#   written by python-can: compression 0 error, compression 6 1000 read
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet vblf==0.3.1 python-can==4.6.1 || exit 77
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import can
from vblf.can import CanMessage
from vblf.constants import Compression, ObjFlags
from vblf.reader import BlfReader
from vblf.writer import BlfWriter

FRAMES = 1000


def read(reader):
    try:
        with reader('a.blf') as file:
            return f'{sum(1 for _ in file)} read'
    except Exception as error:      # its name is what is shown
        return type(error).__name__


def by_vblf(compression, size):
    with BlfWriter('a.blf', compression, size) as writer:
        for number in range(FRAMES):
            writer.write(CanMessage.new(ObjFlags.TIME_ONE_NANS, number * 10_000_000, 1, 0, 1, 0x185,
                                        bytes([number % 256]).ljust(8, b'\0')))
    return read(can.BLFReader)


def by_python_can(level):
    with can.BLFWriter('a.blf', compression_level=level) as writer:
        for number in range(FRAMES):
            writer.on_message_received(can.Message(
                timestamp=1_700_000_000 + 0.01 * number, arbitration_id=0x185, is_extended_id=False,
                data=[number % 256], channel=0))
    return read(BlfReader)


lines = [f'written by vblf: NONE {by_vblf(Compression.NONE, 1 << 20)}, '
         f'DEFAULT {by_vblf(Compression.DEFAULT, 1 << 20)}, '
         f'DEFAULT in small containers {by_vblf(Compression.DEFAULT, 1000)}',
         f'written by python-can: compression 0 {by_python_can(0)}, compression 6 {by_python_can(6)}']
print(*lines, sep='\n')
sys.exit(lines != [
    'written by vblf: NONE error, DEFAULT 1000 read, DEFAULT in small containers BLFParseError',
    'written by python-can: compression 0 error, compression 6 1000 read'])
PYTHON
