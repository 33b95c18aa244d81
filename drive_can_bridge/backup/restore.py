# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Restore the settings of a backup into a drive.

.. code-block:: text

    before      steps of the profile: a device wants to be in a mode for it
    rounds      what differs is written and read back; what was refused, or not stored, is tried
                again after the others, as long as that helps
    after       steps of the profile, whatever happened: written without reading, for a drive whose
                answers get lost may receive them all the same; one that cannot be read a few times
                at most, for it may be what stores
    read back   everything that is to be as in the file

``stopped`` is called between two writes, so that each is verified before anything ends. Before
each it is checked whether the drive was enabled meanwhile: then only the steps afterwards follow.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import Enum

from drive_can_bridge.backup.document import (
    Backup, Head, in_order, is_command, is_setting, is_whole, mode_bits, ModeBits, modes_of,
    raw_in_file)
from drive_can_bridge.client.drive import Drive, Enabled, ReadOutcome, WriteOutcome
from drive_can_bridge.core import command_sentences, sentences
from drive_can_bridge.core.errors import DriveCanError, ValueRefused
from drive_can_bridge.core.parameters import Parameter, Value
from drive_can_bridge.core.profile import RestoreStep
from drive_can_bridge.core.requests import Failure, FailureKind
from drive_can_bridge.core.roles import Role
from drive_can_bridge.core.text import printable, value_text

#: s that a drive which is gone is waited for, so that it is not left in a mode
PATIENCE = 10.0
_PATIENCE_STEP = 0.5
#: times that a step afterwards is written to a silent drive, for its cells may
#: wear, and to one that is there and does not answer it
_ATTEMPTS = 3
_NO_PARAMETER = Failure(FailureKind.INVALID, sentences.drive_has_not())
_NO_BITS = Failure(FailureKind.INVALID, sentences.other_bits_lost())


class LeftAlone(Enum):
    """Why a setting of a file is not written."""

    PROTECTED = 'protected'
    MAP = 'map'
    CYCLIC = 'cyclic'
    CONTROL = 'control'
    MODE = 'mode'
    COMMAND = 'command'

    @property
    def text(self) -> str:
        """The reason in words, with what helps."""
        return _LEFT_ALONE[self]


_LEFT_ALONE = {
    LeftAlone.PROTECTED: 'protected by its profile: --include-protected restores it',
    LeftAlone.MAP: 'a map: restored with --params-file only',
    LeftAlone.CYCLIC: 'a setpoint: sent cyclically',
    LeftAlone.CONTROL: 'the control word',
    LeftAlone.COMMAND: 'a setpoint or a control word, in some mode: no setting',
    LeftAlone.MODE: "a mode, which the section 'restore' of its profile sets: not restored",
}
_ENDED = "becomes {}: the mode that the section 'restore' of its profile sets is ended"
_NO_MODE = ModeBits(0, 0)
#: names that may all be misspelt
_FEW = 3


@dataclass(frozen=True, slots=True)
class SettingChange:
    """
    A setting that is not as in the file, or a mode that the drive was left in.

    :param wanted: value in the file, of which only the setting counts; None: it has none.
    :param word: what is to be written, as unsigned word.
    :param found: value that the drive has.
    :param left_alone: why it will not be written; None: it will.
    :param not_all: its bits of a mode will not be as in the file.
    """

    name: str
    parameter: Parameter
    wanted: Value | None
    word: int
    found: Value
    left_alone: LeftAlone | None = None
    not_all: bool = False

    @property
    def note(self) -> str:
        """The remark on it; '' where it will be as in the file."""
        if self.left_alone is not None:
            return self.left_alone.text
        return _ENDED.format(value_text(self.value)) if self.not_all else ''

    @property
    def value(self) -> Value:
        """The value to be written, as the client writes it."""
        return value_of_word(self.parameter, self.word)


@dataclass(frozen=True, slots=True)
class NotAsInFile:
    """
    A setting that is not as in the file in the end.

    :param found: what the drive has; None: it could not be read.
    :param reason: the failure of its last write, or of reading it; '' without one.
    """

    name: str
    wanted: Value
    found: Value | None
    reason: str = ''


@dataclass(frozen=True, slots=True)
class RestorePlan:
    """
    What restoring a file would do.

    :param changes: in the order in which they are written.
    :param kept: settings that are not as in the file, and stay so.
    :param same: names of settings that are as in the file.
    :param words: what the drive is to have afterwards, as raw words, by name.
    :param wanted: the same as values.
    :param found: what the drive has of all that was read.
    :param unread: settings that could not be read.
    :param absent: settings that it reports it does not have.
    """

    changes: tuple[SettingChange, ...]
    kept: tuple[SettingChange, ...]
    same: tuple[str, ...]
    words: Mapping[str, int]
    wanted: Mapping[str, Value]
    found: Mapping[str, int]
    unread: tuple[ReadOutcome, ...]
    absent: tuple[NotAsInFile, ...] = ()


def problems_in(backup: Backup, drive: Drive) -> list[str]:
    """Check a file against a drive's table; return a line for each problem."""
    found = []
    for name, value in backup.values.items():
        parameter = drive.find(name)
        if parameter is not None and parameter.writable and why_left_alone(
                drive, name, include_protected=True) is not None:
            reason = ''     # whatever it is, it is not written
            try:
                raw_in_file(parameter, value)
            except ValueRefused as error:
                reason = str(error)
        else:
            reason = drive.check(name, value)
        if reason:
            found.append(backup.problem(name, reason))
    return found


def other_type(backup: Backup, drive: Drive) -> str:
    """
    Return of which other drive type a file is, and so useless here; '': of this one.

    Without a head it is one of which the drive has no name at all.
    """
    head, facts = backup.head, drive.facts
    here = f'{drive.name} has {facts.profile} ({facts.protocol})'
    if says_nothing(head):
        unknown = len(backup.values) > _FEW and not any(map(drive.find, backup.values))
        return f'{here}, which has none of its {len(backup.values)} names' if unknown else ''
    if head.profile_sha256 == facts.profile_sha256 or (head.profile, head.protocol) == (
            facts.profile, facts.protocol):
        return ''
    return (f'it is a backup with profile {printable(head.profile) or "?"} '
            f'({printable(head.protocol) or "?"}), {here}')


def strangers(backup: Backup, drive: Drive, identity: str) -> list[str]:
    """Return in which ways a file is of another drive: a line each; empty where it is not."""
    head, facts = backup.head, drive.facts
    found = []
    if head.profile_sha256 and head.profile_sha256 != facts.profile_sha256:
        found.append(
            f'it is a backup with profile {printable(head.profile) or "?"} '
            f'({head.profile_sha256[:12]}…), the drive has {facts.profile} '
            f'({facts.profile_sha256[:12]}…)')
    if head.identity and head.identity != identity:
        found.append(f'it is a backup of {_difference(head.identity, identity)}')
    return found


def says_nothing(head: Head) -> bool:
    """Return whether a head leaves open what the file is a backup of."""
    return not head.profile_sha256


def plan_restore(backup: Backup, drive: Drive, outcomes: Mapping[str, ReadOutcome], *,
                 include_protected: bool) -> RestorePlan:
    """
    Compare a valid file with what was read of the drive; return the plan.

    :param outcomes: of :func:`names_to_read`.
    """
    bits = mode_bits(drive.facts.restore)
    changes: list[SettingChange] = []
    kept: list[SettingChange] = []
    same, unread, absent = [], [], []
    words: dict[str, int] = {}
    there: dict[str, int] = {}
    wanted: dict[str, Value] = {}
    settings = names_to_restore(backup, drive)
    for name in names_to_read(backup, drive):
        parameter, outcome = drive.find(name), outcomes[name]
        if parameter is None or outcome.raw is None or outcome.value is None:
            if outcome.absent and name in settings:
                absent.append(NotAsInFile(
                    name, backup.values[name], None,    # type: ignore[arg-type]
                    outcome.reason))
            else:
                unread.append(outcome)
            continue
        found = in_file = there[name] = parameter.word_from_raw(outcome.raw)
        value, left_alone = None, None
        if name in settings:
            value = backup.values[name]
            in_file = parameter.word_from_raw(raw_in_file(parameter, value))
            left_alone = why_left_alone(drive, name, include_protected=include_protected)
        word = bits.get(name, _NO_MODE).to_write(found, in_file if left_alone is None else found)
        change = SettingChange(name, parameter, value, word,   # type: ignore[arg-type]
                               outcome.value, left_alone, not_all=in_file != word)
        if left_alone is None and (name in settings or word != found):
            words[name], wanted[name] = word, change.value
        if word != found:
            changes.append(replace(change, left_alone=None))
        elif in_file != found:
            kept.append(replace(change, left_alone=left_alone or LeftAlone.MODE))
        elif name in settings:
            same.append(name)
    return RestorePlan(tuple(changes), tuple(kept), tuple(same), words, wanted,
                       there, tuple(unread), tuple(absent))


def names_to_restore(backup: Backup, drive: Drive) -> tuple[str, ...]:
    """Return the settings of a file, in the order in which they are written."""
    return in_order(drive, [name for name in backup.values if is_setting(drive, name)])


def names_to_read(backup: Backup, drive: Drive) -> tuple[str, ...]:
    """Return what to read before: these settings, and those that show the mode of the drive."""
    return in_order(drive, list(dict.fromkeys([
        *names_to_restore(backup, drive), *modes_of(drive)])))


def why_left_alone(drive: Drive, name: str, *, include_protected: bool) -> LeftAlone | None:
    """Return why a parameter of a file is not written; None: it is."""
    role = drive.role(name)
    if role is Role.CONTROL:
        return LeftAlone.CONTROL
    if role is Role.CYCLIC:
        return LeftAlone.CYCLIC
    if role is Role.MAP and drive.facts.through:
        return LeftAlone.MAP
    parameter = drive.find(name)
    if parameter is not None and is_command(drive.facts.protocol, parameter):
        return LeftAlone.COMMAND
    if parameter is not None and not is_setting(drive, name):
        return LeftAlone.MODE
    if parameter is not None and parameter.protected and not include_protected:
        return LeftAlone.PROTECTED
    return None


def value_of_word(parameter: Parameter, word: int) -> Value:
    """Return a word as the client writes it: raw names have raw integers."""
    return parameter.value_from_raw(parameter.raw_from_word(word)) if parameter.listed else word


def _difference(wanted: str, found: str) -> str:
    """Return the parts of an identity that differ: those of the file, and those of the drive."""
    there, here = wanted.split(), found.split()
    only_there = [part for part in there if part not in here]
    only_here = [part for part in here if part not in there]
    return (f'{printable(" ".join(only_there)) or "a drive with less identity"}, the drive is '
            f'{" ".join(only_here) or "known by less"}')


class StepKind(Enum):
    """The purposes of a profile's steps."""

    BEFORE = 'before'
    AFTER = 'after'
    STORE = 'store'


@dataclass(frozen=True, slots=True)
class FailedStep:
    """A step of the profile that failed, and why."""

    parameter: str
    kind: StepKind
    failure: Failure

    @property
    def text(self) -> str:
        """The failure in words, with its consequence."""
        if self.kind is StepKind.STORE and self.unknown:
            follows = 'Whether what was written is stored is not known'
        else:
            follows = _FOLLOWS[self.kind]
        return f'{self.parameter}: {self.failure.reason}. {follows}'

    @property
    def unknown(self) -> bool:
        """Whether the drive may have done it all the same."""
        return self.failure.kind.unheard


_NOT_ATTEMPTED = {
    StepKind.AFTER: Failure(FailureKind.INVALID, sentences.not_set_back()),
    StepKind.STORE: Failure(FailureKind.INVALID, sentences.not_written())}
_FOLLOWS = {
    StepKind.BEFORE: 'No setting was written',
    StepKind.AFTER: 'Look at it by hand: the drive may still be in the mode in which settings '
                    'are written',
    StepKind.STORE: 'What was written is not stored',
}


@dataclass(slots=True)
class RestoreResult:
    """
    The result of a restore.

    :param written: names of the settings that were written, in that order.
    :param unconfirmed: that under way when the conversation ended, which may have been written.
    :param steps: steps of the profile that failed.
    :param stored: the drive was commanded to store all, and confirmed it.
    :param wrong: what is not as in the file. Empty after an interruption: nothing was compared.
    :param enabled: the drive was enabled meanwhile.
    :param stopped: it was interrupted, or the drive enabled; these were not written.
    :param trouble: what ended the conversation with the drive.
    """

    written: list[str] = field(default_factory=list)
    unconfirmed: list[str] = field(default_factory=list)
    steps: list[FailedStep] = field(default_factory=list)
    stored: bool = False
    wrong: list[NotAsInFile] = field(default_factory=list)
    enabled: bool = False
    stopped: list[str] | None = None
    trouble: DriveCanError | None = None

    @property
    def complete(self) -> bool:
        """Whether everything is as in the file."""
        return not (self.steps or self.wrong or self.enabled or self.stopped or self.trouble)


class Restorer:
    """
    Restores one drive.

    :param stopped: returns whether the user wants it to end.
    :param clock: s.
    :param wait: waits for so many seconds.
    :param told: called with each outcome of a write.
    :param hint: called with what the user should know meanwhile. Where neither can print it (the
        terminal is gone), the drive is not left in its mode because of that.
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
        self._lost = False          # of what could be read before, nothing can be now
        self._unanswered = False    # of a step: its outcome is unknown
        self._attempted = False
        self._wrote = False
        self._words = dict(plan.found)
        self._unseen: dict[str, list[Failure | None]] = {}    # steps that cannot be read
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
            for step in self._before:
                if self._may_not_write():
                    break
                self._note(StepKind.BEFORE, step, self._take(step))
            if not result.steps:
                self._rounds()
        except DriveCanError as error:
            result.trouble = error
        self._finish()
        try:
            if self._stopped or result.enabled:
                result.stopped = [change.name for change in self._plan.changes
                                  if change.name not in (*result.written, *result.unconfirmed)]
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

    def _may_not_write(self) -> bool:
        """Return whether no more settings are to be written."""
        self._result.enabled = self._result.enabled or (
            not self._stopped and self._drive.enabled() is Enabled.YES)
        return self._stopped or self._result.enabled

    @property
    def _complete(self) -> bool:
        """Whether all settings have been attempted, without an interruption."""
        return self._attempted and not (self._stopped or self._result.enabled)

    def _rounds(self) -> None:
        pending: Sequence[SettingChange] = self._pending
        while pending:
            self._write_all(pending)
            if self._lost or self._stopped or self._result.enabled:
                return
            left = self._differing(pending)
            if len(left) == len(pending):
                break
            pending = left
            # what was acknowledged and not stored is not written, until it is at the next attempt
            for change in pending:
                if change.name in self._result.written:
                    self._result.written.remove(change.name)
        self._attempted = True

    def _write_all(self, changes: Sequence[SettingChange]) -> None:
        for change in changes:
            if self._may_not_write():
                return
            outcome = self._write(change.name, change.value)
            # what could be read before, and cannot now: no refusal, the drive is gone
            if not (outcome.ok or self._drive.read(change.name)[change.name].ok):
                self._lost = True
                return

    def _write(self, name: str, value: Value) -> WriteOutcome:
        heard: list[WriteOutcome] = []
        self._wrote = True
        try:
            outcome = self._drive.write({name: value}, told=heard.append)[name]
        except KeyboardInterrupt:
            self._interrupted = True
            # the write under way is known before this is raised
            outcome = heard[0] if heard else WriteOutcome(
                name, False, reason=sentences.interrupted())
        except DriveCanError:
            if heard and name not in self._result.written:
                self._result.unconfirmed.append(name)
            raise
        if outcome.ok:
            self._reasons.pop(name, None)
            self._note_written(name)
        else:
            self._reasons[name] = outcome.reason
        with suppress(OSError):
            self._told(outcome)
        return outcome

    def _note_written(self, name: str) -> None:
        if name not in self._result.written:
            self._result.written.append(name)

    def _differing(self, changes: Sequence[SettingChange]) -> list[SettingChange]:
        outcomes = self._drive.read(*(change.name for change in changes))
        return [change for change in changes
                if not _is(outcomes[change.name], self._plan.words[change.name])]

    # -- the steps of the profile -----------------------------------------------------------------

    def _finish(self) -> None:
        """Run the steps afterwards; a drive that is gone may come back."""
        if not self._after or self._result.enabled and not self._wrote:
            return
        failed = self._result.steps
        already, attempt, there = len(failed), 0, 0
        end: float | None = None
        while True:
            attempt += 1
            last = end is not None and self._clock() >= end
            self._lost = self._unanswered = False
            try:
                for step in self._after:
                    self._note(self._kind(step), step, self._take_back(
                        step, blind=last or attempt <= _ATTEMPTS, last=last))
            except DriveCanError as error:
                self._result.trouble = self._result.trouble or error
                failed[already:] = [
                    FailedStep(step.parameter, kind, _NOT_ATTEMPTED[kind])
                    for step in self._after for kind in (self._kind(step),)]
                return
            there += not self._lost
            if not self._unanswered or there == _ATTEMPTS or last:
                return
            if self._lost and end is None:
                end = self._clock() + PATIENCE
                with suppress(OSError):
                    self._hint(command_sentences.waiting_for_drive(
                        drive=self._drive.name, patience=PATIENCE, aim=self._aim))
            del failed[already:]
            self._wait(_PATIENCE_STEP)

    @property
    def _aim(self) -> str:
        """What the steps afterwards are for."""
        names = dict.fromkeys(step.parameter for step in self._after
                              if self._kind(step) is not StepKind.STORE)
        return f'{", ".join(names)} is set back' if names else 'it stores what was written'

    def _kind(self, step: RestoreStep) -> StepKind:
        """Return what a step afterwards is for."""
        parameter = self._drive.find(step.parameter)
        return (StepKind.STORE if parameter is not None and parameter.stores
                else StepKind.AFTER)

    def _note(self, kind: StepKind, step: RestoreStep, failure: Failure | None) -> None:
        if failure is not None:
            self._result.steps.append(FailedStep(step.parameter, kind, failure))
        if kind is StepKind.STORE:
            self._result.stored = failure is None

    def _take(self, step: RestoreStep) -> Failure | None:
        """Run a step before the settings; return why it failed."""
        parameter = self._drive.find(step.parameter)
        if parameter is None:
            return _NO_PARAMETER
        if parameter.readable:
            failure = self._look(step.parameter, parameter)
            if failure is not None:
                return failure
        elif not is_whole(step, parameter):
            return _NO_BITS
        found = self._words.get(step.parameter)
        word = (found or 0) & ~step.mask | step.bits
        return None if word == found else self._put(parameter, word, blind=False)

    def _take_back(self, step: RestoreStep, *, blind: bool, last: bool) -> Failure | None:
        """
        Run a step after the settings; return why it failed.

        :param blind: nothing is read first, unless the bits to be kept are unknown.
        :param last: there is no other attempt.
        """
        parameter = self._drive.find(step.parameter)
        if parameter is None:
            return _NO_PARAMETER
        # its other bits are a setting of the file, unless this is no more than leaving the mode
        kept = self._plan.words.get(step.parameter) if self._complete else None
        if kept is None:
            kept = self._words.get(step.parameter)
        found: int | None = None
        if parameter.readable and not (blind and (is_whole(step, parameter) or kept is not None)):
            failure = self._look(step.parameter, parameter)
            if failure is not None:
                self._unanswered = True
                return failure
            found = self._words[step.parameter]
            kept = found if kept is None else kept
        elif kept is None and not is_whole(step, parameter):
            return _NO_BITS
        word = (kept or 0) & ~step.mask | step.bits
        if not parameter.readable:
            failure = self._put_unseen(parameter, word, last=last)
        else:
            failure = None if word == found else self._put(parameter, word, blind=True)
        if failure is None and any((parameter.name, word) == (change.name, change.word)
                                   for change in self._plan.changes):
            self._note_written(parameter.name)      # as it is to be, if nothing else was done
        return failure

    def _look(self, name: str, parameter: Parameter) -> Failure | None:
        """Read the parameter of a step; return why it could not be read."""
        outcome = self._drive.read(name)[name]
        if outcome.raw is None:
            self._lost = True
            return _failure(outcome)
        self._words[name] = parameter.word_from_raw(outcome.raw)
        return None

    def _put(self, parameter: Parameter, word: int, *, blind: bool) -> Failure | None:
        """Write the word of a step; return why the drive does not have it."""
        name = parameter.name
        written = self._write_step(name, value_of_word(parameter, word), blind=blind)
        if not written.ok:
            # it may have been done all the same, or the drive refuses what it has already
            if not parameter.readable:
                self._lost = written.unheard and not self._is_there()
            else:
                self._lost = self._look(name, parameter) is not None
            if self._lost or not parameter.readable or self._words[name] != word:
                self._unanswered = self._unanswered or written.unheard
                return _failure(written)
        self._words[name] = word
        return None

    def _put_unseen(self, parameter: Parameter, word: int, *, last: bool) -> Failure | None:
        """Write a step that cannot be read; again only where the drive is there, or at last."""
        tried = self._unseen.setdefault(parameter.name, [])
        if len(tried) == _ATTEMPTS:
            return tried[-1]
        if tried and not last and not self._is_there():
            self._unanswered = self._lost = True
            return tried[-1]
        tried.append(self._put(parameter, word, blind=True))
        return tried[-1]

    def _is_there(self) -> bool:
        """Return whether the drive answers, by a setting that it answered before."""
        name = next(iter(self._plan.found), None)
        return name is None or not self._drive.read(name)[name].unheard

    def _write_step(self, name: str, value: Value, *, blind: bool) -> WriteOutcome:
        heard: list[WriteOutcome] = []
        self._wrote = True
        while True:
            try:
                return self._drive.write({name: value}, blind=blind, told=heard.append)[name]
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
                            self._reasons.get(change.name, sentences.answers_no_more()))
                for change in self._plan.changes if change.name not in self._result.written]
            return
        self._result.wrong += self._plan.absent
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


def _failure(outcome: ReadOutcome | WriteOutcome) -> Failure:
    return Failure(outcome.kind or FailureKind.INVALID, sentences.uncoded(outcome.reason))


def _is(outcome: ReadOutcome, word: int) -> bool:
    parameter = outcome.parameter
    return (outcome.raw is not None and parameter is not None
            and parameter.word_from_raw(outcome.raw) == word)
