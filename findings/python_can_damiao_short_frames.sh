#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# python-can-damiao 0.1.0: the data of short frames stand at the wrong end, and of frames that come together one is
# left.
#
# Of eight places for data send() fills the last ones when a frame has fewer bytes, with zeros in front, and says
# how many there are; what it reads from the adapter it takes from the first ones. NMT "start node 5" (01 05) so
# becomes two bytes 00 00, and 01 05 behind what counts. Frames of eight bytes, as motors of this maker use, do not
# show it. And where several frames came in one read, _recv_internal() hands out the first and forgets the others:
# on a bus with more than one answer in a millisecond frames are missing, without a word. Fill frames up yourself,
# and do not count on every answer.
#
# Shown over a pseudo-terminal; python-can 4.6.1, pyserial 3.5. Output seen:
#   0.1.0: sent 0105, length 2, places 0000000000000105; length 2, places 0105000000000000 is received as 0105
#   0.1.0: five frames in one write: received 181
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet python-can==4.6.1 pyserial==3.5 python-can-damiao==0.1.0 || exit 77
"$folder/venv/bin/python" - <<'PYTHON'
import os
import select
import sys
import tty

import can


def arrived(count):
    data = b''
    while len(data) < count and select.select([adapter], [], [], 5.0)[0]:
        data += os.read(adapter, count - len(data))
    return data


def packet(identifier, data):
    return bytes([0xAA, 0x11, len(data)]) + identifier.to_bytes(4, 'big') + data.ljust(8, b'\0') + b'\x55'


def received():
    return list(iter(lambda: bus.recv(0.3), None))


adapter, terminal = os.openpty()
tty.setraw(terminal)
bus = can.Bus(interface='damiao', channel=os.ttyname(terminal), bitrate=500000)
arrived(5)      # the bit rate
bus.send(can.Message(arbitration_id=0, data=[1, 5], is_extended_id=False))
sent = arrived(30)
os.write(adapter, packet(0x705, bytes([1, 5])))
back, = received()
os.write(adapter, b''.join(packet(0x180 + node, bytes([node])) for node in range(1, 6)))
together = ' '.join(f'{each.arbitration_id:X}' for each in received())
bus.shutdown()
lines = [f'sent 0105, length {sent[18]}, places {sent[21:29].hex()}; '
         f'length 2, places 0105000000000000 is received as {back.data.hex()}',
         f'five frames in one write: received {together}']
for line in lines:
    print(f'0.1.0: {line}')
sys.exit(lines != ['sent 0105, length 2, places 0000000000000105; '
                   'length 2, places 0105000000000000 is received as 0105',
                   'five frames in one write: received 181'])
PYTHON
