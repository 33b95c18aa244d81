# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A gateway on the loopback in front of the drives of a bench: socketcand's protocol over TCP.

Sends at once, as socketcand does (6dd5d33). Acknowledges when the kernel thinks fit, as others do:
up to 40 ms later. Prints its port.
"""

import re
import select
import socket
import sys
import threading

from child import serve
from drives import CAN_FRAME

EXTENDED = 0x80000000
#: message of the opening -> what is answered
WORDS = {'open': b'< ok >', 'rawmode': b'< ok >'}
MESSAGE = re.compile(rb'< *(\w+) *([^>]*)>')


def relay(client: socket.socket, drives: socket.socket) -> None:
    """Carry frames both ways until one of them ends."""
    client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    client.sendall(b'< hi >')
    text = b''
    while True:
        ready, _, _ = select.select([client, drives], [], [])
        if drives in ready:
            frame = drives.recv(16)
            if not frame:
                return
            identifier, length, data = CAN_FRAME.unpack(frame)
            digits = 8 if identifier & EXTENDED else 3
            client.sendall(f'< frame {identifier & 0x1FFFFFFF:0{digits}X} 1.000000 '
                           f'{data[:length].hex()} >'.encode())
        if client in ready:
            more = client.recv(4096)
            if not more:
                return
            text += more
            for word, rest in MESSAGE.findall(text):
                if word == b'send':
                    name, length, *data = rest.split()
                    identifier = int(name, 16) | (EXTENDED if len(name) == 8 else 0)
                    drives.send(CAN_FRAME.pack(identifier, int(length), bytes(
                        int(each, 16) for each in data)))
                else:
                    client.sendall(WORDS[word.decode()])
            text = text[text.rfind(b'>') + 1:]


def run(server: socket.socket, path: str) -> None:
    """Serve one client after the other."""
    while True:
        client, _ = server.accept()
        drives = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        drives.connect(path)
        with client, drives:
            try:
                relay(client, drives)
            except OSError:     # the other end has gone
                pass


def main() -> None:
    """Serve."""
    server = socket.create_server(('127.0.0.1', 0))
    threading.Thread(target=run, args=(server, sys.argv[1]), daemon=True).start()
    serve({}, server.getsockname()[1])


if __name__ == '__main__':
    main()
