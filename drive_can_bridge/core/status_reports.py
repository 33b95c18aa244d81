# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the drives behind one control word report, and what follows from all of it together.

A drive that is addressed by itself is a set of one; the drives of a broadcast group are several.
What they confirm, all of them have to confirm; a fault, or an output that is on, is enough in one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.profile import ControlTable, StatusPattern


@dataclass(slots=True)
class _Member:
    """The last reports of one drive."""

    raw: int | None = None      # the last status word
    answer: int | None = None   # the last one since the current control word left


@dataclass(frozen=True)
class Wording:
    """
    How status words are put in words where the family knows more than the table.

    :param state: (status word) -> state.
    :param hint: (status word) -> what keeps the drive in that state, '' for nothing.
    """

    state: Callable[[int], str]
    hint: Callable[[int], Sentence]


class StatusReports:
    """
    The status words of a set of drives that share a control word.

    :param members: their names; one drive alone has no name, and is always there.
    """

    def __init__(self, table: ControlTable, members: Sequence[str] = ()) -> None:
        self._table = table
        self._members = members
        self._present = {} if members else {'': _Member()}
        self._running = table.running or table.enabled

    # -- inputs -----------------------------------------------------------------------------------

    def find(self, name: str) -> None:
        """Record that a member is online."""
        self._present[name] = _Member()

    def lose(self, name: str) -> bool:
        """Record that a member is offline; return whether it was online."""
        return self._present.pop(name, None) is not None

    def take(self, name: str, raw: int | None, *, counts: bool) -> bool:
        """
        Record a status word.

        :param raw: None where a response arrived that should hold one, but did not.
        :param counts: it arrived after the current control word had left.
        :return: False: the member is not there.
        """
        member = self._present.get(name)
        if member is None:
            return False
        member.raw = raw
        if counts:
            member.answer = raw
        return True

    def forget_answers(self) -> None:
        """Record that the control word has changed."""
        for member in self._present.values():
            member.answer = None

    def forget(self) -> None:
        """Forget all reports."""
        for member in self._present.values():
            member.raw = member.answer = None

    # -- what they say ----------------------------------------------------------------------------

    @property
    def missing(self) -> list[str]:
        """The members that are offline."""
        return [name for name in self._members if name not in self._present]

    @property
    def answered(self) -> bool:
        """Whether one of them has reported since the current control word left."""
        return any(member.answer is not None for member in self._present.values())

    @property
    def telling(self) -> int | None:
        """The status word that matters most: of a fault, else of a member that lags behind."""
        raws = [member.raw for member in self._present.values() if member.raw is not None]
        faults = [raw for raw in raws if _matches(self._table.fault, raw)]
        behind = [raw for raw in raws if not _matches(self._running, raw)]
        return next(iter((*faults, *behind, *raws)), None)

    @property
    def faulted(self) -> bool:
        """Whether one of them reports a fault, as far as is known."""
        fault = self._table.fault
        if fault is not None:
            for member in self._present.values():
                if member.raw is not None and fault.matches(member.raw):
                    return True
        return False

    def says(self, pattern: StatusPattern | None) -> bool:
        """Return whether the status word that matters most fulfils a condition."""
        raw = self.telling
        return raw is not None and _matches(pattern, raw)

    @property
    def braking(self) -> bool:
        """Whether one of them reports a quick stop, which ``disable`` would end."""
        return any(member.raw is not None and _matches(self._table.braking, member.raw)
                   for member in self._present.values())

    @property
    def sound_ones_run(self) -> bool:
        """Whether one of them reports that it runs, and no fault."""
        running = self._running
        return running is not None and any(
            member.raw is not None and running.matches(member.raw)
            and not _matches(self._table.fault, member.raw)
            for member in self._present.values())

    def confirmed(self, pattern: StatusPattern, wanted: bool) -> bool:
        """Return whether all that know the current word report a condition, or its opposite."""
        return self._all(lambda answer: pattern.matches(answer) is wanted)

    @property
    def standing(self) -> bool:
        """Whether all of them, knowing the current word, report that they do not run."""
        return self._running is not None and self.confirmed(self._running, False)

    @property
    def off(self) -> bool:
        """Whether all of them report that they do not run, whatever word they know."""
        running = self._running
        return running is not None and all(
            member.raw is not None and not running.matches(member.raw)
            for member in self._present.values())

    @property
    def running_on(self) -> bool:
        """Whether one of them, knowing the current word, reports that it runs."""
        # they may answer in turn: one without an answer yet does not count
        running = self._running
        if running is not None:
            for member in self._present.values():
                if member.answer is not None and running.matches(member.answer):
                    return True
        return False

    @property
    def resettable(self) -> bool:
        """Whether there is a fault, and all, knowing the current word, can have it reset."""
        table = self._table
        return (self._all(lambda answer: not _matches(table.reaction, answer))
                and any(_matches(table.fault, member.answer)
                        for member in self._present.values() if member.answer is not None))

    def _all(self, condition: Callable[[int], bool]) -> bool:
        return bool(self._present) and all(
            member.answer is not None and condition(member.answer)
            for member in self._present.values())

    # -- in words ---------------------------------------------------------------------------------

    @property
    def text(self) -> Sentence:
        """The last status words."""
        if self._members and self._present:
            return sentences.status_words(
                {name: member.raw for name, member in self._present.items()})
        raw = self.telling
        return sentences.no_status_word() if raw is None else sentences.status_word(raw)

    def states(self, state_of: Callable[[int], str]) -> str:
        """Return the common state of all, or the states of all by name."""
        states = {name: 'unknown' if member.raw is None else state_of(member.raw)
                  for name, member in self._present.items()}
        if len(set(states.values())) == 1:
            return next(iter(states.values()))
        return ', '.join(f'{name}: {state}' for name, state in states.items()) or 'unknown'


def _matches(pattern: StatusPattern | None, raw: int) -> bool:
    return pattern is not None and pattern.matches(raw)


def state_text(reports: StatusReports, table: ControlTable, wording: Wording | None,
               sending: ControlAction, sent: bool) -> str:
    """
    Return the state of a drive in words.

    ``fault``, ``enabled``, ``ready``, ``not ready``, ``disabled`` (where the profile has no
    condition for ready), ``enable sent`` and the like (where the drive does not report), or
    ``unknown``.

    :param sending: what the current control word is for.
    :param sent: it has left.
    """
    if wording is not None:
        return reports.states(wording.state)
    says = reports.says
    if any((table.ready, table.enabled, table.fault)) and reports.telling is None:
        return 'unknown'
    if says(table.fault):
        return 'fault'
    if says(table.enabled):
        return 'enabled'
    if table.ready is not None and (
            table.enabled is not None or sending is ControlAction.DISABLE):
        return 'ready' if says(table.ready) else 'not ready'
    if table.enabled is not None:
        return 'disabled'
    return f'{sending.value} sent' if sent else 'unknown'


def stuck_text(reports: StatusReports, table: ControlTable, wording: Wording | None, state: str,
               timeout: float, sending: ControlAction, word: int, *, sent: bool, pulsed: bool,
               acknowledged: bool, fault: str = '', more: Sentence = NOTHING) -> Sentence:
    """
    Return that nothing was confirmed in time, and as much as is known of the reason.

    :param sending: what the current control word is for.
    :param pulsed: the pulse that resets a fault has left.
    :param acknowledged: ``sent`` says that the drive has acknowledged the word.
    :param fault: which one it is, if that is known.
    :param more: what the family knows.
    """
    if pulsed and reports.answered:
        return sentences.fault_present(timeout, reports.text, fault)
    remarks: list[Sentence] = []
    if not sent:
        remarks.append(sentences.word_not_acknowledged(word) if acknowledged else
                       sentences.word_not_sent(word))
    elif not reports.answered:
        remarks.append(sentences.no_status_since(word))
    elif reports.says(table.enabled):
        remarks.append(sentences.word_not_followed(word))
    if sending is ControlAction.QUICK_STOP:     # which is what keeps it there
        if not reports.braking:
            remarks.append(sentences.now_disable())
        elif not more:      # else the family says that it brakes, and that the word stays
            remarks.append(sentences.word_stays())
    elif wording is not None and reports.telling is not None:
        hint = wording.hint(reports.telling)
        remarks += [hint] if hint else []
    return sentences.stuck(timeout, state, reports.text, [*remarks, more] if more else remarks)


def success_text(table: ControlTable, sending: ControlAction, state: str) -> Sentence:
    """Return the state reached, or that it is not reported."""
    return (sentences.state_not_reported(sending.value) if table.enabled is None else
            sentences.state_reached(state))


def disregard_text(reports: StatusReports, state: str, sending: ControlAction,
                   word: int) -> Sentence:
    """Return that a drive runs on although commanded to stop, and what to do."""
    return sentences.disregards(state, reports.text, sending.value, word)
