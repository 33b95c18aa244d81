# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
PDOs of a simulated drive: their objects (1400h to 1BFFh), the rules of their mapping, and traffic.

A mapping is changed as CANopenNode 4 and the manuals of Festo and Nanotec want it: only while bit
31 of the COB-ID is set, entries only while their number is 0, of objects that exist; the number is
checked against all. Fewer bytes than an object has are accepted, more are not. Other stacks check
less (:class:`Checks`).
"""

from collections.abc import Collection
from copy import deepcopy
from dataclasses import dataclass, field
from enum import Enum
import math

from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.canopen import sdo
from drive_can_bridge.simulation.canopen.sdo import (
    Absent, bytes_of, checked_length, ObjectDictionary)
from drive_can_bridge.simulation.registers import AccessRefused

COUNT, ENTRIES_MAX, BITS_MAX = 4, 8, 64
INVALID, NO_REMOTE, EXTENDED = 1 << 31, 1 << 30, 1 << 29
NOT_MAPPABLE, TOO_LONG = 0x06040041, 0x06040042
ACCESS = 0x06010000
#: below are objects that no PDO carries
_MAPPABLE_FROM = 0x2000
#: content of the communication parameters by sub-index: bytes
_WIDTHS = {1: 4, 2: 1, 3: 2, 5: 2}


class Checks(Enum):
    """The checks when a mapping is written."""

    #: everything, in every state: CANopenNode 4
    CHECKED = 'checked'
    #: everything, but nothing while pre-operational: Lely core 2.4
    OPERATIONAL = 'operational'
    #: nothing, ever: CanFestival 3, durand 0.5
    UNCHECKED = 'unchecked'


@dataclass(frozen=True)
class PdoHabits:
    """
    The differences between makers.

    :param mapping: what is checked when a mapping is written.
    :param types: transmission types that PDOs accept.
    :param fixed_mapping: mappings cannot be written.
    :param no_remote: TPDOs want bit 30 of their COB-ID.
    """

    mapping: Checks = Checks.CHECKED
    types: Collection[int] = frozenset((0, 1, 254, 255))
    fixed_mapping: bool = False
    no_remote: bool = False


@dataclass
class SimulatedPdo:
    """
    One PDO.

    :ivar pending: what an RPDO brought, until the SYNC.
    :ivar sent_at: when a TPDO left last; ``sent``: with what.
    """

    transmit: bool
    cob_id: int
    type: int = 255
    inhibit: int = 0
    event: int = 0
    count: int = 0
    entries: list[int] = field(default_factory=lambda: [0] * ENTRIES_MAX)
    pending: bytes | None = None
    sent: bytes | None = None
    sent_at: float = -math.inf

    @property
    def identifier(self) -> int | None:
        """The identifier of its frames; None: it has none."""
        return None if self.cob_id & INVALID or not self.count else self.cob_id & 0x7FF

    @property
    def mapped(self) -> list[int]:
        return self.entries[:self.count]

    @property
    def length(self) -> int:
        """Its length in bytes."""
        return sum(entry & 0xFF for entry in self.mapped) // 8


class Pdos:
    """
    All PDOs of one drive.

    :param receive: entries of the factory mapping, by number.
    :param kind: type of transmission of these.
    """

    def __init__(self, node: int, objects: ObjectDictionary, receive: dict[int, list[int]],
                 transmit: dict[int, list[int]], kind: int) -> None:
        self._objects = objects
        self.habits = PdoHabits()
        self.absent = Absent()
        self._node, self._mapped, self._kind = node, (receive, transmit), kind
        self._stored: tuple[list[SimulatedPdo], list[SimulatedPdo]] | None = None
        self.begin()

    def store(self) -> None:
        """Store the set-up in EEPROM."""
        self._stored = deepcopy((self.receive, self.transmit))

    def begin(self, *, factory: bool = False) -> None:
        """Restore the stored set-up, else that of the factory."""
        if factory:
            self._stored = None
        if self._stored is not None:
            self.receive, self.transmit = deepcopy(self._stored)
            return
        self.receive = [SimulatedPdo(False, 0x200 + 0x100 * n + self._node) for n in range(COUNT)]
        self.transmit = [SimulatedPdo(True,
                                      0x40000180 + 0x100 * n + self._node) for n in range(COUNT)]
        for pdos, made in zip((self.receive, self.transmit), self._mapped, strict=True):
            for number, entries in made.items():
                pdo = pdos[number - 1]
                pdo.count, pdo.type = len(entries), self._kind
                pdo.entries[:len(entries)] = entries

    # -- objects ----------------------------------------------------------------------------------

    def find(self, index: int) -> tuple[SimulatedPdo, bool] | None:
        """Return the PDO that an object is of, and whether it is its mapping; None: of none."""
        for base, pdos in ((0x1400, self.receive), (0x1800, self.transmit)):
            for mapping in (False, True):
                number = index - base - 0x200 * mapping
                if 0 <= number < COUNT:
                    return pdos[number], mapping
        return None

    def read(self, pdo: SimulatedPdo, mapping: bool, subindex: int) -> bytes:
        if mapping:
            if subindex == 0:
                return bytes((pdo.count,))
            if subindex <= ENTRIES_MAX:
                return pdo.entries[subindex - 1].to_bytes(4, 'little')
            raise AccessRefused(sdo.NO_SUCH_SUBINDEX)
        contents = {0: 5 if pdo.transmit else 2, 1: pdo.cob_id, 2: pdo.type}
        if pdo.transmit:
            contents |= {3: pdo.inhibit, 5: pdo.event}
        if subindex not in contents:
            raise AccessRefused(sdo.NO_SUCH_SUBINDEX)
        return contents[subindex].to_bytes(_WIDTHS.get(subindex, 1), 'little')

    def write(self, pdo: SimulatedPdo, mapping: bool, subindex: int, data: bytes, *,
              operational: bool = False) -> None:
        """Write one of its objects. :raises AccessRefused: against the rules."""
        self.read(pdo, mapping, subindex)      # it exists
        checks = self.habits.mapping
        checked = checks is Checks.CHECKED or checks is Checks.OPERATIONAL and operational
        if mapping:
            self._map(pdo, subindex, data, checked=checked)
            return
        if subindex == 0:
            raise AccessRefused(sdo.WRITE_OF_READ_ONLY)
        value = int.from_bytes(checked_length(data, _WIDTHS[subindex]), 'little')
        valid = not pdo.cob_id & INVALID
        if subindex == 1:
            if (value & EXTENDED or self.habits.no_remote and pdo.transmit
                    and not value & NO_REMOTE or checked and valid and not value & INVALID
                    and value != pdo.cob_id):
                raise AccessRefused(sdo.VALUE_OUT_OF_RANGE)
            pdo.cob_id = value
            pdo.pending = pdo.sent = None
        elif subindex == 2:
            if value not in self.habits.types:
                raise AccessRefused(sdo.VALUE_OUT_OF_RANGE)
            pdo.type = value
        elif subindex == 3:
            if valid and checked:
                raise AccessRefused(sdo.DEVICE_STATE)
            pdo.inhibit = value
        else:
            pdo.event = value

    def _map(self, pdo: SimulatedPdo, subindex: int, data: bytes, *, checked: bool) -> None:
        if self.habits.fixed_mapping or checked and (
                not pdo.cob_id & INVALID or subindex and pdo.count):
            raise AccessRefused(ACCESS)
        if subindex:
            entry = int.from_bytes(checked_length(data, 4), 'little')
            if entry and checked:
                self._mappable(pdo, entry)
            pdo.entries[subindex - 1] = entry
            return
        count = checked_length(data, 1)[0]
        if not checked:
            pdo.count = min(count, ENTRIES_MAX)
            return
        if count > ENTRIES_MAX:
            raise AccessRefused(TOO_LONG)
        for entry in pdo.entries[:count]:
            self._mappable(pdo, entry)
        if sum(entry & 0xFF for entry in pdo.entries[:count]) > BITS_MAX:
            raise AccessRefused(TOO_LONG)
        pdo.count = count

    def _mappable(self, pdo: SimulatedPdo, entry: int) -> None:
        """Check an entry. :raises AccessRefused: no such object, or it does not travel so."""
        place, bits = (entry >> 16, entry >> 8 & 0xFF), entry & 0xFF
        self.absent.check(*place)
        cell = self._objects.cells.get(place)
        if cell is None and place[0] >= _MAPPABLE_FROM:
            self._objects.find(*place)      # names what is missing
        if (cell is None or place[0] < _MAPPABLE_FROM or bits % 8 or bits > 8 * bytes_of(cell)
                or not (cell.readable if pdo.transmit else cell.writable)):
            raise AccessRefused(NOT_MAPPABLE)

    # -- traffic ----------------------------------------------------------------------------------

    def cells(self, pdo: SimulatedPdo, data: bytes) -> list[tuple[Parameter, int]]:
        """Return the parameters and raw integers in an RPDO."""
        found, at = [], 0
        for entry in pdo.mapped:
            length = (entry & 0xFF) // 8
            cell = self._cell(entry)
            if cell is not None and cell.writable:
                content = data[at:at + length][:bytes_of(cell)]
                found.append((cell, cell.raw_from_word(int.from_bytes(content, 'little'))))
            at += length
        return found

    def _cell(self, entry: int) -> Parameter | None:
        place = entry >> 16, entry >> 8 & 0xFF
        return None if place in self.absent else self._objects.cells.get(place)

    def frame(self, pdo: SimulatedPdo, now: float) -> Frame:
        """Return a TPDO with the present content of its objects."""
        pdo.sent = self.content(pdo)
        pdo.sent_at = now
        return Frame(pdo.cob_id & 0x7FF, pdo.sent, False)

    def content(self, pdo: SimulatedPdo) -> bytes:
        content = b''
        for entry in pdo.mapped:
            length, cell = (entry & 0xFF) // 8, self._cell(entry)
            told = b'' if cell is None else self._objects.content(cell)
            content += told[:length].ljust(length, b'\0')
        return content[:BITS_MAX // 8]

    def synchronised(self, pdo: SimulatedPdo) -> bool:
        """Return whether this TPDO leaves with a SYNC: with each, or with content that is new."""
        if pdo.identifier is None or pdo.type > 240:
            return False
        return bool(pdo.type) or self.content(pdo) != pdo.sent

    def due(self, pdo: SimulatedPdo) -> float:
        """Return when a TPDO leaves by its timer."""
        if pdo.identifier is None or pdo.type < 254:
            return math.inf
        inhibited = pdo.sent_at + pdo.inhibit / 10_000.0
        if pdo.sent is None:
            return -math.inf
        timed = pdo.sent_at + pdo.event / 1000.0 if pdo.event else math.inf
        return min(max(timed, inhibited), inhibited if self.content(pdo) != pdo.sent else math.inf)
