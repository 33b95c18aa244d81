# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Where the parameters of a profile stand in the device, and which requests fetch them.

Where registers stand in the object dictionary of a TeSys T LTMR: the register overview of the LTMR
CANopen guide prints the first and last address of each group (statistics 2001h.01h, monitoring
2004h.01h = register 450, command 2008h.01h to .64h = 700 to 799, …). Inside a group, sub-index 1
is the first register. That 2000h and 2003h begin at 0 and 300 follows from their last registers
(96 and 429), which another overview of the vendor names. The two other rows are *interpolated*:
they follow from their neighbours.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
import re
from typing import Literal, Union

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.process_image import status_word
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.protocols.access import ParameterPlacement
from drive_can_bridge.protocols.canopen.addressing import object_of_name
from drive_can_bridge.protocols.canopen_pkw import pkw
from drive_can_bridge.protocols.canopen_pkw.pkw import Address
from drive_can_bridge.protocols.polled_exchange import Chunk, plan_reads


@dataclass(frozen=True)
class Block:
    """
    The registers of one index: ``first`` has sub-index 1.

    :param certain: printed by the vendor, or follows from what is; False: interpolated.
    """

    index: int
    first: int
    last: int
    certain: bool


BLOCKS = (
    Block(0x2000, 0, 99, True),        # identification
    Block(0x2001, 100, 199, True),     # statistics
    Block(0x2002, 200, 299, False),
    Block(0x2003, 300, 449, True),
    Block(0x2004, 450, 539, True),     # monitoring
    Block(0x2005, 540, 599, True),     # configuration
    Block(0x2006, 600, 649, False),
    Block(0x2007, 650, 699, True),
    Block(0x2008, 700, 799, True),     # command
    Block(0x200C, 1200, 1299, True),   # custom logic
    Block(0x200D, 1300, 1399, True),
)


def object_of(register: int) -> tuple[int, int] | None:
    """
    Return index and sub-index of a register; None: it has none.

    >>> '%04X.%02X' % object_of(465)
    '2004.10'
    """
    for block in BLOCKS:
        if block.first <= register <= block.last:
            return block.index, register - block.first + 1
    return None


def register_of(index: int, subindex: int) -> int | None:
    """Return the register at an index and sub-index; None: there is none."""
    for block in BLOCKS:
        if block.index == index and 1 <= subindex <= block.last - block.first + 1:
            return block.first + subindex - 1
    return None


#: registers that one request can read or write
REGISTERS_MAX = 2

_RAW_REGISTER = re.compile(r'p([0-9]{1,5})', re.ASCII)
#: sub-indices of one index, and a gap: the last one has no next
_OBJECT_STEP = 2 * (pkw.SUBINDEX_MAX + 1)

Key = Union[int, tuple[int, int]]
Addressing = Literal['register', 'canopen']


@dataclass(frozen=True, order=True)
class Span:
    """One register, or two adjacent ones; what a parameter takes, and what a request is about."""

    address: Address
    count: int = 1

    @property
    def addresses(self) -> tuple[Address, ...]:
        """The address of each register."""
        return (self.address,) if self.count == 1 else (self.address, self.address.next)


def raw_address(name: str) -> Address | None:
    """
    Read a raw parameter name; None: it is none.

    >>> str(raw_address('p465')), str(raw_address('x2004.10'))
    ('register 465', '2004h.10h')
    """
    match = _RAW_REGISTER.fullmatch(name)
    if match is not None:
        number = int(match.group(1))
        return Address(number) if number <= pkw.WORD_MAX else None
    found = object_of_name(name)
    return None if found is None else Address(*found)


def address_of(parameter: Parameter, addressing: Addressing) -> Address | None:
    """
    Return the address that requests for a parameter have; None: the profile does not give it.

    :param addressing: the drive key, for listed parameters; a raw name says itself what it is.
    """
    if not parameter.listed:
        return raw_address(parameter.name)
    if addressing == 'register':
        return None if parameter.number is None else Address(parameter.number)
    if parameter.index is None or parameter.subindex is None:
        return None
    return Address(parameter.index, parameter.subindex)


@dataclass(frozen=True, slots=True)
class Placement(ParameterPlacement[Span]):
    """
    Where the parameters of one drive stand, and how their values lie in the registers.

    :param addressing: how listed parameters are reached.
    :param word_order: of 32-bit values; the parameter's own order wins.
    """

    addressing: Addressing
    word_order: str

    @classmethod
    def of(cls, drive: DriveConfiguration) -> 'Placement':
        """Return that of a configured drive."""
        return cls(drive.options.addressing, drive.options.word_order)

    def address(self, parameter: Parameter) -> Address | None:
        """Return the address that requests for a parameter have; None: the profile gives none."""
        return address_of(parameter, self.addressing)

    def span(self, parameter: Parameter) -> Span:
        """
        Return what a parameter takes.

        :raises ValueError: the profile does not give its address (a checked configuration does).
        """
        address = self.address(parameter)
        if address is None:
            raise ValueError(f'{parameter.name} has no address to be reached by {self.addressing}')
        return Span(address, parameter.type.bits // 16)

    def addresses(self, span: Span) -> tuple[Address, ...]:
        return span.addresses

    def plan(self, spans: Iterable[Span]) -> list[Span]:
        """Cover registers by as few requests as possible: two adjacent ones share one."""
        found: list[Span] = []
        spans = list(spans)
        for by_object in (False, True):
            wanted = [Chunk(_linear(span.address), span.count) for span in spans
                      if span.address.by_object is by_object]
            found += [Span(_address(chunk.address, by_object), chunk.size)
                      for chunk in plan_reads(wanted, REGISTERS_MAX)]
        return found

    def raw(self, parameter: Parameter, words: Sequence[int]) -> int:
        if parameter.type.bits == 16:
            return parameter.raw_from_word(words[0])
        return parameter.raw_from_word(pkw.value_from_words(
            (words[0], words[1]), self._high_first(parameter)))

    def words(self, parameter: Parameter, raw: int) -> tuple[int, ...]:
        value = parameter.word_from_raw(raw)
        if parameter.type.bits == 16:
            return (value,)
        return pkw.words_from_value(value, self._high_first(parameter))

    def _high_first(self, parameter: Parameter) -> bool:
        return (parameter.word_order or self.word_order) == 'high_first'


# -- reads ----------------------------------------------------------------------------------------


def round_spans(drive: DriveConfiguration) -> list[Span]:
    """
    Return what a round brings: ``cyclic_response``, and the status word.

    What a damaged configuration does not give an address for is left out.
    """
    wanted = list(drive.cyclic_response)
    status = status_word(drive)
    if status is not None and status not in wanted:
        wanted.append(status)
    placement = Placement.of(drive)
    return [placement.span(parameter) for parameter in wanted
            if placement.address(parameter) is not None]


def round_plan(drive: DriveConfiguration) -> list[Span]:
    """Return the reads of a round."""
    return Placement.of(drive).plan(round_spans(drive))


def instead_of(span: Span, wanted: Sequence[Span]) -> list[Span]:
    """Return what is read when a read that they share is refused; nothing if it is one of them."""
    if span in wanted:
        return []
    return sorted({part for part in wanted if set(part.addresses) <= set(span.addresses)})


def _linear(address: Address) -> int:
    if address.subindex is None:
        return address.word
    return address.word * _OBJECT_STEP + address.subindex


def _address(linear: int, by_object: bool) -> Address:
    return Address(*divmod(linear, _OBJECT_STEP)) if by_object else Address(linear)


# -- the same register under two names ------------------------------------------------------------


def keys(parameter: Parameter) -> frozenset[Key]:
    """
    Return every way to name the registers of a parameter; equal keys are equal registers.

    Registers and objects are two names of one thing; where the profile gives only one of them,
    the object dictionary's known layout gives the other.
    """
    found: set[Key] = set()
    ways: tuple[Addressing, ...] = 'register', 'canopen'
    addresses = [address for way in ways
                 if (address := address_of(parameter, way)) is not None]
    for address in addresses:
        for entry in Span(address, parameter.type.bits // 16).addresses:
            if entry.subindex is None:
                found.add(entry.word)
                other: Key | None = object_of(entry.word)
            else:
                found.add((entry.word, entry.subindex))
                other = register_of(entry.word, entry.subindex)
            if other is not None and len(addresses) == 1:
                found.add(other)
    return frozenset(found)


def half_refusal(parameter: Parameter, profile: Profile) -> Sentence:
    """Return why no unlisted half of a listed parameter is written; '' if it is none."""
    if parameter.listed:
        return NOTHING
    mine = keys(parameter)
    for other in profile.parameters.values():
        if other.type.bits != parameter.type.bits and mine & keys(other):
            return sentences.one_half(other.name, other.writable)
    return NOTHING
