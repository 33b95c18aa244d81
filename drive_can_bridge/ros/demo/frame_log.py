# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Every frame of the demo's buses in a file, as ``candump -L`` writes it (canplayer reads it)."""

from collections.abc import Iterable
from pathlib import Path
import threading
import time

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import TransportError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.transport.port import open_port, Port

#: s that a receive may block
_PATIENCE = 0.1


class FrameLog:
    """
    Listens on all buses with an end point of its own, until closed.

    Open it before anybody else opens the buses: python-can's virtual bus serves its end points in
    the order they came, so that no answer gets into the log before its request.

    :raises OSError: the file cannot be written.
    """

    def __init__(self, path: Path, buses: Iterable[BusConfiguration]) -> None:
        self.path = path
        self.count = 0
        self.failure = ''
        self._file = path.open('w', encoding='ascii', buffering=1)
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._threads = [
            threading.Thread(target=self._run, args=(bus.name, open_port(bus)),
                             name=f'frame log {bus.name}', daemon=True) for bus in buses]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Write what is still waiting, and close the file. The others must have stopped."""
        self._closing.set()
        for thread in self._threads:
            thread.join(timeout=1.0)
        with self._lock:
            try:
                self._file.close()
            except OSError as error:
                self.failure = self.failure or str(error.strerror)

    def _run(self, bus: str, port: Port) -> None:
        try:
            while True:
                # looked at first: what was sent before the log is closed gets into it
                closing = self._closing.is_set()
                frame = port.receive(0.0 if closing else _PATIENCE)
                if frame is not None:
                    self._write(bus, frame, time.time() - port.age)
                elif closing:
                    return
        except (OSError, TransportError) as error:
            # the file cannot take more (a full disk): the demo goes on without
            self.failure = str(error)
        finally:
            port.close()

    def _write(self, bus: str, frame: Frame, at: float) -> None:
        with self._lock:
            self._file.write(f'({at:.6f}) {bus} {frame}\n')
            self.count += 1
