#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# python-can 4.6.1 (4.4.2 and 4.5.0 alike), Vector's .asc: the date of a trace is up to 0.9 s late, and relative times
# are read as absolute ones.
#
# ASCWriter puts milliseconds behind the point as a number, without zeros in front: 20.007 s becomes "20.7", which its
# own reader takes for 20.700, and each frame is as much too late. It shows where the first frame came in the first
# 0.1 s of a second: logs of one moment, from two computers, then differ by what is no difference of clocks. 4.3.1
# writes six digits. In both, ASCReader keeps the word "relative" of "base hex timestamps relative" (each time since
# the line before), and adds nothing up, so that time goes back and forth.
#
# Output seen:
#   4.3.1: written 1700000000.007, read 1700000000.007; relative 0.5 0.25 0.25 read as 0.5 0.25 0.25
#   4.6.1: written 1700000000.007, read 1700000000.700; relative 0.5 0.25 0.25 read as 0.5 0.25 0.25
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
for version in 4.3.1 4.6.1; do
  python3 -m venv "$folder/$version" || exit 77
  "$folder/$version/bin/pip" install --quiet "python-can==$version" || exit 77
  (cd "$folder" && "$folder/$version/bin/python" -) <<'PYTHON'
import sys

import can

WRITTEN = 1700000000.007
with can.ASCWriter('written.asc') as writer:
    writer(can.Message(timestamp=WRITTEN, arbitration_id=0x705, is_extended_id=False, data=b'\x05'))
message, = can.ASCReader('written.asc', relative_timestamp=False)
with open('relative.asc', 'w', encoding='ascii') as file:
    file.write('date Tue Nov 14 10:13:20.007 pm 2023\nbase hex  timestamps relative\nno internal events logged\n')
    file.writelines(f'   {time:.6f} 1  705             Rx   d 1 05\n' for time in (0.5, 0.25, 0.25))
times = [each.timestamp for each in can.ASCReader('relative.asc')]
print(f'{can.__version__}: written {WRITTEN:.3f}, read {message.timestamp:.3f}; '
      'relative 0.5 0.25 0.25 read as', *times)
expected = WRITTEN if can.__version__ == '4.3.1' else 1700000000.7
sys.exit((round(message.timestamp, 3), times) != (expected, [0.5, 0.25, 0.25]))
PYTHON
done
