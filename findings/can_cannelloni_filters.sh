#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# can-cannelloni 0.1.0, a plugin for python-can: filters that can.Bus is given are forgotten.
#
# The base class sets them in its constructor, which CannelloniBus calls first; then it sets its own list to None.
# Since it replaces recv() as well, nothing filters: frames of all identifiers arrive, without a word.
# set_filters() behind the opening helps. What reads by _recv_internal(), which python-can documents as what an
# interface implements, gets NotImplementedError ("write only bus"): the plugin has recv() alone.
#
# Shown with a server that says hello and sends two frames, python-can 4.6.1. Output seen:
#   0.1.0: filter 123h given to can.Bus: 123 124, by set_filters(): 123; _recv_internal: NotImplementedError
# Exit code 0: still so; 1: the behaviour has changed; 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" || exit 77
"$folder/venv/bin/pip" install --quiet python-can==4.6.1 can-cannelloni==0.1.0 || exit 77
"$folder/venv/bin/python" - <<'PYTHON'
import socket
import struct
import sys
import threading

import can

FILTERS = [{'can_id': 0x123, 'can_mask': 0x7FF, 'extended': False}]


def received(later, **options):
    """Return the identifiers that arrive of 123h and 124h."""
    ready = threading.Event()

    def serve():
        connection, _ = server.accept()
        connection.sendall(b'CANNELLONIv1')
        connection.recv(12, socket.MSG_WAITALL)
        ready.wait()
        for identifier in (0x123, 0x124):
            connection.sendall(struct.pack('!IB', identifier, 1) + b'\x01')
        connection.recv(1)

    with socket.create_server(('127.0.0.1', 0)) as server:
        threading.Thread(target=serve, daemon=True).start()
        bus = can.Bus(interface='cannelloni', channel=f'127.0.0.1:{server.getsockname()[1]}', **options)
    if later:
        bus.set_filters(FILTERS)
    ready.set()
    found = ' '.join(f'{each.arbitration_id:03X}' for each in iter(lambda: bus.recv(0.5), None))
    try:
        bus._recv_internal(0.0)
        inner = 'a frame or None'
    except NotImplementedError:
        inner = 'NotImplementedError'
    bus.shutdown()
    return found, inner


opening, inner = received(False, can_filters=FILTERS)
later, _ = received(True)
line = f'filter 123h given to can.Bus: {opening}, by set_filters(): {later}; _recv_internal: {inner}'
print(f'0.1.0: {line}')
sys.exit(line != 'filter 123h given to can.Bus: 123 124, by set_filters(): 123; _recv_internal: NotImplementedError')
PYTHON
