# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From the entries of a file to a profile that ``drive_can profile check`` accepts.

Every entry goes through the very checks that a bridge runs; what does not pass is left out, with
the sentence that a bridge would say.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from drive_can_bridge.configuration.problems import Tree
from drive_can_bridge.configuration.profile_check import LoadedProfile, profile_from_tree
from drive_can_bridge.configuration.scalars import read_scalar
from drive_can_bridge.configuration.yaml_nodes import SIZE_MAX
from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.profiles.draft import Draft, Found, LeftOut
from drive_can_bridge.profiles.errors import ImportFailed
from drive_can_bridge.profiles.family_check import family_complaints
from drive_can_bridge.profiles.names import name_of, unique
from drive_can_bridge.profiles.text import comment, entry_lines, one_line, scalar
from drive_can_bridge.protocols.families import FAMILIES

#: identity object of CiA 301: vendor, product, revision, serial number
_IDENTITY = 0x1018


@dataclass(frozen=True, slots=True)
class Built:
    """
    A profile.

    :param text: of its file.
    :param names: of its parameters, in the order of the file.
    :param entries: how many the file has, those that cannot be used included.
    :param remarks: how many entries have a comment that says what had to be decided.
    """

    text: str
    names: tuple[str, ...]
    protocols: tuple[str, ...]
    entries: int
    remarks: int


def build_profile(found: Found, source: str, *, description: str = '',
                  protocols: Sequence[str] = ()) -> Built:
    """
    Make a profile of what a file offers.

    :param found: its ``left_out`` gets what does not pass.
    :param source: name of the file.
    :param protocols: families that the drive speaks; none: all that can carry the table.
    :raises ImportFailed: nothing is left, or more than a bridge reads.
    """
    entries = len(found.drafts) + len(found.left_out)
    drafts = _narrowed(_without_doubles(sorted(found.drafts, key=_address), found), found)
    taken = frozenset[str]().union(*(FAMILIES[name].builtin_names for name in protocols))
    named = _named(drafts, taken)
    possible = tuple(protocols) or tuple(FAMILIES)

    def text(families: Sequence[str]) -> str:
        return _text(named, entries, source, description or found.description, families,
                     said=bool(protocols))
    # first, because the checks take long; what they leave out makes it no longer
    if len(text(possible).encode('utf-8')) > SIZE_MAX << 20:
        raise ImportFailed(f'the profile of its {len(named)} entries would be larger than '
                           f'{SIZE_MAX} MiB, which no bridge reads')
    named = _sound(named, found, possible)
    spoken = tuple(protocols) or _carriers(named)
    named = _carried(named, found, spoken)
    if not named:
        raise ImportFailed(_nothing(found))
    # names once more: of what was left out none is taken
    named = _named(list(named.values()), taken)
    return Built(text(spoken), tuple(named), spoken, entries,
                 sum(bool(draft.remarks) for draft in named.values()))


def _nothing(found: Found) -> str:
    """Say that nothing is left, with the first reason."""
    if not found.complaints:
        return 'no entry can be used: there is none'
    return f'no entry can be used; the first reason, in line {found.complaints[0]}'


# -- order and names ------------------------------------------------------------------------------


def _address(draft: Draft) -> tuple[int, int, int]:
    """Sort by number, else by index; entries with neither do not come out of files."""
    entry = draft.entry
    return (entry.get('number', entry.get('index', 0)), entry.get('subindex', -1),
            draft.place.line)


def _without_doubles(drafts: Sequence[Draft], found: Found) -> list[Draft]:
    seen: dict[tuple[Any, ...], Draft] = {}
    kept = []
    for draft in drafts:
        key = tuple(draft.entry.get(each) for each in ('number', 'index', 'subindex'))
        first = seen.setdefault(key, draft)
        if first is draft:
            kept.append(draft)
        else:
            found.left_out.append(LeftOut(draft.place, draft.title,
                                          f'the same address as in line {first.place.line}'))
    return kept


def _named(drafts: Sequence[Draft], taken: frozenset[str]) -> dict[str, Draft]:
    wanted = []
    for draft in drafts:
        entry = draft.entry
        parts = [str(entry['number'])] if 'number' in entry else [f'{entry["index"]:04x}']
        if entry.get('subindex'):
            parts.append(str(entry['subindex']))
        address = '_'.join(parts)
        wanted.append((name_of(draft.title, address, taken), address))
    return dict(zip(unique(wanted), drafts, strict=True))


# -- what passes ----------------------------------------------------------------------------------


def _narrowed(drafts: Sequence[Draft], found: Found) -> list[Draft]:
    """Leave out limits that the type sets anyway, and entries that could have no value at all."""
    kept = []
    for draft in drafts:
        entry = draft.entry
        kind = ParameterType(entry['type'])
        low, high = sorted(raw * entry.get('scale', 1.0) + entry.get('offset', 0.0)
                           for raw in kind.raw_range)
        if entry.get('minimum', low) > high or entry.get('maximum', high) < low:
            found.left_out.append(LeftOut(
                draft.place, draft.title, f'no value of {kind.value} lies in the limits; it holds '
                                          f'{low:.12g} to {high:.12g}'))
            continue
        slack = abs(entry.get('scale', 1.0)) * 0.5
        for key, beyond in (('minimum', entry.get('minimum', low) < low - slack),
                            ('maximum', entry.get('maximum', high) > high + slack)):
            if beyond:
                draft.remarks.append(f'{key} {entry.pop(key):.12g} left out: {kind.value} ends at '
                                     f'{low if key == "minimum" else high:.12g}')
        kept.append(draft)
    return kept


def _sound(named: dict[str, Draft], found: Found, protocols: Sequence[str]) -> dict[str, Draft]:
    """Leave out what the checks of a profile complain about."""
    reasons = {name: f'{key} {value} cannot be written: too close to 0'
               for name, draft in named.items() for key, value in draft.entry.items()
               if isinstance(value, float) and read_scalar(scalar(value)) != value}
    for problem in _loaded(named, protocols).problems:
        _note(reasons, problem.key, problem.message)
    return _without(named, found, reasons)


def _note(reasons: dict[str, str], key: str, message: str) -> None:
    """Keep the first thing that is wrong with each entry."""
    _, name, *rest = (*key.split('.'), '')
    reasons.setdefault(name, ' '.join(filter(None, ('.'.join(filter(None, rest)), message))))


def _loaded(named: dict[str, Draft], protocols: Sequence[str]) -> LoadedProfile:
    tree = Tree({'protocols': list(protocols),
                 'parameters': {name: draft.entry for name, draft in named.items()}})
    return profile_from_tree(tree)


def _carriers(named: dict[str, Draft]) -> tuple[str, ...]:
    """Return the families that can carry all entries; else the one that can carry most."""
    profile = _loaded(named, tuple(FAMILIES)).profile
    missed = {protocol: len({complaint.key.split('.')[1] for complaint in family_complaints(
        replace(profile, protocols=(protocol,)), protocol)}) for protocol in FAMILIES}
    # registers have no elements: all of an array would be one and the same
    missed['canopen_pkw'] += sum('subindex' in draft.entry and 'index' not in draft.entry
                                 for draft in named.values())
    fewest = min(missed.values())
    carriers = tuple(protocol for protocol, count in missed.items() if count == fewest)
    return carriers if fewest == 0 else carriers[:1]


def _carried(named: dict[str, Draft], found: Found,
             protocols: Sequence[str]) -> dict[str, Draft]:
    """Leave out what one of the families cannot carry."""
    profile = _loaded(named, protocols).profile
    reasons: dict[str, str] = {}
    for protocol in protocols:
        for complaint in family_complaints(profile, protocol):
            _note(reasons, complaint.key, complaint.message)
    return _without(named, found, reasons)


def _without(named: dict[str, Draft], found: Found, reasons: dict[str, str]) -> dict[str, Draft]:
    for name, reason in reasons.items():
        found.left_out.append(LeftOut(named[name].place, named[name].title, reason))
    return {name: draft for name, draft in named.items() if name not in reasons}


# -- the text -------------------------------------------------------------------------------------


def _text(named: dict[str, Draft], entries: int, source: str, description: str,
          protocols: Sequence[str], *, said: bool) -> str:
    lines = comment(f'Made from {source} by "drive_can profile import": {len(named)} of '
                    f'{entries} entries, sorted by address. Compare what you use with the '
                    'manual: the file may be wrong, and so may what was made of it.')
    if all('number' not in draft.entry for draft in named.values()):
        lines += comment('The entries are CANopen objects: a drive that uses them needs '
                         '"addressing: canopen".')
    lines += ['', f'description: {scalar(one_line(description) or f"Parameters from {source}")}']
    if not said and len(protocols) > 1:
        lines += comment('Nobody said which protocols the drive speaks; these can carry the '
                         'table. Delete the others.')
    lines += [f'protocols: [{", ".join(protocols)}]', '', 'sources:',
              f'  file: {scalar(source)}', '']
    identity = [name for name, draft in named.items() if draft.entry.get('index') == _IDENTITY]
    if identity:
        lines += comment('Object 1018h tells one device from another.')
        lines += [f'identity: [{", ".join(identity)}]', '']
    lines += ['parameters:', '']
    for name, draft in named.items():
        section = f', {draft.place.section}' if draft.place.section else ''
        trust = {'source': f'file, line {draft.place.line}{section}'}
        lines += entry_lines(name, {**draft.entry, **trust}, draft.remarks)
    return '\n'.join(lines) + '\n'
