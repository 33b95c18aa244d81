# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which profiles exist, what is in one, and whether it is valid; how one is made from a file.

Every entry of a file that is imported goes through the very checks that a bridge runs; what does
not pass is left out, with the sentence of the bridge.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Any, get_args, get_type_hints

from drive_can_bridge.configuration.problems import Problem, Tree
from drive_can_bridge.configuration.profile_check import LoadedProfile, profile_from_tree
from drive_can_bridge.configuration.profiles import ProfileStore, read_profile, SUFFIX
from drive_can_bridge.configuration.yaml_nodes import SIZE_MAX
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.core.text import counted
from drive_can_bridge.profiles.names import name_of, unique
from drive_can_bridge.profiles.yaml_text import block, comment, entry_lines, one_line, scalar
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.family import Complaint, Family, ModeKey
from drive_can_bridge.resources import profiles_directory

#: how an entry's key ``verified`` is shown
VERIFIED_WORDS: dict[bool | None, str] = {True: 'yes', False: 'no', None: ''}
_OURS = 'profile.'
#: of a parameter, in the order in which it is described
_DESCRIBED = (
    'address', 'number', 'index', 'subindex', 'type', 'scale', 'offset', 'unit', 'access',
    'storage', 'minimum', 'maximum', 'neutral', 'neutral_from', 'limit', 'arming_tolerance',
    'bits', 'values', 'word_order', 'protected', 'description', 'source', 'verified', 'open')


@dataclass(frozen=True, slots=True)
class Checked:
    """
    A profile with everything that a bridge would report about it.

    :param problems: in the order of the file.
    """

    path: Path
    loaded: LoadedProfile
    problems: tuple[Problem, ...]
    warnings: tuple[Problem, ...]

    @property
    def entries(self) -> dict[str, dict[str, Any]]:
        """The valid entries, as the file has them."""
        parameters = self.loaded.tree.data.get('parameters', {})
        return {name: parameters[name] for name in self.loaded.profile.parameters}

    def count(self, verified: bool | None) -> int:
        """Return how many entries are marked as verified, as not, or (None) as neither."""
        return sum(each.verified is verified for each in self.loaded.profile.parameters.values())


def available(directories: Sequence[Path]) -> dict[str, Path]:
    """
    Return all profiles by name.

    :param directories: searched before the shipped ones; the first of a name counts, as for a
        bridge.
    :raises DriveCanError: one of the directories is not there.
    """
    found: dict[str, Path] = {}
    for directory in directories:
        if not directory.is_dir():
            raise DriveCanError(command_sentences.no_directory(directory=directory))
    for directory in (*directories, profiles_directory()):
        for path in sorted(directory.glob(f'*{SUFFIX}')):
            found.setdefault(path.stem, path)
    return dict(sorted(found.items()))


def find(name: str, directories: Sequence[Path]) -> Path:
    """
    Return the file of a profile, given by its name or as a file.

    :raises DriveCanError: there is none; the text names those that exist.
    """
    as_file = Path(name)
    if '/' in name or name.endswith((SUFFIX, '.yml')):
        if not as_file.is_file():
            raise DriveCanError(command_sentences.no_file(name=name))
        return as_file
    found = ProfileStore([str(directory) for directory in directories]).load(name)
    if isinstance(found, str):
        raise DriveCanError(found)
    return Path(found.profile.path)


def check(path: Path) -> Checked:
    """
    Check a profile file for all protocols that it names.

    :raises OSError: it cannot be read.
    """
    loaded = read_profile(path)
    problems = list(loaded.problems)
    tree = loaded.tree
    if not tree.is_damaged(()):
        for protocol in loaded.profile.protocols:
            if protocol in FAMILIES:
                problems += [tree.problem(tuple(complaint.key.split('.')), complaint.message)
                             for complaint in family_complaints(loaded.profile, protocol)]
    ordered = sorted(dict.fromkeys(problems), key=lambda problem: problem.line)
    return Checked(path, loaded, tuple(ordered), tuple(loaded.warnings))


def description(name: str, parameter: Parameter, entry: dict[str, Any]) -> dict[str, Any]:
    """Return an entry with all its keys, given ones and defaults: one JSON document."""
    found = {key: getattr(parameter, key, None) for key in _DESCRIBED}
    return {'name': name,
            **{key: each.value if isinstance(each, Enum) else each for key, each in found.items()},
            'neutral_from': parameter.neutral_from or None,
            'bits': dict(parameter.bits),
            'values': {str(raw): name for raw, name in parameter.values},
            'source': entry.get('source'), 'open': entry.get('open')}


# -- what families can carry ----------------------------------------------------------------------


def family_complaints(profile: Profile, protocol: str) -> list[Complaint]:
    """
    Return what a family cannot do with a table.

    :param protocol: one of the families; others of the table do not matter.
    :return: keys are paths in the profile, ``parameters.speed.type``.
    """
    family = FAMILIES[protocol]
    found = [list(_complaints(replace(profile, protocols=(protocol,)), family,
                              family.make_options(1, given)))
             for given in family.import_rules.choices]
    return min(found, key=len)


def _complaints(profile: Profile, family: Family, options: object,
                setpoint: Parameter | None = None) -> Iterator[Complaint]:
    """
    Yield a family's complaints about a profile.

    :param setpoint: sent each cycle; complaints about that count, too.
    """
    if family.control_built_in:
        profile = replace(profile, control=None)
    drive = DriveConfiguration(
        name='drive', bus='bus', protocol=family.name, station=1, profile=profile,
        options=options, cyclic_request=() if setpoint is None else (setpoint,))
    for complaint in (*family.check_widths(drive), *family.check(drive)):
        if complaint.key.startswith(_OURS):
            yield complaint._replace(key=complaint.key.removeprefix(_OURS))
        elif setpoint is not None:
            yield complaint


#: identity object of CiA 301: vendor, product, revision, serial number
_IDENTITY = 0x1018
#: what an entry cannot do without; and what goes with other keys
_NEEDED = ('index', 'subindex', 'number', 'type', 'access')
_TOGETHER = {'neutral_from': ('arming_tolerance',), 'arming_tolerance': ('neutral_from',)}
#: characters of an entry without its description, at least
_SHORTEST = 60


class ImportFailed(DriveCanError):
    """The file as a whole cannot be imported; the text continues its name."""


@dataclass(slots=True)
class Draft:
    """
    One entry of a file, before it is checked.

    :param line: counted from 1.
    :param section: of an EDS file, in brackets; '' in a table.
    :param title: the text that its name is made from.
    :param entry: keys and values as the schema of profiles knows them.
    :param remarks: what was missing and had to be decided, or could not be used.
    :param name: of a standard object; '': made from the title.
    :param parent: name of the record that an element is in; it stands in front of the title where
        that alone is no name.
    :param step: scale and unit that the title ends with.
    """

    line: int
    section: str
    title: str
    entry: dict[str, Any]
    remarks: list[str] = field(default_factory=list)
    name: str = ''
    parent: str = ''
    step: tuple[float, str] = (1.0, '')


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Something in the file that is not in the profile, and why."""

    line: int
    section: str
    what: str
    reason: str

    def __str__(self) -> str:
        """Return the text behind the name of the file: ``345: [2004sub6]: Speed: reason``."""
        return ': '.join(filter(None, (str(self.line), self.section, self.what, self.reason)))


@dataclass(slots=True)
class FileContent:
    """
    Everything that a file has to offer.

    :param description: of the drive type, where the file has one.
    :param protocols: that the drive speaks; none: not in the file.
    :param left_out: entries that are not in the profile.
    :param notes: about the file: the meaning of its columns, and what is odd.
    :param sections: of the profile, beside its parameters; they name standard objects.
    :param foreign: indices that belong to other axes.
    :param mended: an entry does without a key that is refused, as long as type and address are
        right; else it is used whole or not at all.
    """

    description: str = ''
    protocols: tuple[str, ...] = ()
    drafts: list[Draft] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    sections: dict[str, Any] = field(default_factory=dict)
    foreign: tuple[range, ...] = ()
    mended: bool = False


@dataclass(frozen=True, slots=True)
class Built:
    """
    A profile that was made.

    :param text: of its file.
    :param names: of its parameters, in the order of the file.
    :param entries: how many the file has, those that cannot be used included.
    :param remarks: how many entries have a comment on what had to be decided.
    :param left_out: in the order of the file.
    """

    text: str
    names: tuple[str, ...]
    protocols: tuple[str, ...]
    entries: int
    remarks: int
    left_out: tuple[LeftOut, ...]
    notes: tuple[str, ...]


def build_profile(found: FileContent, source: str, *, description: str = '',
                  protocols: Sequence[str] = ()) -> Built:
    """
    Return a profile with what a file offers.

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
    too_large = ImportFailed(command_sentences.profile_too_large(
        entries=len(named), most=SIZE_MAX))
    # before the checks, which take long
    if sum(len(draft.entry.get('description', '')) + _SHORTEST
           for draft in named.values()) > SIZE_MAX << 20:
        raise too_large
    spoken, reasons = said, dict[str, str]()
    while named:
        loaded = _loaded(named, said or tuple(FAMILIES))
        _narrow(named, loaded)
        wrong = list(loaded.problems)
        if found.mended:
            wrong = _unmended(named, wrong)
            if loaded.problems and not wrong:
                continue
        reasons = _first_reasons(wrong)
        if not reasons:
            spoken, reasons = _carriers(named, loaded.profile, said)
        if not reasons:
            break
        named = left(named, reasons)
    lost.sort(key=lambda each: each.line)
    if not named:
        raise ImportFailed(command_sentences.no_entry_usable(lost[0] if lost else None))
    if len(named) < len(found.drafts):  # names again: those of entries that were left out are free
        named = _named(list(named.values()), taken)
    sections, notes = _sections(named, found, spoken)
    text = _text(named, found, sections, source, description, spoken, guessed=not said)
    if len(text.encode('utf-8')) > SIZE_MAX << 20:
        raise too_large
    return Built(text, tuple(named), spoken, len(found.drafts) + len(found.left_out),
                 sum(bool(draft.remarks) for draft in named.values()), tuple(lost),
                 (*found.notes, *notes))


def _address(draft: Draft) -> tuple[int, int, int]:
    """Return the key to sort by: number, else index; files have no entries with neither."""
    entry = draft.entry
    return (entry.get('number', entry.get('index', 0)), entry.get('subindex', -1), draft.line)


def _named(drafts: Sequence[Draft], taken: frozenset[str]) -> dict[str, Draft]:
    standard = {draft.name: draft for draft in drafts if draft.name}
    wanted = [(name, '') for name in standard]
    others = [draft for draft in drafts if standard.get(draft.name) is not draft]
    plain = [name_of(draft.title, '', taken) for draft in others]
    often = Counter([*standard, *plain])
    for draft, own in zip(others, plain, strict=True):
        entry = draft.entry
        number = str(entry['number']) if 'number' in entry else f'{entry["index"]:04x}'
        address = f'{number}_{entry["subindex"]}' if entry.get('subindex') else number
        if draft.parent and draft.parent not in draft.title and (
                often[own] > 1 or not any(map(str.isalpha, draft.title))):
            own = name_of(f'{draft.parent} {draft.title}', address, taken)
        elif not draft.title.isascii() or own == 'parameter':
            own = name_of(draft.title, address, taken)
        wanted.append((own, address))
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


def _loaded(named: dict[str, Draft], protocols: Sequence[str],
            sections: dict[str, Any] | None = None) -> LoadedProfile:
    return profile_from_tree(Tree({
        'protocols': list(protocols),
        'parameters': {name: draft.entry.copy() for name, draft in named.items()},
        **deepcopy(sections or {})}))


def _unmended(named: dict[str, Draft], problems: Iterable[Problem]) -> list[Problem]:
    """Remove refused keys from entries, and return the problems that this does not solve."""
    left = []
    for problem in problems:
        _, name, *rest = problem.key.split('.')
        if not rest or rest[0] in _NEEDED or rest[0] not in named[name].entry:
            if not rest or rest[0] in _NEEDED:
                left.append(problem)
            continue
        for key in (rest[0], *_TOGETHER.get(rest[0], ())):
            named[name].entry.pop(key, None)
        named[name].remarks.append(f'{rest[0]} left out: {problem.message}')
    return left


def _sections(named: dict[str, Draft], found: FileContent, protocols: Sequence[str],
              ) -> tuple[dict[str, Any], list[str]]:
    """
    Return the sections that the profile can have, and notes on it.

    What is written has to pass ``profile check``, and the user should learn early
    in which modes ``validate`` accepts it.
    """
    identity = [name for name, draft in named.items()
                if draft.entry.get('index') == _IDENTITY and draft.entry['access'] != 'wo']
    sections = {**({'identity': identity} if identity else {}), **found.sections}
    notes = []
    loaded = _loaded({name: draft for name, draft in named.items()
                      if draft.name or name in identity}, protocols, sections)
    for problem in loaded.problems:
        section = problem.key.partition('.')[0]
        if sections.pop(section, None) is not None:
            notes.append(f'section {section} left out: {problem.key}: {problem.message}')
    family = FAMILIES[protocols[0]] if len(protocols) == 1 else None
    if family is not None and family.mode_key is not None:
        notes += _modes(loaded.profile, family, family.mode_key)
    return sections, notes


def _modes(profile: Profile, family: Family, key: ModeKey) -> Iterator[str]:
    """Yield in which modes ``validate`` accepts the profile, and why not in the others."""
    setpoints = [parameter for parameter in profile.parameters.values()
                 if parameter.name in key.setpoints]
    if not setpoints:
        yield 'validate takes it in no mode: it has no setpoint of any'
        return
    good, missing, reasons = [], [], []
    for mode in get_args(get_type_hints(family.options_type)['mode']):
        tried = [list(_complaints(profile, family, family.make_options(1, {'mode': mode}),
                                  setpoint)) for setpoint in setpoints]
        best = min(tried, key=len)
        if not best:
            good.append(mode)
        elif any(each.key == 'cyclic_request' for each in best):
            wrong = [each for some in tried for each in some if each.key != 'cyclic_request']
            missing += [mode] * (not wrong)
            reasons += [f'{mode}: {each.key}: {each.message}' for each in wrong]
        else:
            reasons += [f'{mode}: {each.key}: {each.message}' for each in best]
    yield f'validate takes it in the modes {", ".join(good)}' if good else (
        'validate takes it in no mode')
    if missing:
        yield f'no setpoint in the file for the modes {", ".join(missing)}'
    yield from (f'validate refuses it in the mode {reason}' for reason in reasons)


def _narrow(named: dict[str, Draft], loaded: LoadedProfile) -> None:
    """Remove limits beyond the range of the type: the type is the narrower one."""
    for warning in loaded.warnings:
        _, name, key = warning.key.split('.')
        del named[name].entry[key]
        named[name].remarks.append(f'{key} left out: {warning.message}')


def _carriers(named: dict[str, Draft], profile: Profile, said: tuple[str, ...],
              ) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the families that are to carry the table, and why which entries they cannot."""
    reasons = {protocol: _first_reasons(family_complaints(profile, protocol))
               for protocol in said or FAMILIES}
    missed = {protocol: len(each) for protocol, each in reasons.items()}
    if not said:    # those that can carry everything; else the one that can carry most
        # where numbers have no elements, all of an array would be one and the same
        of_arrays = sum('subindex' in draft.entry and 'index' not in draft.entry
                        for draft in named.values())
        missed = {protocol: count + of_arrays * (not FAMILIES[protocol].import_rules.elements)
                  for protocol, count in missed.items()}
        fewest = min(missed.values())
        said = tuple(protocol for protocol, count in missed.items() if count == fewest)
        said = said[:1] if fewest else said
    return said, {name: reason for protocol in reversed(said)
                  for name, reason in reasons[protocol].items()}


# -- the text -------------------------------------------------------------------------------------


def _text(named: dict[str, Draft], found: FileContent, sections: dict[str, Any], source: str,
          description: str, protocols: Sequence[str], *, guessed: bool = False) -> str:
    lines = comment(f'Made from {source} by "drive_can profile import": {len(named)} of '
                    f'{counted(len(found.drafts) + len(found.left_out), "entry", "entries")}, '
                    'sorted by address. '
                    'Compare what you use with the manual: the file may be wrong, and so may '
                    'what was made of it.')
    for protocol in protocols:
        remark = FAMILIES[protocol].profile_remark([draft.entry for draft in named.values()])
        lines += comment(remark) if remark else []
    words = one_line(description or found.description) or f'Parameters from {source}'
    lines += ['', f'description: {scalar(words)}']
    if guessed and len(protocols) > 1:
        lines += comment('Nobody said which protocols the drive speaks; these can carry the '
                         'table. Delete the others.')
    lines += [f'protocols: [{", ".join(protocols)}]', '', 'sources:',
              f'  file: {scalar(source)}', '']
    if 'identity' in sections:
        lines += [*comment('Object 1018h tells one device from another.'),
                  f'identity: [{", ".join(sections["identity"])}]', '']
    lines += [each for key, value in sections.items() if key != 'identity'
              for each in block(key, value)]
    lines += ['parameters:', '']
    for name, draft in named.items():
        where = ', '.join(filter(None, (f'file, line {draft.line}', draft.section)))
        lines += entry_lines(name, {**draft.entry, 'source': where}, draft.remarks)
    return '\n'.join(lines) + '\n'
