#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# python-can 4.6.1, log files of candump: most error frames are read as data frames, and played onto the bus.
#
# "candump -L -e" writes error frames with the flag 20000000h and SocketCAN's error classes as identifier. The reader
# knows one only where the class "bus error" (80h) is among them. Controller warnings (4h) and bus-off (40h) come out
# as data frames with the 29-bit identifiers 4h and 40h, and is_error_frame does not tell them; "can_player" leaves
# error frames out unless it is told otherwise, and sends these. Leave lines with identifiers of eight digits that
# begin with 2 or 3 out of a log before it is played onto a bus where 29-bit identifiers mean something.
#
# Shown with python-can's virtual bus. Output seen:
#   4.6.1: bus-off read as data 00000040, warning as data 00000004, bus error as error
#   4.6.1: played: 00000040 00000004 705
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet python-can==4.6.1 || exit 77
cd "$folder"
cat >bus.log <<'LOG'
(1700000000.000000) can0 20000040#0000000000000000
(1700000000.001000) can0 20000004#0008000000000000
(1700000000.002000) can0 20000088#0000000400000000
(1700000000.003000) can0 705#05
LOG
"$folder/venv/bin/python" - <<'PYTHON'
from contextlib import redirect_stdout
import sys

import can
import can.player


def shown(message):
    return f'{message.arbitration_id:0{8 if message.is_extended_id else 3}X}'


read = ['error' if message.is_error_frame else f'data {shown(message)}'
        for message in can.LogReader('bus.log')]
print(f'{can.__version__}: bus-off read as {read[0]}, warning as {read[1]}, bus error as {read[2]}')
with can.Bus(interface='virtual', channel='bench') as bus:
    sys.argv = ['can_player', '-i', 'virtual', '-c', 'bench', 'bus.log']
    with redirect_stdout(sys.stderr):
        can.player.main()
    played = []
    while (message := bus.recv(0.2)) is not None:
        played.append(shown(message))
print(f'{can.__version__}: played:', *played)
sys.exit((read[:3], played) != (['data 00000040', 'data 00000004', 'error'], ['00000040', '00000004', '705']))
PYTHON
