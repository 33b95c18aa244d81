#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# python-can 4.5.0 (4.3.1 and 4.4.0 alike), interface "serial": every frame arrives with a 29-bit identifier.
#
# SerialBus.send writes the identifier without the flag that tells 11 bits from 29, and _recv_internal
# makes a can.Message without is_extended_id, whose default is True. So 123h sent by one bus is
# 00000123h at the next, and a filter or a protocol of 11-bit identifiers never hears it. 4.6.1 puts
# the flag into bit 31, and keeps both kinds apart.
#
# Shown with one bus on pyserial's loop:// that hears what it sends; pyserial 3.5. Output seen:
#   4.5.0: sent 123 with 11 bits, received 123 with 29 bits
#   4.6.1: sent 123 with 11 bits, received 123 with 11 bits
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
for version in 4.5.0 4.6.1; do
  python3 -m venv "$folder/$version" || exit 77
  "$folder/$version/bin/pip" install --quiet "python-can==$version" pyserial==3.5 || exit 77
  "$folder/$version/bin/python" - <<'PYTHON'
import sys

import can

with can.Bus(interface='serial', channel='loop://') as bus:
    bus.send(can.Message(arbitration_id=0x123, data=b'\x01\x02', is_extended_id=False))
    heard = bus.recv(2.0)
bits = 29 if heard.is_extended_id else 11
print(f'{can.__version__}: sent 123 with 11 bits, received {heard.arbitration_id:X} with {bits} bits')
sys.exit(bits != {'4.5.0': 29, '4.6.1': 11}[can.__version__])
PYTHON
done
