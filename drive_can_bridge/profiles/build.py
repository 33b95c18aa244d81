# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From the entries of a file to a profile that ``drive_can profile check`` accepts.

Every entry goes through the very checks that a bridge runs; what does not pass is left out, with
the sentence that a bridge would say.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from drive_can_bridge.configuration.problems import Tree
from drive_can_bridge.configuration.profile_check import LoadedProfile, profile_from_tree
from drive_can_bridge.configuration.yaml_nodes import SIZE_MAX
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.profiles.catalogue import family_complaints
from drive_can_bridge.profiles.names import (
    block, comment, entry_lines, name_of, one_line, scalar, unique,
)
from drive_can_bridge.protocols.families import FAMILIES

#: identity object of CiA 301: vendor, product, revision, serial number
_IDENTITY = 0x1018


class ImportFailed(DriveCanError):
    """The file as a whole cannot be imported; the text continues its name."""


@dataclass(slots=True)
class Draft:
    """
    One entry of a file, before it is checked.

    :param line: where it stands, counted from 1.
    :param section: of an EDS file, in brackets; '' in a table.
    :param title: what its name is made from.
    :param entry: keys and values as the schema of profiles knows them.
    :param remarks: what was not said and had to be decided, or could not be taken over.
    :param name: of a standard object; '': made from the title.
    """

    line: int
    section: str
    title: str
    entry: dict[str, Any]
    remarks: list[str] = field(default_factory=list)
    name: str = ''


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Something in the file that is not in the profile, and why."""

    line: int
    section: str
    what: str
    reason: str

    def __str__(self) -> str:
        """Write what follows the name of the file: ``345: [2004sub6]: Speed: reason``."""
        return ': '.join(filter(None, (str(self.line), self.section, self.what, self.reason)))


@dataclass(slots=True)
class Found:
    """
    Everything that a file offers.

    :param description: of the drive type, where the file has one.
    :param protocols: that the drive speaks; none: the file does not say.
    :param left_out: entries that are not in the profile.
    :param notes: about the file: what its columns were taken for, and what is odd.
    :param sections: of the profile, beside its parameters; they name standard objects.
    """

    description: str = ''
    protocols: tuple[str, ...] = ()
    drafts: list[Draft] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    sections: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Built:
    """
    A profile.

    :param text: of its file.
    :param names: of its parameters, in the order of the file.
    :param entries: how many the file has, those that cannot be used included.
    :param remarks: how many entries have a comment that says what had to be decided.
    :param left_out: in the order of the file.
    """

    text: str
    names: tuple[str, ...]
    protocols: tuple[str, ...]
    entries: int
    remarks: int
    left_out: tuple[LeftOut, ...]
    notes: tuple[str, ...]


def build_profile(found: Found, source: str, *, description: str = '',
                  protocols: Sequence[str] = ()) -> Built:
    """
    Make a profile of what a file offers.

    :param source: name of the file.
    :param protocols: families that the drive speaks; none: all that can carry the table.
    :raises ImportFailed: nothing is left, or more than a bridge reads.
    """
    lost = list(found.left_out)
    said = tuple(protocols) or found.protocols
    taken = frozenset[str]().union(*(FAMILIES[name].builtin_names for name in said))

    def left(named: dict[str, Draft], reasons: dict[str, str]) -> dict[str, Draft]:
        lost.extend(LeftOut(named[name].line, named[name].section, named[name].title, reason)
                    for name, reason in reasons.items())
        return {name: draft for name, draft in named.items() if name not in reasons}
    named = _named(sorted(found.drafts, key=_address), taken)
    named = left(named, _doubles(named))
    text = _text(named, found, source, description, said)
    if len(text.encode('utf-8')) > SIZE_MAX << 20:      # before the checks, which take long
        raise ImportFailed(f'the profile of its {len(named)} entries would be larger than '
                           f'{SIZE_MAX} MiB, which no bridge reads')
    named = left(named, _first_reasons(_loaded(named, said or tuple(FAMILIES)).problems))
    _narrow(named, _loaded(named, said or tuple(FAMILIES)))
    spoken, reasons = _carriers(named, said)
    named = left(named, reasons)
    lost.sort(key=lambda each: each.line)
    if not named:
        raise ImportFailed('no entry can be used' + (
            f'; the first reason, in line {lost[0]}' if lost else ': there is none'))
    # names once more: of what was left out none is taken
    named = _named(list(named.values()), taken)
    return Built(_text(named, found, source, description, spoken, guessed=not said), tuple(named),
                 spoken, len(found.drafts) + len(found.left_out),
                 sum(bool(draft.remarks) for draft in named.values()), tuple(lost),
                 tuple(found.notes))


def _address(draft: Draft) -> tuple[int, int, int]:
    """Sort by number, else by index; entries with neither do not come out of files."""
    entry = draft.entry
    return (entry.get('number', entry.get('index', 0)), entry.get('subindex', -1), draft.line)


def _named(drafts: Sequence[Draft], taken: frozenset[str]) -> dict[str, Draft]:
    standard = {draft.name: draft for draft in drafts if draft.name}
    wanted = [(name, '') for name in standard]
    others = [draft for draft in drafts if standard.get(draft.name) is not draft]
    for draft in others:
        entry = draft.entry
        number = str(entry['number']) if 'number' in entry else f'{entry["index"]:04x}'
        address = f'{number}_{entry["subindex"]}' if entry.get('subindex') else number
        wanted.append((name_of(draft.title, address, taken), address))
    made = dict(zip(unique(wanted), [*standard.values(), *others], strict=True))
    return dict(sorted(made.items(), key=lambda item: _address(item[1])))


# -- what passes ----------------------------------------------------------------------------------


def _doubles(named: dict[str, Draft]) -> dict[str, str]:
    """Return why entries are left out whose address another one has."""
    lines: dict[tuple[Any, ...], int] = {}
    reasons = {}
    for name, draft in named.items():
        key = tuple(draft.entry.get(each) for each in ('number', 'index', 'subindex'))
        if key in lines:
            reasons[name] = f'the same address as in line {lines[key]}'
        lines.setdefault(key, draft.line)
    return reasons


def _first_reasons(problems: Iterable[Any]) -> dict[str, str]:
    """Return the first thing that is wrong with each entry."""
    reasons: dict[str, str] = {}
    for problem in problems:
        name, *rest = problem.key.removeprefix('parameters.').split('.')
        reasons.setdefault(name, ' '.join(filter(None, ('.'.join(rest), problem.message))))
    return reasons


def _loaded(named: dict[str, Draft], protocols: Sequence[str]) -> LoadedProfile:
    return profile_from_tree(Tree({
        'protocols': list(protocols),
        'parameters': {name: draft.entry.copy() for name, draft in named.items()}}))


def _narrow(named: dict[str, Draft], loaded: LoadedProfile) -> None:
    """Leave out limits beyond what the type holds: the type is the narrower one."""
    for warning in loaded.warnings:
        _, name, key = warning.key.split('.')
        del named[name].entry[key]
        named[name].remarks.append(f'{key} left out: {warning.message}')


def _carriers(named: dict[str, Draft], said: tuple[str, ...],
              ) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the families that are to carry the table, and why which entries they cannot."""
    profile = _loaded(named, said or tuple(FAMILIES)).profile
    reasons = {protocol: _first_reasons(family_complaints(profile, protocol))
               for protocol in said or FAMILIES}
    missed = {protocol: len(each) for protocol, each in reasons.items()}
    if not said:    # those that can carry everything; else the one that can carry most
        # registers have no elements: all of an array would be one and the same
        missed['canopen_pkw'] += sum('subindex' in draft.entry and 'index' not in draft.entry
                                     for draft in named.values())
        fewest = min(missed.values())
        said = tuple(protocol for protocol, count in missed.items() if count == fewest)
        said = said[:1] if fewest else said
    return said, {name: reason for protocol in reversed(said)
                  for name, reason in reasons[protocol].items()}


# -- the text -------------------------------------------------------------------------------------


def _text(named: dict[str, Draft], found: Found, source: str, description: str,
          protocols: Sequence[str], *, guessed: bool = False) -> str:
    lines = comment(f'Made from {source} by "drive_can profile import": {len(named)} of '
                    f'{len(found.drafts) + len(found.left_out)} entries, sorted by address. '
                    'Compare what you use with the manual: the file may be wrong, and so may '
                    'what was made of it.')
    if 'canopen_pkw' in protocols and all('number' not in draft.entry for draft in named.values()):
        lines += comment('The entries are CANopen objects: a drive of canopen_pkw that uses them '
                         'needs "addressing: canopen".')
    words = one_line(description or found.description) or f'Parameters from {source}'
    lines += ['', f'description: {scalar(words)}']
    if guessed and len(protocols) > 1:
        lines += comment('Nobody said which protocols the drive speaks; these can carry the '
                         'table. Delete the others.')
    lines += [f'protocols: [{", ".join(protocols)}]', '', 'sources:',
              f'  file: {scalar(source)}', '']
    identity = [name for name, draft in named.items() if draft.entry.get('index') == _IDENTITY]
    if identity:
        lines += [*comment('Object 1018h tells one device from another.'),
                  f'identity: [{", ".join(identity)}]', '']
    lines += [each for key, value in found.sections.items() for each in block(key, value)]
    lines += ['parameters:', '']
    for name, draft in named.items():
        where = ', '.join(filter(None, (f'file, line {draft.line}', draft.section)))
        lines += entry_lines(name, {**draft.entry, 'source': where}, draft.remarks)
    return '\n'.join(lines) + '\n'
