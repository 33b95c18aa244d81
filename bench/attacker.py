# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Somebody who means harm by the local way: usage: attacker.py [USER].

Told so, it calls and says nonsense, halves of messages and too much, reads nothing and hangs up at
any time; or calls two hundred times at once for a stop of no drive. In between it only computes,
so that what is measured is what is said, and not who has the processor. Of another user where one
is named and that can be had.
"""

from collections import deque
from contextlib import suppress
import os
import random
import socket
import sys
import threading
import time
from typing import Any

from child import serve

from drive_can_bridge.process.local_way import Line, packets_of, VERSION
from drive_can_bridge.process.presence import bridges

#: what is said that is none: too long, no kind, halves, zeros, a version of tomorrow
NONSENSE = (
    b'.' + bytes(5000), b'x', b'', b'+' + b'stop\0' * 800, b'.' + bytes(4000), b'.\xff\xfe\0',
    *packets_of(['9', 'stop', '*']), *packets_of([VERSION, 'fly']),
    *packets_of([VERSION, 'get', '/drive0', *['x'] * 100]), *packets_of([VERSION, 'who']))
#: connections that are kept open; that call at once; s that these wait for their answers
KEPT, CALLERS, PATIENCE = 250, 200, 5.0


class Attacker:
    """Does harm in a thread of its own."""

    def __init__(self) -> None:
        self._do = self.compute
        self._kept: deque[socket.socket] = deque()
        self._random = random.Random(1)
        self._said = self._answered = 0
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        while True:
            self._do()

    def compute(self) -> None:
        """Say nothing."""
        sum(range(10000))

    def talk(self) -> None:
        """Call, and say nonsense."""
        for bridge in bridges():
            caller = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            caller.setblocking(False)
            self._kept.append(caller)
            with suppress(OSError):
                caller.connect(bridge.address)
                for _ in range(self._random.randrange(4)):
                    caller.send(self._random.choice(NONSENSE))
                    self._said += 1
        while len(self._kept) > KEPT or self._kept and self._random.random() < 0.5:
            self._kept.popleft().close()

    def call(self) -> None:
        """Call for a stop, two hundred times at once, and hear what is said."""
        lines: list[Line] = []
        for bridge in bridges():
            for _ in range(CALLERS):
                with suppress(OSError):
                    lines.append(Line(bridge))
                    lines[-1].ask('stop', '*', 'no_drive_of_ours')
                    self._said += 1
        until = time.monotonic() + PATIENCE
        while lines and time.monotonic() < until:
            for line in list(lines):
                with suppress(OSError):
                    message = line.take()
                    if message is None:
                        continue
                    if message[0] != 'end':
                        continue
                    self._answered += 1
                line.close()
                lines.remove(line)
        for line in lines:
            line.close()

    def become(self, what: Any) -> list[int]:
        """Do something else from now on; return what was said meanwhile, and answered."""
        found, self._said, self._answered = [self._said, self._answered], 0, 0
        self._do = what
        while what == self.compute and self._kept:
            self._kept.popleft().close()
        return found


def main() -> None:
    """Obey."""
    if sys.argv[1:] and os.geteuid() == 0:
        os.setgroups([])
        os.setresuid(*[int(sys.argv[1])] * 3)
    attacker = Attacker()
    serve({'talk': lambda: attacker.become(attacker.talk),
           'call': lambda: attacker.become(attacker.call),
           'calm': lambda: attacker.become(attacker.compute)})


if __name__ == '__main__':
    main()
