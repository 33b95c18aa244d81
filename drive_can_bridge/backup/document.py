# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The file of a backup: what it is of, as comments, and the settings as ROS parameters.

.. code-block:: yaml

    # Settings of drive conveyor, by drive_can backup
    # time: 2026-11-22T08:15:00Z
    # bus: main (socketcan can0, 125000 bit/s)
    # protocol: datamodel_extended
    # station: 1
    # profile: datamodel_example
    # profile_sha256: 5f6c…
    # identity: firmware=10205 serial_number=4711
    /conveyor:
      ros__parameters:
        ramp_time: 2.5  # s

No settings are setpoints of any mode, the control word, the mode of operation, what process data
alone carry (no command writes them), and the bits that the profile's section ``restore`` sets and
clears: they hold the mode of a drive. A parameter with such bits comes last, as its other bits
are written with them.

Reading is strict: whatever is not clearly a backup is reported with its line, and nothing is used.
Output of ``ros2 param dump`` has no head, and ``null`` for what a drive did not give.
"""

from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
import math
from pathlib import Path
import re
from typing import Any

from drive_can_bridge.client.drive import Drive, DriveFacts
from drive_can_bridge.configuration.parameter_file import PARAMETERS_KEY, read_sections
from drive_can_bridge.configuration.problems import report
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import ConfigurationError, ValueRefused
from drive_can_bridge.core.parameters import Parameter, ValueKind
from drive_can_bridge.core.profile import RestoreStep, RestoreTable
from drive_can_bridge.core.roles import Role
from drive_can_bridge.core.text import describe_type, printable, show, TEXT_MAX
from drive_can_bridge.protocols.families import FAMILIES


def value_in_file(parameter: Parameter, raw: int) -> str:
    """Return a raw integer as a value that YAML, rcl and :func:`raw_in_file` understand."""
    value = parameter.value_from_raw(raw)
    text = show(value)
    if not isinstance(value, float) or not math.isfinite(value):
        return text
    if _nearest_raw(parameter, float(text)) != raw:
        text = repr(value)
    # without a point, YAML reads 4e+12 as a string
    return text.replace('e', '.0e') if 'e' in text and '.' not in text else text


def raw_in_file(parameter: Parameter, value: object) -> int:
    """
    Return the raw integer of a value, whether or not it may be written.

    :raises ValueRefused: a value of another kind.
    """
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueRefused(command_sentences.value_not_finite(value=value))
    kind = parameter.kind if parameter.listed else ValueKind.INTEGER
    if kind is ValueKind.BOOL:
        if isinstance(value, bool):
            return int(value)
    elif isinstance(value, bool):
        pass
    elif isinstance(value, int) or (isinstance(value, float) and kind is ValueKind.DOUBLE):
        if not parameter.listed:
            return int(value) if value >= 0 else parameter.word_from_raw(int(value))
        try:
            return parameter.raw_from_value(value)
        except ValueRefused:
            return _nearest_raw(parameter, value)
    raise ValueRefused(command_sentences.value_of_other_type(
        value=show(value), found=describe_type(value), allowed=kind.words))


def _nearest_raw(parameter: Parameter, value: float) -> int:
    return math.floor(parameter.steps(value) + 0.5)


@dataclass(frozen=True, slots=True)
class ModeBits:
    """
    The treatment of a parameter with bits of a mode, when a backup is restored.

    :param mask: those bits.
    :param at_end: their state afterwards.
    :param ended: those that a later step of ``restore`` changes back: a drive that does not have
        them as in ``at_end`` was left in the mode.
    """

    mask: int
    at_end: int
    ended: int = 0

    def to_write(self, found: int, wanted: int) -> int:
        """
        Return the word that a drive is to have in the end.

        :param found: the drive's word: also the result where it has the setting and is not in the
            mode.
        :param wanted: in the backup.
        """
        word = wanted & ~self.mask | self.at_end
        return word if (found ^ word) & (~self.mask | self.ended) else found

    def is_over(self, raw: int) -> bool:
        """Return whether a drive is not in the mode."""
        return not (raw ^ self.at_end) & self.ended


def mode_bits(table: RestoreTable | None) -> dict[str, ModeBits]:
    """Return the bits that the ``restore`` section of a profile changes, by parameter."""
    found: dict[str, ModeBits] = {}
    for step in (*table.before, *table.after) if table is not None else ():
        known = found.get(step.parameter, ModeBits(0, 0))
        at_end = known.at_end & ~step.mask | step.bits
        found[step.parameter] = ModeBits(
            known.mask | step.mask, at_end, known.ended | (known.at_end ^ at_end) & known.mask)
    return found


def modes_of(drive: Drive) -> tuple[str, ...]:
    """Return the names of the parameters that show whether a drive was left in a mode."""
    found = [drive.find(name) for name, bits in mode_bits(drive.facts.restore).items()
             if bits.ended]
    return tuple(parameter.name for parameter in found
                 if parameter is not None and parameter.readable and parameter.writable)


def is_whole(step: RestoreStep | ModeBits, parameter: Parameter) -> bool:
    """Return whether all bits of a parameter are meant."""
    return step.mask == parameter.word_from_raw(-1)


def is_setting(drive: Drive, name: str) -> bool:
    """Return whether a parameter is a setting of a drive."""
    parameter = drive.find(name)
    if parameter is None or not (parameter.readable and parameter.writable):
        return False
    if parameter.number is None and parameter.index is None:
        return False
    bits = mode_bits(drive.facts.restore).get(name)
    return (not is_command(drive.facts.protocol, parameter)
            and drive.role(name) not in (Role.CONTROL, Role.CYCLIC)
            and not (bits is not None and is_whole(bits, parameter)))


def is_command(protocol: str, parameter: Parameter) -> bool:
    """Return whether a parameter is a setpoint or a control word in some mode of a drive."""
    return protocol in FAMILIES and FAMILIES[protocol].is_command(parameter)


def settings_of(drive: Drive) -> tuple[str, ...]:
    """Return the names of all settings, in the order in which they are written back."""
    return in_order(drive, [name for name in drive.parameters if is_setting(drive, name)])


def in_order(drive: Drive, names: list[str]) -> tuple[str, ...]:
    """Return names in the profile's order, then raw ones; those with bits of a mode last."""
    bits = mode_bits(drive.facts.restore)
    order = {name: place for place, name in enumerate(drive.parameters)}
    return tuple(sorted(names, key=lambda name: (name in bits, order.get(name, len(order)))))


#: names that readers of YAML 1.1 read as true, false or nothing
_WORDS = frozenset(['y', 'yes', 'n', 'no', 'true', 'false', 'on', 'off', 'null'])


@dataclass(frozen=True, slots=True)
class Head:
    """
    The comments at the head of a backup; '' for missing ones.

    :param time: UTC, as ISO 8601 has it.
    :param bus: name, interface, channel and bit rate.
    """

    time: str = ''
    bus: str = ''
    protocol: str = ''
    station: str = ''
    profile: str = ''
    profile_sha256: str = ''
    identity: str = ''


@dataclass(frozen=True, slots=True)
class Backup:
    """
    A backup that was read.

    :param file: where it was read from, as the user names it.
    :param node: name of the node whose section it has.
    :param values: by parameter name, in the order of the file.
    :param lines: of the values, and of names without one.
    """

    file: str
    node: str
    values: Mapping[str, object]
    head: Head = Head()
    lines: Mapping[str, int] = field(default_factory=dict)

    @property
    def drive(self) -> str:
        """The name of the drive that it was made of; '' where the section is for any node."""
        name = self.node.rsplit('/', 1)[-1]
        return '' if '*' in name else name

    @property
    def without_value(self) -> list[str]:
        """The names without a value when the file was made."""
        return [name for name in self.lines if name not in self.values]

    def problem(self, name: str, message: str) -> str:
        """Return what is wrong with a value as a line."""
        return printable(f'{self.file}:{self.lines.get(name, 1)}: {printable(name)}: {message}',
                         None)


def head_of(facts: DriveFacts, *, time: str, identity: str) -> Head:
    """Return the head of a backup of a drive."""
    return Head(time, f'{facts.bus} ({facts.interface} {facts.channel}, {facts.bitrate} bit/s)',
                facts.protocol, str(facts.station), facts.profile, facts.profile_sha256, identity)


def node_of(facts: DriveFacts) -> str:
    """Return the full name of a drive's node: it lives in the namespace of its bridge."""
    return f'{facts.through.rpartition("/")[0]}/{facts.name}'


def written(facts: DriveFacts, head: Head, settings: Iterable[tuple[Parameter, int]], *,
            remarks: Iterable[str] = ()) -> str:
    """
    Return the text of a backup.

    :param settings: parameters and raw integers, in the order in which they are written back; at
        least one.
    :param remarks: further comments: what is not in the file, and why.
    """
    lines = [f'# Settings of drive {facts.name}, by drive_can backup']
    lines += [f'# {key}: {printable(getattr(head, key), None)}'.rstrip()
              for key in Head.__dataclass_fields__]
    lines += [f'# {printable(remark, None)}' for remark in remarks]
    lines += [f'{node_of(facts)}:', f'  {PARAMETERS_KEY}:']
    lines += [_line(parameter, raw) for parameter, raw in settings]
    return '\n'.join(lines) + '\n'


def _line(parameter: Parameter, raw: int) -> str:
    meant = ' '.join(filter(None, (
        parameter.unit, parameter.name_of(parameter.value_from_raw(raw)))))
    comment = f'  # {printable(meant, None)}' if meant else ''
    name = f"'{parameter.name}'" if parameter.name in _WORDS else parameter.name
    return f'    {name}: {value_in_file(parameter, raw)}{comment}'


#: how ros2 param dump writes what has no value
NOT_SET = 'null'
_COMMENT = re.compile(r'# ([a-z0-9_]+): ?(.*)')
_BRIDGE_KEYS = {'buses', 'drives'}


def read_backup(path: Path) -> Backup:
    """
    Read a backup.

    :raises ConfigurationError: it is none; a line for each problem.
    :raises OSError: it cannot be read.
    """
    sections, problems = read_sections(path)
    if len(sections) == 1:
        problems += sections[0].tree.problems
    if problems:
        raise ConfigurationError(report(problems))
    if len(sections) != 1:
        names = ', '.join(section.name for section in sections)
        raise _wrong(path, command_sentences.backup_of_several(count=len(sections), names=names)
                     if sections else command_sentences.backup_without_node())
    section, = sections
    data = section.tree.data
    if _BRIDGE_KEYS & set(data):
        raise _wrong(path, command_sentences.bridge_file_no_backup(
            keys=', '.join(sorted(_BRIDGE_KEYS & set(data)))))
    values = dict(_flat(data, ()))
    backup = Backup(
        str(path), section.name,
        {'.'.join(place): value for place, value in values.items() if value != NOT_SET},
        _head(path), {'.'.join(place): section.tree.line(place) for place in values})
    wrong = [backup.problem(name, command_sentences.no_backup_value(found=_described(value)))
             for name, value in backup.values.items()
             if not isinstance(value, (bool, int, float))]
    wrong += [backup.problem(name, command_sentences.backup_name_too_long(most=TEXT_MAX))
              for name in backup.lines if len(name) > TEXT_MAX]
    if wrong:
        raise ConfigurationError(wrong)
    if not values:
        raise _wrong(path, command_sentences.backup_without_parameters())
    return backup


def _described(value: object) -> str:
    return f'{show(value)} is a string' if isinstance(value, str) else describe_type(value)


def _flat(data: Mapping[str, Any], above: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...],
                                                                             object]]:
    """Yield the values of nested mappings: ``ros2 param dump`` splits names at their dots."""
    for key, value in data.items():
        if isinstance(value, dict):
            yield from _flat(value, (*above, key))
        else:
            yield (*above, key), value


def _head(path: Path) -> Head:
    """Read the comments before the first line that is none, encoded as YAML may be."""
    found: dict[str, str] = {}
    data = path.read_bytes()
    encoding = 'utf-16' if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else 'utf-8-sig'
    for line in data.decode(encoding, errors='replace').splitlines():
        line = line.strip()
        if line and not line.startswith('#'):
            break
        match = _COMMENT.fullmatch(line)
        if match is not None and match[1] in Head.__dataclass_fields__:
            found.setdefault(match[1], match[2].strip())
    return Head(**found)


def _wrong(path: Path, message: str) -> ConfigurationError:
    return ConfigurationError([printable(f'{path}: {message}', None)])
