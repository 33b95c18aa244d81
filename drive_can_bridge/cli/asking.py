# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Asking drives of a file directly: one question at a time, and never beside another master.

Listens before the first question, and all the time; whoever else sends what only a master sends to
one of the drives ends it.
"""

from collections.abc import Callable, Sequence

from drive_can_bridge.core.configuration import BusConfiguration, DriveConfiguration
from drive_can_bridge.core.errors import BusUnavailable, DriveCanError, TransportError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.prober import Finding, Prober, Question
from drive_can_bridge.transport.end_point import EndPoint

#: s to listen for another master before the first question
LISTEN = 1.2
#: s that a receive may block
_PATIENCE = 0.005
_SEND_TIMEOUT = 0.05


class AnotherMaster(DriveCanError):
    """Somebody else talks to one of the drives."""


class Asker:
    """
    Asks drives on one open bus.

    :param drives: all drives of the file on this bus.
    :param clock: s.
    """

    def __init__(self, bus: BusConfiguration, port: EndPoint,
                 drives: Sequence[DriveConfiguration],
                 clock: Callable[[], float]) -> None:
        self._bus = bus
        self._port = port
        self._clock = clock
        self._requests = [(drive.name, route) for drive in drives for route in
                          FAMILIES[drive.protocol].make_prober(drive).requests]

    def listen(self, seconds: float) -> None:
        """
        Listen for another master.

        :raises AnotherMaster: there is one.
        :raises BusUnavailable: the bus is lost.
        """
        end = self._clock() + seconds
        while self._clock() < end:
            self._receive(min(_PATIENCE, seconds))

    def tell(self, frame: Frame) -> None:
        """Send what is not answered."""
        self._port.send(frame, _SEND_TIMEOUT)

    def probe(self, prober: Prober) -> list[Finding]:
        """
        Ask all questions of a prober.

        :raises AnotherMaster: somebody else asks, too.
        :raises TransportError: the bus takes nothing.
        :raises BusUnavailable: it is lost.
        """
        conversation = prober.converse()
        answer: Frame | None = None
        try:
            question = next(conversation)
            while True:
                answer = self.ask(question, timeout=prober.drive.parameter_timeout,
                                  retries=prober.drive.parameter_retries)
                question = conversation.send(answer)
        except StopIteration as end:
            findings: list[Finding] = end.value
            return findings

    def ask(self, question: Question, *, timeout: float, retries: int) -> Frame | None:
        """
        Ask until there is an answer, or no patience any more.

        :param timeout: s for each time.
        """
        refusal: DriveCanError | None = None
        for _ in range(retries + 1):
            self._drain()
            try:
                self._port.send(question.frame, _SEND_TIMEOUT)
                refusal = None
            except (TransportError, BusUnavailable) as error:
                refusal = error
            end = self._clock() + timeout
            while self._clock() < end:
                frame = self._receive(_PATIENCE)
                if frame is not None and question.answers(frame):
                    return frame
        if refusal is not None:
            raise TransportError(f'bus {self._bus.name}: {refusal}: no other node acknowledges')
        if question.quiet:
            self.listen(question.quiet)
        return None

    def _drain(self) -> None:
        """Throw away what came before the question: it answers nothing."""
        while self._receive(0.0) is not None:
            pass

    def _receive(self, timeout: float) -> Frame | None:
        frame = self._port.receive(timeout)
        if frame is not None:
            for name, route in self._requests:
                if route.matches(frame):
                    raise AnotherMaster(
                        f'bus {self._bus.name}: another master talks to drive {name} ({frame}); '
                        'end it first')
        return frame
