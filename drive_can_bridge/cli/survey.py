# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Looking for drives on a bus: listening first, then asking what nobody can misunderstand.

On 11-bit identifiers a read of one family is a command of another. So only families whose
questions mean nothing to others are asked by default; another one only when it is named, and never
once a CANopen node was heard or has answered, whose process data it might overwrite.
"""

from collections.abc import Callable

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusUnavailable, TransportError
from drive_can_bridge.core.frame import bits_on_bus, Frame, STUFFING
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.scout import Scout, Sighting
from drive_can_bridge.transport.end_point import EndPoint

#: share of the bus that questions and their answers may take at most
LOAD_MAX = 0.3
#: s that the last answer is waited for
LAST_ANSWER = 0.3
#: s that a receive may block
_PATIENCE = 0.005
_SEND_TIMEOUT = 0.05
#: frames in a row that the bus does not take, until nothing more is sent
_REFUSED_MAX = 5


class Survey:
    """
    What is found on one bus.

    :ivar frames: frames heard.
    :ivar unknown: those that no family recognises an identifier of.
    :ivar trouble: why nothing can be sent; '': it can.
    """

    def __init__(self, bus: BusConfiguration, port: EndPoint,
                 clock: Callable[[], float]) -> None:
        self._bus = bus
        self._port = port
        self._clock = clock
        self.scouts: dict[str, Scout] = {name: family.make_scout()
                                         for name, family in FAMILIES.items()}
        self.frames = 0
        self.trouble = ''

    @property
    def master(self) -> str:
        """What somebody else asks; '': nobody does."""
        return next((scout.master for scout in self.scouts.values() if scout.master), '')

    @property
    def nodes(self) -> dict[int, str]:
        """CANopen nodes, whatever they are."""
        return {node: text for scout in self.scouts.values()
                for node, text in scout.nodes.items()}

    @property
    def sightings(self) -> list[Sighting]:
        """All drives found, by family and station."""
        return [scout.sightings[station] for scout in self.scouts.values()
                for station in sorted(scout.sightings)]

    def forbidden(self, scout: Scout) -> bool:
        """Tell whether somebody is there who might obey what a scout asks."""
        return not scout.unmistakable and bool(self.nodes)

    def listen(self, seconds: float) -> None:
        """
        Hear what is said.

        :raises BusUnavailable: the bus is lost.
        """
        end = self._clock() + seconds
        while self._clock() < end:
            self._hear(_PATIENCE)

    def ask(self, protocol: str) -> None:
        """
        Ask all stations of a family, and what their answers make worth asking.

        Ends at once when a master is heard, or the bus takes nothing, or when a CANopen node turns
        up that might take the questions for process data.

        :raises BusUnavailable: the bus is lost.
        """
        scout = self.scouts[protocol]
        scout.begin()
        due = self._clock()
        quiet_at = 0.0
        refused = 0
        # a node that was asleep may boot meanwhile
        while not self.master and not self.trouble and not self.forbidden(scout):
            now = self._clock()
            if now < due:
                self._hear(min(_PATIENCE, due - now))
                continue
            question = scout.take_question()
            if question is None:
                quiet_at = quiet_at or now + LAST_ANSWER
                if now >= quiet_at:
                    return
                self._hear(_PATIENCE)
                continue
            quiet_at = 0.0
            due = now + self._pause(question)
            scout.asked(question, now)
            try:
                self._port.send(question, _SEND_TIMEOUT)
                refused = 0
            except (TransportError, BusUnavailable) as error:
                refused += 1
                if refused >= _REFUSED_MAX:
                    self.trouble = f'{error}: no other node acknowledges'

    def _pause(self, frame: Frame) -> float:
        """Return s from a question to the next: both it and its answer count."""
        both = 2 * STUFFING * bits_on_bus(8, frame.extended)
        return both / (LOAD_MAX * self._bus.bitrate)

    def _hear(self, timeout: float) -> None:
        frame = self._port.receive(timeout)
        if frame is None:
            return
        self.frames += 1
        now = self._clock() - self._port.age
        for scout in self.scouts.values():
            scout.hear(frame, now)
