#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# PyCanOpenDevice 1.3, a CANopen device: what is read by SDO comes with its bytes in the other order than what is
# written, and an object that it does not have is not refused.
#
# CANopen is little-endian. The device takes 1000 out of a written "E8 03 00 00", and sends it as "E8 03 00 00" in a
# PDO, but an upload of the same number answers "00 00 03 E8": a master reads 3892510720. All answers to uploads are
# of four bytes (43h) as well, whatever type the object has. A request for an object that was not added gets no abort
# 06020000h, but nothing, so that a master that asks for optional objects waits out its time for each of them. Return
# numbers with their bytes turned over from functions that are added, and add a function for all that is asked for.
#
# Shown on python-can 4.6.1's virtual bus, read by canopen 2.4.1. Output seen:
#   1.3: written 1000, kept 1000, PDO e8030000, upload of four bytes reads 3892510720; not added: SdoCommunicationError
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet PyCanOpenDevice==1.3 canopen==2.4.1 python-can==4.6.1 || exit 77
"$folder/venv/bin/python" - <<'PYTHON'
import contextlib
import io
import os
import threading

import can
import canopen
from PyCanOpenDevice.CanOpen_Device import Device, SDO_Structure
from PyCanOpenDevice.CanOpen_Runtime import CanOpen_Runtime

kept = {'speed': 0}
pdo, came = [], threading.Event()


def speed(command, number):
    if command == 0x40:
        return 0x43, kept['speed']
    kept['speed'] = number
    return 0x60, 0


def heard(number, data, time):
    pdo.append(data.hex())
    came.set()


network = canopen.Network()
network.connect(interface='virtual', channel='line')
network.subscribe(0x185, heard)
node = network.add_node(5, canopen.ObjectDictionary())
with contextlib.redirect_stdout(io.StringIO()):     # it prints each frame that it sends
    runtime = CanOpen_Runtime(can.Bus(interface='virtual', channel='line'))
    device = Device(5)
    device.add_sdo(SDO_Structure(0x2000, 0, speed))
    runtime.callbacks.add_service(device)
    threading.Thread(target=runtime.receiver.recv_loop, daemon=True).start()
    node.sdo.download(0x2000, 0, (1000).to_bytes(4, 'little'))
    device.set_pdo_data(1, kept['speed'])
    device.send_pdo(1)
    came.wait(5)
    answer = node.sdo.upload(0x2000, 0)
    try:
        node.sdo.upload(0x2001, 0)
        refused = 'answered'
    except canopen.SdoCommunicationError as error:
        refused = type(error).__name__
line = (f'1.3: written 1000, kept {kept["speed"]}, PDO {pdo[0] if pdo else "none"}, upload of '
        f'{ {4: "four"}.get(len(answer), len(answer)) } bytes reads {int.from_bytes(answer, "little")}; '
        f'not added: {refused}')
print(line, flush=True)
os._exit(line != '1.3: written 1000, kept 1000, PDO e8030000, upload of four bytes reads 3892510720; '
                 'not added: SdoCommunicationError')    # its thread goes on
PYTHON
