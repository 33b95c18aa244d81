#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# python-can-remote 0.3.0: new data for a periodic message end that message, with a TypeError.
#
# send_periodic() of the interface "remote" leaves the cycle to the server. modify_data() of what it returns first
# has the server stop, and then fails: "super(self)", where only a class may stand. Nothing is sent from there on,
# and a drive that got its setpoint so runs into its own watchdog, or goes on with the last one where it has none.
# On python-can's own interfaces the data change and the cycle goes on. Stop the task and begin another one with
# the new data.
#
# Shown with the package's server over python-can 4.6.1's virtual bus. Output seen:
#   0.3.0: sent with 01; modify_data: TypeError; then sent nothing; a new task: sent with 02
#   virtual: sent with 01; modify_data: done; then sent with 02; a new task: sent with 02
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet python-can==4.6.1 python-can-remote==0.3.0 || exit 77
"$folder/venv/bin/python" - <<'PYTHON'
import os
import threading
import time

import can
from can_remote.server import RemoteServer


def message(value):
    return can.Message(arbitration_id=0x201, data=[value], is_extended_id=False)


def comes(end):
    time.sleep(0.3)     # what was on its way before
    while end.recv(0) is not None:
        pass
    time.sleep(0.3)
    data = {each.data.hex() for each in iter(lambda: end.recv(0), None)}
    return 'sent with ' + ', '.join(sorted(data)) if data else 'sent nothing'


def shown(bus, end):
    task = bus.send_periodic(message(1), 0.02)
    seen = [comes(end)]
    try:
        task.modify_data(message(2))
        seen.append('modify_data: done')
    except TypeError:
        seen.append('modify_data: TypeError')
    seen.append(f'then {comes(end)}')
    if seen[-1] != 'then sent nothing':
        task.stop()
    bus.send_periodic(message(2), 0.02)
    seen.append(f'a new task: {comes(end)}')
    return '; '.join(seen)


server = RemoteServer('127.0.0.1', 0, interface='virtual', channel='far')
threading.Thread(target=server.serve_forever, daemon=True).start()
lines, buses = [], []
for name, channel, options in (
        ('0.3.0', 'far', {'interface': 'remote', 'channel': f'ws://127.0.0.1:{server.server_port}/'}),
        ('virtual', 'near', {'interface': 'virtual', 'channel': 'near'})):
    with can.Bus(interface='virtual', channel=channel) as end:
        buses.append(can.Bus(**options))
        lines.append(f'{name}: {shown(buses[-1], end)}')
        print(lines[-1], flush=True)
os._exit(lines != [     # threads of the server go on
    '0.3.0: sent with 01; modify_data: TypeError; then sent nothing; a new task: sent with 02',
    'virtual: sent with 01; modify_data: done; then sent with 02; a new task: sent with 02'])
PYTHON
