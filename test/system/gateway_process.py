# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A gateway in front of the kernel's CAN interfaces, in a process: socketcand's protocol, raw mode.

As socketcand 6dd5d33 does it, by its source: each client has a socket of its own on the bus, so
that clients hear each other; what cannot be opened is refused in words. Prints its port.

usage: gateway_process.py [PORT]
"""

from contextlib import suppress
import re
import select
import socket
import struct
import sys
import threading
import time

CAN_FRAME = struct.Struct('=IB3x8s')
EXTENDED, ERROR = 0x80000000, 0x20000000
MESSAGE = re.compile(rb'< *(\w+) *([^>]*)>')


def text_of(frame: bytes) -> bytes:
    """Return the message that tells of a frame."""
    identifier, length, data = CAN_FRAME.unpack(frame)
    stamp = f'{time.time():.6f}'
    if identifier & ERROR:
        return f'< error {identifier & 0x1FFFFFFF:03X} {stamp} >'.encode()
    digits = 8 if identifier & EXTENDED else 3
    return (f'< frame {identifier & 0x1FFFFFFF:0{digits}X} {stamp} '
            f'{data[:length].hex().upper()} >').encode()


def frame_of(words: bytes) -> bytes:
    """Return the frame that is to be sent."""
    name, length, *data = words.split()
    return CAN_FRAME.pack(int(name, 16) | (EXTENDED if len(name) == 8 else 0), int(length),
                          bytes(int(each, 16) for each in data))


def serve(client: socket.socket, bus: socket.socket) -> None:
    """Talk with a client until it has gone."""
    client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    client.sendall(b'< hi >')
    text, raw = b'', False
    while True:
        ready, _, _ = select.select([client, bus] if raw else [client], [], [])
        if bus in ready:
            client.sendall(text_of(bus.recv(CAN_FRAME.size)))
        if client not in ready:
            continue
        more = client.recv(4096)
        if not more:
            return
        text += more
        for found in MESSAGE.finditer(text):
            word, rest = found[1], found[2].strip()
            if word == b'send':
                bus.send(frame_of(rest))
                continue
            if word == b'open':
                try:
                    bus.bind((rest.decode(),))
                except OSError:
                    client.sendall(b'< error could not open bus >')
                    return
            raw |= word == b'rawmode'
            client.sendall(b'< ok >')
        text = text[text.rfind(b'>') + 1:]


def run(client: socket.socket) -> None:
    """Serve a client, whatever becomes of it."""
    with client, socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus, suppress(
            OSError):
        serve(client, bus)


def main() -> None:
    """Serve all clients."""
    server = socket.create_server(('127.0.0.1', int(sys.argv[1]) if sys.argv[1:] else 0))
    print('port', server.getsockname()[1], flush=True)
    while True:
        client, _ = server.accept()
        threading.Thread(target=run, args=(client,), daemon=True).start()


if __name__ == '__main__':
    main()
