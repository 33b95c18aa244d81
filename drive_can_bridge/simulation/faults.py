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

Argument = float | int | str


def _seconds(text: str) -> float:
    value = float(text)
    if not (math.isfinite(value) and 0.0 <= value <= 3600.0):
        raise ValueError
    return value


def _integer(low: int, high: int | None) -> Callable[[str], int]:
    def convert(text: str) -> int:
        value = int(text)
        if value < low or high is not None and value > high:
            raise ValueError
        return value
    return convert


def _pair(text: str) -> str:
    first, _, second = text.partition(':')
    if not (first.strip() and second.strip()):
        raise ValueError
    return f'{first.strip()}:{second.strip()}'


class FaultKind(Enum):
    """What can be wrong with a drive: how it is written, what it does, its argument."""

    SILENT = 'silent', 'obeys, but answers nothing'
    LATE = 'late=SECONDS', 'answers that much later (0 to 3600)', _seconds
    DROP = 'drop=N', 'every Nth answer is lost (1: all)', _integer(1, None)
    LENGTH = 'length=BYTES', 'answers have 0 to 8 data bytes', _integer(0, 8)
    FOREIGN = 'foreign', 'frames nobody should send accompany the answers'
    DUPLICATE = 'duplicate', 'each answer is sent twice'
    STUCK = 'stuck=PARAMETER', 'writes to the parameter have no effect', str
    REFUSE = 'refuse=PARAMETER', 'writes to it are refused, as far as the protocol can', str
    NEEDS = ('needs=PARAMETER:OTHER', 'writes to it are refused until the other one was written '
             'since power came on', _pair)
    SET = ('set=PARAMETER:VALUE', 'gives a parameter a value by hand, also a read-only one; an '
           'actual value stays there until ok', _pair)
    TRIP = ('trip[=SECONDS]', 'fault of the drive itself; cannot be reset before the seconds are '
            'over', _seconds)
    RESTART = ('restart[=SECONDS]', 'power is lost and back; deaf for 0.5 s, or as long as it '
               'says', _seconds)
    POWER_CUT = 'power_cut[=SECONDS]', 'the same for 5 s, or as long as it says', _seconds
    CUT_AT = ('cut_at=N', 'the Nth write of a setting from now on is obeyed; before its answer '
              'power is cut, until ok or restart', _integer(1, None))
    FORGET = 'forget[=SECONDS]', 'restart with empty maps', _seconds
    OFF = 'off', 'no power, until ok or restart'
    OK = 'ok', 'all faults end'

    def __init__(self, usage: str, meaning: str,
                 convert: Callable[[str], Argument] | None = None) -> None:
        self.usage, self.meaning, self.convert = usage, meaning, convert
        self.word = usage.partition('=')[0].rstrip('[')
        self.required = convert is not None and '[' not in usage


_BY_WORD = {kind.word: kind for kind in FaultKind}
USAGE = tuple((kind.usage, kind.meaning) for kind in FaultKind)


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault to be played, with its argument where it has one."""

    kind: FaultKind
    argument: Argument | None = None

    def __str__(self) -> str:
        """Write the fault as it is read."""
        return self.kind.word if self.argument is None else f'{self.kind.word}={self.argument}'

    @property
    def pair(self) -> tuple[str, str]:
        """Both halves of an argument with a colon; the second is '' where there is none."""
        first, _, second = str(self.argument).partition(':')
        return first, second

    @property
    def number(self) -> float | None:
        """The argument of a fault that takes seconds or a count."""
        return None if isinstance(self.argument, str) else self.argument


def parse_fault(text: str) -> Fault:
    """
    Read a fault.

    :raises ValueRefused: unknown, or its argument is missing or wrong; says what is allowed.
    """
    word, equals, argument = (part.strip() for part in text.partition('='))
    kind = _BY_WORD.get(word)
    if kind is None:
        near = nearest(word, _BY_WORD)
        hint = f' (nearest: {near})' if near else ''
        raise ValueRefused(f"unknown fault '{word}'{hint}; allowed: "
                           f"{', '.join(usage for usage, _ in USAGE)}")
    if not equals and not kind.required:
        return Fault(kind)
    if kind.convert is None or not argument:
        raise ValueRefused(f"'{text.strip()}' is not a fault, write {kind.usage}")
    try:
        return Fault(kind, kind.convert(argument))
    except ValueError:
        raise ValueRefused(f"'{argument}' is not possible, write {kind.usage}: "
                           f'{kind.meaning}') from None


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
