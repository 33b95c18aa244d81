#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# python-can 4.6.1 (4.3.1 alike), interface "slcan": bitrate=750000 makes 800 kbit/s of many adapters, and
# bitrate=800000 is refused.
#
# The bit rate is sent as one of ten commands, S0 to S9. S7 is 800 kbit/s in LAWICEL's manual (CAN232, version 3),
# whose commands these are, in USBtin and in CANable's firmware 2.5; python-can has it for 750 kbit/s, as the older
# firmware of CANable 1 and 2. 800 kbit/s is a rate of CiA 301, 750 is none. So a CANopen bus at 800 kbit/s cannot be
# asked for, and who asks for 750 disturbs his bus or not, by adapter, without a word from either. For 800 kbit/s at
# an adapter that keeps to LAWICEL write bitrate=750000, or give its timing registers as btr.
#
# Shown over a pseudo-terminal; pyserial 3.5. Output seen:
#   4.3.1: 500000 is S6, 750000 is S7, 800000 is refused, 1000000 is S8
#   4.6.1: 500000 is S6, 750000 is S7, 800000 is refused, 1000000 is S8
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
for version in 4.3.1 4.6.1; do
  python3 -m venv "$folder/$version" || exit 77
  "$folder/$version/bin/pip" install --quiet "python-can==$version" pyserial==3.5 || exit 77
  "$folder/$version/bin/python" - "$version" <<'PYTHON'
import logging
import os
import re
import select
import sys
import tty

import can

logging.disable()


def commanded(bitrate):
    """Return the command that sets it."""
    adapter, terminal = os.openpty()
    tty.setraw(terminal)
    try:
        bus = can.Bus(interface='slcan', channel=os.ttyname(terminal), bitrate=bitrate, sleep_after_open=0)
    except can.CanInitializationError:
        return 'refused'
    data = b''
    while select.select([adapter], [], [], 0.2)[0]:
        data += os.read(adapter, 4096)
    bus.shutdown()
    return ' '.join(re.findall('S[0-9]', data.decode()))


line = ', '.join(f'{bitrate} is {commanded(bitrate)}' for bitrate in (500000, 750000, 800000, 1000000))
print(f'{sys.argv[1]}: {line}')
sys.exit(line != '500000 is S6, 750000 is S7, 800000 is refused, 1000000 is S8')
PYTHON
done
