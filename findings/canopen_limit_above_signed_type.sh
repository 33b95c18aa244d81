#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# canopen 2.4.1 (2.3.0 alike), import_eds: decimal limits above a signed type turn negative, without a word.
#
# HighLimit=65535 of an INTEGER16 becomes -1, and 32768 becomes -32768: every number above the type's
# end is taken for two's complement, whether it was written in hexadecimal (where CiA 306 means that)
# or in decimal. With LowLimit=-100 a range is left that holds no value above -1, for a limit that was
# meant as "none". 0x12345, one digit more than the type has, becomes 9029. Makers write such limits:
# brtiberio/Sevcon_gen4 has HighLimit=65535 for INTEGER16 in its Gen4.eds, for example.
#
# Output seen:
#   2.3.0: -100..65535 is read as -100..-1, 0..32768 as 0..-32768, 0..0x12345 as 0..9029
#   2.4.1: -100..65535 is read as -100..-1, 0..32768 as 0..-32768, 0..0x12345 as 0..9029
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
for version in 2.3.0 2.4.1; do
  python3 -m venv "$folder/$version" || exit 77
  "$folder/$version/bin/pip" install --quiet "canopen==$version" || exit 77
  "$folder/$version/bin/python" - "$version" <<'PYTHON'
import io
import sys

from canopen.objectdictionary import eds

LIMITS = (('-100', '65535'), ('0', '32768'), ('0', '0x12345'))
text = '[DeviceInfo]\n' + ''.join(
    f'[{0x2000 + number:04X}]\nParameterName=limit {number}\nObjectType=7\nDataType=3\n'
    f'AccessType=rw\nLowLimit={low}\nHighLimit={high}\n'
    for number, (low, high) in enumerate(LIMITS))
objects = eds.import_eds(io.StringIO(text), node_id=1)
read = [(objects[0x2000 + number].min, objects[0x2000 + number].max)
        for number in range(len(LIMITS))]
print(f'{sys.argv[1]}: ' + ', '.join(
    f'{low}..{high} {"is read " if not number else ""}as {least}..{most}'
    for number, ((low, high), (least, most)) in enumerate(zip(LIMITS, read))))
sys.exit(read != [(-100, -1), (0, -32768), (0, 9029)])
PYTHON
done
