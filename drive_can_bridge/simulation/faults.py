# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Scripted faults of a simulated drive, and what they do to its answers.

A fault is written ``silent`` or ``late=0.15``. Some are states, which add up and last until
``ok``; some happen once.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
import heapq
from itertools import count
import math
from typing import Any

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.text import nearest


def number(kind: type[Any], low: float, high: float) -> Callable[[str], Any]:
    """Return a function that reads a number within limits."""
    def convert(text: str) -> Any:
        value = kind(text)
        if not low <= value <= high:    # nor is what is no number
            raise ValueError
        return value
    return convert


def _pair(text: str) -> str:
    first, _, second = text.partition(':')
    if not (first.strip() and second.strip()):
        raise ValueError
    return f'{first.strip()}:{second.strip()}'


def read_keys(text: str, keys: Mapping[str, tuple[str, Callable[[str], Any]]]) -> dict[str, Any]:
    """
    Read ``load=0.3,noise=1``.

    :param keys: what is allowed, in words and as a function.
    :raises ValueRefused: with what is allowed.
    """
    given: dict[str, Any] = {}
    for part in text.split(','):
        key, _, value = map(str.strip, part.partition('='))
        try:
            given[key] = keys[key][1](value)
        except (KeyError, ValueError):
            raise ValueRefused(command_sentences.habit_impossible(
                part=part.strip(), allowed=', '.join(
                    f'{name}={what}' for name, (what, _) in keys.items()))) from None
    return given


_seconds = number(float, 0.0, 3600.0)
_count = number(int, 1, math.inf)


class FaultKind(Enum):
    """The faults of a drive: how each is written, its effect, its argument."""

    SILENT = 'silent', 'obeys, but answers nothing'
    LATE = 'late=SECONDS', 'answers that much later (0 to 3600)', _seconds
    DROP = 'drop=N', 'every Nth answer is lost (1: all)', _count
    LENGTH = 'length=BYTES', 'answers have 0 to 8 data bytes', number(int, 0, 8)
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
    STO = 'sto', 'no torque: the input for safe torque off is low, until ok'
    RESTART = ('restart[=SECONDS]', 'power is lost and back; deaf for 0.5 s, or as long as it '
               'says', _seconds)
    POWER_CUT = 'power_cut[=SECONDS]', 'the same for 5 s, or as long as it says', _seconds
    CUT_AT = ('cut_at=N', 'the Nth write of a setting from now on is obeyed; before its answer '
              'power is cut, until ok or restart', _count)
    FORGET = 'forget[=SECONDS]', 'restart with empty maps', _seconds
    OFF = 'off', 'no power, until ok or restart'
    OK = 'ok', 'all faults end'

    def __init__(self, usage: str, meaning: str,
                 convert: Callable[[str], Any] | None = None) -> None:
        self.usage, self.meaning, self.convert = usage, meaning, convert
        self.word = usage.partition('=')[0].rstrip('[')
        self.required = convert is not None and '[' not in usage


_BY_WORD = {kind.word: kind for kind in FaultKind}


def usage_lines() -> list[str]:
    """Return a line for each fault: how it is written, and what it does."""
    width = max(len(kind.usage) for kind in FaultKind)
    return [f'  {kind.usage:{width}}  {kind.meaning}' for kind in FaultKind]


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault to be played, with its argument where it has one: a number or a string."""

    kind: FaultKind
    argument: Any = None

    def __str__(self) -> str:
        return self.kind.word if self.argument is None else f'{self.kind.word}={self.argument}'


def parse_fault(text: str) -> Fault:
    """
    Return the fault in a text.

    :raises ValueRefused: unknown, or its argument is missing or wrong; with what is allowed.
    """
    word, equals, argument = (part.strip() for part in text.partition('='))
    kind = _BY_WORD.get(word)
    if kind is None:
        near = nearest(word, _BY_WORD)
        hint = f' (nearest: {near})' if near else ''
        raise ValueRefused(command_sentences.simulated_fault_unknown(
            word=word, hint=hint, allowed=', '.join((kind.usage for kind in FaultKind))))
    if not equals and not kind.required:
        return Fault(kind)
    if kind.convert is None or not argument:
        raise ValueRefused(command_sentences.simulated_fault_form(
            text=text.strip(), usage=kind.usage))
    try:
        return Fault(kind, kind.convert(argument))
    except ValueError:
        raise ValueRefused(command_sentences.simulated_fault_argument(
            argument=argument, usage=kind.usage, meaning=kind.meaning)) from None


class FaultyOutbox:
    """
    The frames of a drive, with the scripted faults of its answers.

    :param foreign_frames: returns the frames that accompany an answer under ``foreign``.
    :ivar frames: those to be sent now; faults do not affect what is put here directly.
    """

    FAULTS = frozenset((FaultKind.SILENT, FaultKind.LATE, FaultKind.DROP, FaultKind.LENGTH,
                        FaultKind.FOREIGN, FaultKind.DUPLICATE))

    def __init__(self, foreign_frames: Callable[[Frame], list[Frame]]) -> None:
        self.frames: list[Frame] = []
        self.faults: dict[FaultKind, Fault] = {}
        self._foreign_frames = foreign_frames
        self._answers = 0
        self._late: list[tuple[float, int, list[Frame]]] = []
        self._order = count()       # keeps answers of one time in their order

    def add(self, fault: Fault) -> None:
        """Apply a fault; it replaces one of the same kind."""
        self.faults[fault.kind] = fault
        self._answers = 0

    def answer(self, frame: Frame, now: float) -> None:
        """Send an answer, subject to the faults."""
        faults = self.faults
        if not faults:
            self.frames.append(frame)
            return
        self._answers += 1
        drop, length, late = (faults[kind].argument if kind in faults else None for kind in (
            FaultKind.DROP, FaultKind.LENGTH, FaultKind.LATE))
        if FaultKind.SILENT in faults or drop and self._answers % drop == 0:
            return
        spoilt = frame
        if length is not None:
            spoilt = frame._replace(data=(frame.data + bytes(8))[:length])
        frames = [spoilt, spoilt] if FaultKind.DUPLICATE in faults else [spoilt]
        if FaultKind.FOREIGN in faults:
            frames = self._foreign_frames(frame) + frames
        if late:
            heapq.heappush(self._late, (now + late, next(self._order), frames))
        else:
            self.frames += frames

    def next_timer(self) -> float:
        """Return when the next late answer is due; infinity: never."""
        return self._late[0][0] if self._late else math.inf

    def handle_timer(self, now: float) -> None:
        while self.next_timer() <= now:
            self.frames += heapq.heappop(self._late)[2]

    def clear(self) -> None:
        self.frames.clear()
        self._late.clear()
