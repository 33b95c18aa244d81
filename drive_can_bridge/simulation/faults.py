# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Scripted faults of a simulated drive, and what they do to its answers.

A fault is written ``silent`` or ``late=0.15``. Some are states, which add up and last until
``ok``; some happen once.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
import math

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.words import nearest


class FaultKind(Enum):
    """What can be wrong with a drive."""

    SILENT = 'silent'
    LATE = 'late'
    DROP = 'drop'
    LENGTH = 'length'
    FOREIGN = 'foreign'
    DUPLICATE = 'duplicate'
    STUCK = 'stuck'
    REFUSE = 'refuse'
    TRIP = 'trip'
    RESTART = 'restart'
    POWER_CUT = 'power_cut'
    FORGET = 'forget'
    OFF = 'off'
    OK = 'ok'


@dataclass(frozen=True)
class _Rule:
    """How a fault is written, what it does, and which argument it takes."""

    usage: str
    meaning: str
    required: bool = False
    convert: Callable[[str], float | int | str] | None = None


def _seconds(text: str) -> float:
    value = float(text)
    if not (math.isfinite(value) and 0.0 <= value <= 3600.0):
        raise ValueError
    return value


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise ValueError
    return value


def _bytes(text: str) -> int:
    value = int(text)
    if not 0 <= value <= 8:
        raise ValueError
    return value


_RULES = {
    FaultKind.SILENT: _Rule('silent', 'obeys, but answers nothing'),
    FaultKind.LATE: _Rule('late=SECONDS', 'answers that much later (0 to 3600)', True, _seconds),
    FaultKind.DROP: _Rule('drop=N', 'every Nth answer is lost (1: all)', True, _count),
    FaultKind.LENGTH: _Rule('length=BYTES', 'answers have 0 to 8 data bytes', True, _bytes),
    FaultKind.FOREIGN: _Rule('foreign', 'frames nobody should send accompany the answers'),
    FaultKind.DUPLICATE: _Rule('duplicate', 'each answer is sent twice'),
    FaultKind.STUCK: _Rule('stuck=PARAMETER', 'writes to the parameter have no effect', True, str),
    FaultKind.REFUSE: _Rule('refuse=PARAMETER', 'writes to the parameter are refused (as far as '
                            'the protocol can)', True, str),
    FaultKind.TRIP: _Rule('trip[=SECONDS]', 'fault of the drive itself; cannot be reset before '
                          'the seconds are over', False, _seconds),
    FaultKind.RESTART: _Rule('restart[=SECONDS]', 'power is lost and back; deaf for 0.5 s, or as '
                             'long as it says', False, _seconds),
    FaultKind.POWER_CUT: _Rule('power_cut[=SECONDS]', 'the same for 5 s, or as long as it says',
                               False, _seconds),
    FaultKind.FORGET: _Rule('forget[=SECONDS]', 'restart with empty maps', False, _seconds),
    FaultKind.OFF: _Rule('off', 'no power, until ok or restart'),
    FaultKind.OK: _Rule('ok', 'all faults end'),
}
_BY_NAME = {kind.value: kind for kind in FaultKind}
USAGE = tuple((rule.usage, rule.meaning) for rule in _RULES.values())


@dataclass(frozen=True)
class Fault:
    """A fault to be played, with its argument where it has one."""

    kind: FaultKind
    argument: float | int | str | None = None

    def __str__(self) -> str:
        """Write the fault as it is read."""
        return self.kind.value if self.argument is None else f'{self.kind.value}={self.argument}'

    @property
    def number(self) -> float | None:
        """The argument of a fault that takes seconds or a count."""
        return None if self.argument is None or isinstance(self.argument, str) else self.argument


def parse_fault(text: str) -> Fault:
    """
    Read a fault.

    :raises ValueRefused: unknown, or its argument is missing or wrong; says what is allowed.
    """
    name, equals, argument = text.strip().partition('=')
    name, argument = name.strip(), argument.strip()
    kind = _BY_NAME.get(name)
    if kind is None:
        near = nearest(name, _BY_NAME)
        hint = f' (nearest: {near})' if near else ''
        raise ValueRefused(f"unknown fault '{name}'{hint}; allowed: "
                           f"{', '.join(usage for usage, _ in USAGE)}")
    rule = _RULES[kind]
    if not equals and not rule.required:
        return Fault(kind)
    if rule.convert is None or not argument:
        raise ValueRefused(f"'{text.strip()}' is not a fault, write {rule.usage}")
    try:
        return Fault(kind, rule.convert(argument))
    except ValueError:
        raise ValueRefused(f"'{argument}' is not possible, write {rule.usage}: "
                           f'{rule.meaning}') from None


class AnswerFaults:
    """
    The faults of a drive's answers.

    :param foreign_frames: makes the frames that accompany an answer under ``foreign``.
    """

    KINDS = frozenset((FaultKind.SILENT, FaultKind.LATE, FaultKind.DROP, FaultKind.LENGTH,
                       FaultKind.FOREIGN, FaultKind.DUPLICATE))

    def __init__(self, foreign_frames: Callable[[Frame], list[Frame]]) -> None:
        self._foreign_frames = foreign_frames
        self._active: dict[FaultKind, Fault] = {}
        self._answers = 0

    def __bool__(self) -> bool:
        """Tell whether anything is wrong."""
        return bool(self._active)

    @property
    def active(self) -> list[Fault]:
        """The faults in force."""
        return list(self._active.values())

    def add(self, fault: Fault) -> None:
        """Put a fault into force; it replaces one of the same kind."""
        self._active[fault.kind] = fault
        self._answers = 0

    def clear(self) -> None:
        """End all of them."""
        self._active.clear()

    def apply(self, answer: Frame) -> tuple[float, list[Frame]]:
        """
        Spoil an answer.

        :return: seconds to wait, and the frames to be sent then.
        """
        active = self._active
        self._answers += 1
        drop = active.get(FaultKind.DROP)
        if FaultKind.SILENT in active or drop and self._answers % int(drop.number or 1) == 0:
            return 0.0, []
        length = active.get(FaultKind.LENGTH)
        frame = answer
        if length is not None:
            size = int(length.number or 0)
            frame = frame._replace(data=(frame.data + bytes(8))[:size])
        frames = [frame, frame] if FaultKind.DUPLICATE in active else [frame]
        if FaultKind.FOREIGN in active:
            frames = self._foreign_frames(answer) + frames
        late = active.get(FaultKind.LATE)
        return (late.number or 0.0) if late else 0.0, frames
