# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Bring the settings of a backup back into a drive.

.. code-block:: text

    before      steps of the profile: a device wants to be in a mode for it
    rounds      what differs is written and read back; what a drive refused, or did not take, is
                tried again after the others, as long as that gets on
    after       steps of the profile, whatever happened
    read back   everything that is to be as in the file

Nothing in here waits for a signal: ``stopped`` is asked between two writes, so that each write is
verified before anything ends, and the steps afterwards are always attempted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from drive_can_bridge.backup.plan import Change, RestorePlan, value_of_word
from drive_can_bridge.backup.settings import is_whole
from drive_can_bridge.client.drive import Drive, ReadOutcome, WriteOutcome
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.core.profile import RestoreStep

#: s that a drive which has gone away is waited for, so that it is not left in a mode
PATIENCE = 10.0
_PATIENCE_STEP = 0.5


@dataclass(frozen=True, slots=True)
class NotAsInFile:
    """
    A setting that is not as in the file in the end.

    :param found: what the drive has; None: it could not be read.
    :param reason: what its last write, or reading it, failed with; '' where nobody complained.
    """

    name: str
    wanted: Value
    found: Value | None
    reason: str = ''


@dataclass(slots=True)
class RestoreResult:
    """
    What became of it.

    :param written: names of the settings that were written, in that order.
    :param steps: steps of the profile that failed, in words.
    :param wrong: what is not as in the file. Empty after an interruption: nothing was compared.
    :param stopped: it was interrupted; these were not written.
    :param trouble: what ended the conversation with the drive.
    """

    written: list[str] = field(default_factory=list)
    steps: list[str] = field(default_factory=list)
    wrong: list[NotAsInFile] = field(default_factory=list)
    stopped: list[str] | None = None
    trouble: DriveCanError | None = None

    @property
    def complete(self) -> bool:
        """Everything is as in the file."""
        return not (self.steps or self.wrong or self.stopped or self.trouble)


class Restorer:
    """
    Restores one drive.

    :param stopped: tells whether the user wants it to end.
    :param clock: s.
    :param wait: waits for so many seconds.
    :param told: is told each outcome of a write.
    :param hint: takes what the user should know while it goes on.
    """

    def __init__(self, drive: Drive, plan: RestorePlan, *, stopped: Callable[[], bool],
                 clock: Callable[[], float], wait: Callable[[float], object],
                 told: Callable[[WriteOutcome], object] = lambda outcome: None,
                 hint: Callable[[str], object] = lambda text: None) -> None:
        self._drive = drive
        self._plan = plan
        self._clock = clock
        self._wait = wait
        self._told = told
        self._hint = hint
        self._is_stopped = stopped
        self._interrupted = False
        self._lost = False
        self._attempted = False
        self._reasons: dict[str, str] = {}
        self._result = RestoreResult()
        table = drive.facts.restore
        self._before = table.before if table is not None else ()
        self._after = table.after if table is not None else ()
        # what the last steps write anyway is written by them
        self._at_end = {step.parameter for step in self._after}
        self._pending = [change for change in plan.changes if change.name not in self._at_end]

    def run(self) -> RestoreResult:
        """Restore. A lost bus or bridge is in the result; what was written is known."""
        result = self._result
        try:
            self._steps(self._before)
            if not result.steps:
                self._rounds()
        except DriveCanError as error:
            result.trouble = error
        self._finish()
        try:
            if self._stopped:
                result.stopped = [change.name for change in self._plan.changes
                                  if change.name not in result.written]
            elif result.trouble is None:
                self._compare()
        except DriveCanError as error:
            result.trouble = error
        return result

    @property
    def _stopped(self) -> bool:
        self._interrupted = self._interrupted or self._is_stopped()
        return self._interrupted

    # -- the settings -----------------------------------------------------------------------------

    @property
    def _complete(self) -> bool:
        """All settings have been attempted, nothing has come between."""
        return self._attempted and not self._stopped

    def _rounds(self) -> None:
        pending: Sequence[Change] = self._pending
        while pending and not self._stopped:
            self._write_all(pending)
            if self._lost or self._stopped:
                return
            left = self._differing(pending)
            if len(left) == len(pending):
                break
            pending = left
        self._attempted = True

    def _write_all(self, changes: Sequence[Change]) -> None:
        for change in changes:
            if self._stopped:
                return
            outcome = self._write(change.name, change.value)
            # what could be read before, and cannot now: no refusal, the drive has gone
            if not (outcome.ok or self._drive.read(change.name)[change.name].ok):
                self._lost = True
                return

    def _write(self, name: str, value: Value) -> WriteOutcome:
        heard: list[WriteOutcome] = []
        try:
            outcome = self._drive.write({name: value}, told=heard.append)[name]
        except KeyboardInterrupt:
            self._interrupted = True
            # the write under way is known before this is raised
            outcome = heard[0] if heard else WriteOutcome(name, False, reason='interrupted')
        if outcome.ok:
            self._reasons.pop(name, None)
            self._note_written(name)
        else:
            self._reasons[name] = outcome.reason
        self._told(outcome)
        return outcome

    def _note_written(self, name: str) -> None:
        if name not in self._result.written:
            self._result.written.append(name)

    def _differing(self, changes: Sequence[Change]) -> list[Change]:
        outcomes = self._drive.read(*(change.name for change in changes))
        return [change for change in changes
                if not _is(outcomes[change.name], self._plan.words[change.name])]

    # -- the steps of the profile -----------------------------------------------------------------

    def _finish(self) -> None:
        """Take the steps afterwards; a drive that has gone away may come back."""
        if not self._after:
            return
        failed = self._result.steps
        already = len(failed)
        end: float | None = None
        while True:
            self._lost = False
            try:
                self._steps(self._after)
                if not self._lost or (end is not None and self._clock() >= end):
                    return
            except DriveCanError as error:
                self._result.trouble = self._result.trouble or error
                failed.extend(f'{step.parameter}: not set back' for step in self._after)
                return
            if end is None:
                end = self._clock() + PATIENCE
                names = ', '.join(dict.fromkeys(step.parameter for step in self._after))
                self._hint(f'{self._drive.name}: answers no more; waiting up to {PATIENCE:g} s '
                           f'for it, so that {names} is set back')
            del failed[already:]
            self._wait(_PATIENCE_STEP)

    def _steps(self, steps: Sequence[RestoreStep]) -> None:
        for step in steps:
            reason = self._step(step)
            if reason:
                self._result.steps.append(f'{step.parameter}: {reason}')

    def _step(self, step: RestoreStep) -> str:
        """Take a step; return why it failed."""
        name = step.parameter
        parameter = self._drive.find(name)
        if parameter is None:
            return 'the drive has no such parameter'
        # its other bits are a setting of the file, unless this is no more than leaving the mode
        wanted = self._plan.words.get(name) if self._complete else None
        word: int | None = None
        if parameter.readable:
            outcome = self._drive.read(name)[name]
            if outcome.raw is None:
                self._lost = True
                return outcome.reason
            word = parameter.word_from_raw(outcome.raw)
        elif not is_whole(step, parameter):
            return 'cannot be read, so its other bits cannot be kept'
        new = ((word or 0) if wanted is None else wanted) & ~step.mask | step.bits
        if new == word:
            return ''
        written = self._write_step(name, value_of_word(parameter, new))
        if written.ok:
            if any((name, new) == (change.name, change.word) for change in self._plan.changes):
                self._note_written(name)    # as it is to be, if nothing else was done
            return ''
        self._lost = parameter.readable and not self._drive.read(name)[name].ok
        return written.reason

    def _write_step(self, name: str, value: Value) -> WriteOutcome:
        heard: list[WriteOutcome] = []
        while True:
            try:
                return self._drive.write({name: value}, told=heard.append)[name]
            except KeyboardInterrupt:
                self._interrupted = True
                if heard:
                    return heard[0]

    # -- the end ----------------------------------------------------------------------------------

    def _compare(self) -> None:
        names = tuple(self._plan.words)
        if self._lost:
            self._result.wrong += [
                NotAsInFile(change.name, change.value, None,
                            self._reasons.get(change.name, 'the drive answers no more'))
                for change in self._plan.changes if change.name not in self._result.written]
            return
        outcomes = self._drive.read(*names) if names else {}
        changed = {change.name for change in self._plan.changes}
        for name in names:
            outcome, word = outcomes[name], self._plan.words[name]
            if _is(outcome, word):
                if name in changed:
                    self._note_written(name)
            else:
                reason = self._reasons.get(name, '') or outcome.reason
                self._result.wrong.append(
                    NotAsInFile(name, self._plan.wanted[name], outcome.value, reason))


def _is(outcome: ReadOutcome, word: int) -> bool:
    parameter = outcome.parameter
    return (outcome.raw is not None and parameter is not None
            and parameter.word_from_raw(outcome.raw) == word)
