# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The drives of the benches: a process that answers at once and does nothing else.

Written without the package's codec and simulation, so that nothing of the bridge is measured
against itself.
"""

import socket
import struct
import sys

CAN_FRAME = struct.Struct('=IB3x8s')
EXTENDED = 0x80000000
DIR = 0x10000000
CYCLIC = 0x001FFFF0
REQUEST_MAP = struct.pack('>4H', 50, 51, 60, 61)
RESPONSE_MAP = struct.pack('>4H', 209, 210, 211, 212)


def answer(frame: bytes, count: int) -> bytes | None:
    """Return the answer to a frame, or None."""
    identifier, _, _ = CAN_FRAME.unpack(frame)
    if identifier & CYCLIC == CYCLIC:
        data = struct.pack('>4H', count & 0xFFFF, 1, 2, 3)
    elif identifier & 0x00100000:
        return None
    else:
        number = identifier >> 4 & 0xFFFF
        data = {122: REQUEST_MAP, 126: RESPONSE_MAP}.get(number, struct.pack('>4H', 7, 8, 9, 10))
    return CAN_FRAME.pack(identifier | DIR, 8, data)


def main() -> None:
    """Serve one client after the other until killed."""
    server = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    server.bind(sys.argv[1])
    server.listen()
    print('ready', flush=True)
    while True:
        client, _ = server.accept()
        count = 0
        while True:
            frame = client.recv(16)
            if not frame:
                break
            count += 1
            reply = answer(frame, count)
            if reply is not None:
                try:
                    client.send(reply)
                except OSError:
                    break


if __name__ == '__main__':
    main()
