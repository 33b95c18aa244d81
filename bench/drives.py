# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The drives of the benches: a process that answers at once and notes when it was asked.

Written without the package's codec and simulation, so that nothing of the bridge is measured
against itself. What it notes is how regular the requests are as a drive sees them, whoever sends.

Drives have processors of their own. Here they go first where the system allows it, so that an
answer is not late because the machine is busy.

With a bit rate and the seconds that a drive takes for an answer, both frames and the answer take
their time, and how long that was in all is noted.
"""

from array import array
from collections.abc import Sequence
import math
import os
import socket
import struct
import sys
import threading
import time

from child import serve

CAN_FRAME = struct.Struct('=IB3x8s')
DIR = 0x10000000
CYCLIC = 0x001FFFF0
REQUEST_MAP = struct.pack('>4H', 50, 51, 60, 61)
RESPONSE_MAP = struct.pack('>4H', 209, 210, 211, 212)
STATIONS = 128
#: of a frame with 29 bits of identifier and eight bytes, with all bits that stuffing may take
FRAME_BITS = 160


class Drives:
    """All drives of the bus."""

    def __init__(self, wire: float = 0.0) -> None:
        self._wire = wire
        self._spent = 0.0
        self._last = [0.0] * STATIONS
        self._first: dict[int, float] = {}
        self._distances = array('d')
        self._values = 0
        self._enabled: set[int] = set()
        self._stops = array('d')
        #: by station and number
        self._written: dict[tuple[int, int], int] = {}

    def asked(self, station: int) -> float:
        """Note that a drive is asked in an exchange; return the time."""
        now = time.monotonic()
        last, self._last[station] = self._last[station], now
        if last:
            self._distances.append(now - last)
        elif station not in self._first:
            self._first[station] = now
        return now

    def answers(self, frame: bytes) -> Sequence[bytes]:
        """Return what the drives answer to a frame."""
        identifier, length, request = CAN_FRAME.unpack(frame)
        if identifier & CYCLIC == CYCLIC:
            station = identifier >> 21 & 127
            now = self.asked(station)
            self._values = self._values + 1 & 0x7FFF
            enabled = request[7] & 1
            if enabled:
                self._enabled.add(station)
            elif station in self._enabled:
                self._enabled.discard(station)
                self._stops.append(now)
            data = struct.pack('>4H', self._values, 1, 2, 1 | enabled << 1)
        elif identifier & 0x00100000:
            station, number = identifier >> 21 & 127, identifier >> 4 & 0xFFFF
            for place, word in enumerate(struct.unpack('>4H', request)[:length // 2]):
                self._written[station, number + place] = word
            return ()
        else:
            station, number = identifier >> 21 & 127, identifier >> 4 & 0xFFFF
            data = {122: REQUEST_MAP, 126: RESPONSE_MAP}.get(number) or struct.pack('>4H', *(
                self._written.get((station, number + place), 7 + place) for place in range(4)))
        return (CAN_FRAME.pack(identifier | DIR, 8, data),)

    def clear(self) -> bool:
        """Begin to note anew."""
        self._last = [0.0] * STATIONS
        self._distances = array('d')
        self._stops = array('d')
        self._spent = 0.0
        return True

    def spent(self) -> float:
        """Return how long frames and answers have taken, in s."""
        return self._spent

    def distances(self) -> list[float]:
        """Return the times between two requests to the same drive in s."""
        return list(self._distances)

    def first(self) -> list[float]:
        """Return when each drive was asked for the first time (steady clock, s)."""
        return list(self._first.values())

    def stops(self) -> list[float]:
        """Return when a drive got the first word that was not ``enable`` any more."""
        return list(self._stops)

    def _take_time(self) -> None:
        begun = time.monotonic()
        time.sleep(self._wire)
        self._spent += time.monotonic() - begun

    def run(self, server: socket.socket) -> None:
        """Serve one client after the other."""
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60))
        except OSError:
            pass
        while True:
            client, _ = server.accept()
            while True:
                try:
                    frame = client.recv(16)
                    if not frame:
                        break
                    replies = self.answers(frame)
                    if self._wire:
                        self._take_time()
                    for reply in replies:
                        client.send(reply)
                except OSError:
                    break
            client.close()


def main(kind: type[Drives] = Drives) -> None:
    """Listen on the Unix socket given; with a bit rate and the time of an answer, slowly."""
    server = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    server.bind(sys.argv[1])
    server.listen()
    bitrate, answer = map(float, sys.argv[2:4] or (math.inf, 0.0))
    drives = kind(2 * FRAME_BITS / bitrate + answer)
    threading.Thread(target=drives.run, args=(server,), daemon=True).start()
    serve({'clear': drives.clear, 'distances': drives.distances, 'first': drives.first,
           'stops': drives.stops, 'spent': drives.spent})


if __name__ == '__main__':
    main()
