# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Simulated drives of all families on a bus of the bench, and files about them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
import json
from pathlib import Path
from typing import Any, NamedTuple

from transcripts import shown
import world

from drive_can_bridge.client import open_drives
from drive_can_bridge.client.drive import Drive
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.resources import share_directory
from drive_can_bridge.simulation.simulation import Simulation

ALL_FAMILIES = share_directory() / 'config' / 'all_families.yaml'
#: what is changed by hand in a drive of each family: three settings
BY_HAND = {
    'conveyor': {'ramp_time': 4.5, 'maximum_speed': 1200.0, 'brake_enabled': True},
    'lift': {'ramp_time': 3.0, 'maximum_speed': 7.0, 'torque_limit': 55.0},
    'mixer': {'acceleration_time': 5.0, 'minimum_frequency_set_2': 3.0, 'torque_current_limit': 7},
    'pump': {'flc1_ratio': 50.0, 'motor_trip_class': 10.0, 'network_fallback': 2},
}
_CHANNELS = count()


class Said(NamedTuple):
    """What a command said, and its exit code."""

    code: int
    lines: list[str]
    errors: list[str]

    @property
    def documents(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.lines]

    @property
    def view(self) -> list[str]:
        """Return all of it as lines."""
        return shown(self.lines, self.errors, self.code)


Command = Callable[..., Said]


class Shop:
    """
    One drive of each family, simulated, and a parameter file for whoever wants to reach them.

    :ivar file: the parameter file.
    :ivar wire: what connects everybody.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / 'all_families.yaml'
        assert world.current is not None
        self.clock = world.current.clock
        channel = f'backup_{next(_CHANNELS)}'
        self.wire = world.current.wires.of(channel)
        self.file.write_text(ALL_FAMILIES.read_text().replace(
            'channel: all_families', f'channel: {channel}'))
        self.simulation = Simulation(configuration_from_file(self.file), self.clock)
        self.drives = self.simulation.drives

    def change_by_hand(self, name: str) -> dict[str, float]:
        """Change three settings at a drive; return what they are now."""
        for parameter, value in BY_HAND[name].items():
            self.drives[name].set_value(parameter, value)
        return BY_HAND[name]

    def values(self, name: str, *parameters: str) -> tuple[float, ...]:
        """Return what stands in registers of a drive."""
        return tuple(self.drives[name].value(parameter) for parameter in parameters)

    def describe_conveyor(self, parameters: str, sections: str = '') -> None:
        """Give the conveyor another table; it exchanges ``actual_speed`` alone."""
        profile = self.folder / 'other.yaml'
        profile.write_text(f'protocols: [datamodel_extended]\nparameters:\n{parameters}'
                           '  actual_speed: {number: 209, type: int16, access: ro}\n' + sections)
        text = self.file.read_text()
        for old, new in (('profile: datamodel_example', f'profile: {profile}'),
                         ('[speed_setpoint, torque_limit]', '[]'),
                         ('[actual_speed, motor_current, status_word]', '[actual_speed]')):
            text = text.replace(old, new)
        self.file.write_text(text)

    @contextmanager
    def reached(self, name: str) -> Iterator[Drive]:
        """Reach a drive directly."""
        with open_drives(self.file, only=[name], nmt_start=True) as drives:
            yield drives[name]

    def write_backup(self, name: str, head: str = '', **values: object) -> Path:
        """Write a file as somebody might by hand."""
        path = self.folder / f'{name}.yaml'
        lines = [f'    {key}: {str(value).lower()}\n' for key, value in values.items()]
        path.write_text(f'{head}/{name}:\n  ros__parameters:\n{"".join(lines)}')
        return path


@contextmanager
def shop(folder: Path) -> Iterator[Shop]:
    """Open shop."""
    made = Shop(folder)
    with made.simulation:
        yield made
