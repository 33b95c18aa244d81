# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What restoring a backup would change: found before anything is written.

First the file alone (:func:`problems_in`), then the file against what the drive has now
(:func:`plan_restore`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

from drive_can_bridge.backup.document import (
    Backup, Head, in_order, is_setting, mode_bits, ModeBits, modes_of, raw_in_file,
)
from drive_can_bridge.client.drive import Drive, ReadOutcome
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Parameter, Value
from drive_can_bridge.core.roles import Role
from drive_can_bridge.core.text import printable
from drive_can_bridge.core.words import value_text


class LeftAlone(Enum):
    """Why a setting of a file is not written."""

    PROTECTED = 'protected'
    MAP = 'map'
    CYCLIC = 'cyclic'
    CONTROL = 'control'
    MODE = 'mode'

    @property
    def text(self) -> str:
        """In words, with what helps."""
        return _LEFT_ALONE[self]


_LEFT_ALONE = {
    LeftAlone.PROTECTED: 'protected by its profile: --include-protected restores it',
    LeftAlone.MAP: 'a map: restored with --params-file only',
    LeftAlone.CYCLIC: 'a setpoint: sent cyclically',
    LeftAlone.CONTROL: 'the control word',
    LeftAlone.MODE: "a mode, which the section 'restore' of its profile sets: not restored",
}
_ENDED = "becomes {}: the mode that the section 'restore' of its profile sets is ended"
_NO_MODE = ModeBits(0, 0)
#: names that may all be misspelt
_FEW = 3


@dataclass(frozen=True, slots=True)
class Change:
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
        """What is to be said of it; '' where it will be as in the file."""
        if self.left_alone is not None:
            return self.left_alone.text
        return _ENDED.format(value_text(self.value)) if self.not_all else ''

    @property
    def value(self) -> Value:
        """What is to be written, as the client takes it."""
        return value_of_word(self.parameter, self.word)


@dataclass(frozen=True, slots=True)
class RestorePlan:
    """
    What restoring a file would do.

    :param changes: in the order in which they are written.
    :param kept: settings that are not as in the file, and stay so.
    :param same: names of settings that are as in the file.
    :param words: all that is to be as in the file afterwards, by name.
    :param wanted: the same as values.
    :param found: what the drive has of all that was read.
    :param unread: what the drive did not give.
    """

    changes: tuple[Change, ...]
    kept: tuple[Change, ...]
    same: tuple[str, ...]
    words: Mapping[str, int]
    wanted: Mapping[str, Value]
    found: Mapping[str, int]
    unread: tuple[ReadOutcome, ...]


def problems_in(backup: Backup, drive: Drive) -> list[str]:
    """Check a file against what is known of a drive; return a line for each problem."""
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
    Say of which other drive type a file is, most of which can only be wrong then; '': of this one.

    Without a head it is one of which the drive knows no name at all.
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
    """Say in which way a file is of another drive: a line each; nothing where it is not."""
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
    """Tell whether a head leaves open what the file is a backup of."""
    return not head.profile_sha256


def plan_restore(backup: Backup, drive: Drive, outcomes: Mapping[str, ReadOutcome], *,
                 include_protected: bool) -> RestorePlan:
    """
    Compare a file that is all right with what was read of the drive.

    :param outcomes: of :func:`names_to_read`.
    """
    bits = mode_bits(drive.facts.restore)
    changes: list[Change] = []
    kept: list[Change] = []
    same, unread = [], []
    words: dict[str, int] = {}
    there: dict[str, int] = {}
    wanted: dict[str, Value] = {}
    settings = names_to_restore(backup, drive)
    for name in names_to_read(backup, drive):
        parameter, outcome = drive.find(name), outcomes[name]
        if parameter is None or outcome.raw is None or outcome.value is None:
            unread.append(outcome)
            continue
        found = in_file = there[name] = parameter.word_from_raw(outcome.raw)
        value, left_alone = None, None
        if name in settings:
            value = backup.values[name]
            in_file = parameter.word_from_raw(raw_in_file(parameter, value))
            left_alone = why_left_alone(drive, name, include_protected=include_protected)
        word = bits.get(name, _NO_MODE).to_write(found, in_file if left_alone is None else found)
        change = Change(name, parameter, value, word,   # type: ignore[arg-type]
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
                       there, tuple(unread))


def names_to_restore(backup: Backup, drive: Drive) -> tuple[str, ...]:
    """Return the settings of a file, in the order in which they are written."""
    return in_order(drive, [name for name in backup.values if is_setting(drive, name)])


def names_to_read(backup: Backup, drive: Drive) -> tuple[str, ...]:
    """Return what to read before: these settings, and what tells the mode of the drive."""
    return in_order(drive, list(dict.fromkeys([
        *names_to_restore(backup, drive), *modes_of(drive)])))


def why_left_alone(drive: Drive, name: str, *, include_protected: bool) -> LeftAlone | None:
    """Say why a parameter of a file is not written; None: it is."""
    role = drive.role(name)
    if role is Role.CONTROL:
        return LeftAlone.CONTROL
    if role is Role.CYCLIC:
        return LeftAlone.CYCLIC
    if role is Role.MAP and drive.facts.through:
        return LeftAlone.MAP
    parameter = drive.find(name)
    if parameter is not None and not is_setting(drive, name):
        return LeftAlone.MODE
    if parameter is not None and parameter.protected and not include_protected:
        return LeftAlone.PROTECTED
    return None


def value_of_word(parameter: Parameter, word: int) -> Value:
    """Return a word as the client takes it: raw names take raw integers."""
    return parameter.value_from_raw(parameter.raw_from_word(word)) if parameter.listed else word


def _difference(wanted: str, found: str) -> str:
    """Name the parts of an identity that differ: those of the file, and those of the drive."""
    there, here = wanted.split(), found.split()
    only_there = [part for part in there if part not in here]
    only_here = [part for part in here if part not in there]
    return (f'{printable(" ".join(only_there)) or "a drive with less identity"}, the drive is '
            f'{" ".join(only_here) or "known by less"}')
