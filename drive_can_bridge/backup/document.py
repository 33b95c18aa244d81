# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The file of a backup: comments that say what it is of, and the settings as ROS parameters.

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
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from drive_can_bridge.backup.values import value_in_file
from drive_can_bridge.client.drive import DriveFacts
from drive_can_bridge.configuration.parameter_file import PARAMETERS_KEY
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.text import printable

#: names that readers of YAML 1.1 take for true, false or nothing
_WORDS = frozenset(['y', 'yes', 'n', 'no', 'true', 'false', 'on', 'off', 'null'])


@dataclass(frozen=True, slots=True)
class Head:
    """
    What the comments at the head say; '' where they do not.

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
        """Name of the drive that it was made of; '' where the section is for any node."""
        name = self.node.rsplit('/', 1)[-1]
        return '' if '*' in name else name

    @property
    def without_value(self) -> list[str]:
        """Names that the drive did not give when the file was made."""
        return [name for name in self.lines if name not in self.values]

    def problem(self, name: str, message: str) -> str:
        """Write what is wrong with a value as a line."""
        return printable(f'{self.file}:{self.lines.get(name, 1)}: {printable(name)}: {message}',
                         None)


def head_of(facts: DriveFacts, *, time: str, identity: str) -> Head:
    """Say what a backup is of."""
    return Head(time, f'{facts.bus} ({facts.interface} {facts.channel}, {facts.bitrate} bit/s)',
                facts.protocol, str(facts.station), facts.profile, facts.profile_sha256, identity)


def node_of(facts: DriveFacts) -> str:
    """Return the full name of a drive's node: it lives in the namespace of its bridge."""
    return f'{facts.through.rpartition("/")[0]}/{facts.name}'


def written(facts: DriveFacts, head: Head, settings: Iterable[tuple[Parameter, int]], *,
            remarks: Iterable[str] = ()) -> str:
    """
    Write a backup.

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
    unit = f'  # {printable(parameter.unit, None)}' if parameter.unit else ''
    name = f"'{parameter.name}'" if parameter.name in _WORDS else parameter.name
    return f'    {name}: {value_in_file(parameter, raw)}{unit}'
