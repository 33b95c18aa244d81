# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Simulated drives of all families on one bus of the bench, and who watches it."""

from collections.abc import Iterator
from contextlib import contextmanager
import itertools
from pathlib import Path
from typing import Any

import plant
import world

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.simulation.simulation import PlayedDrive, Simulation

_COUNTER = itertools.count(1)

CONVEYOR = {**plant.CONVEYOR, 'parameter_timeout': 0.3}
LIFT = {**plant.LIFT, 'protocol': 'datamodel_standard', 'period': 0.05, 'parameter_timeout': 0.3}
MIXER = {**plant.MIXER, 'parameter_timeout': 0.3}
PUMP = plant.PUMP
ALL = {'conveyor': CONVEYOR, 'lift': LIFT, 'mixer': MIXER, 'pump': PUMP}


def parameter_file(directory: Path, drives: dict[str, dict[str, Any]],
                   **bus: Any) -> Path:
    """Write a parameter file with a virtual bus that nobody else has."""
    number = next(_COUNTER)
    file = directory / f'drives_{number}.yaml'
    file.write_text(plant.text(drives, buses={'main': {
        'interface': 'virtual', 'channel': f'client_test_{number}', 'bitrate': 1_000_000, **bus}}),
        encoding='utf-8')
    return file


class World:
    """
    Drives that are played on the bench, and all that is sent to them.

    :ivar file: the parameter file.
    :ivar wire: what connects everybody.
    """

    def __init__(self, file: Path) -> None:
        assert world.current is not None
        self.file = file
        self.clock = world.current.clock
        configuration = configuration_from_file(file)
        self.wire = world.current.wires.of(str(configuration.buses['main'].channel))
        self.errors: list[str] = []
        self._simulation = Simulation(configuration, self.clock, complain=self.errors.append)

    @property
    def drives(self) -> dict[str, PlayedDrive]:
        return dict(self._simulation.drives)

    def __enter__(self) -> 'World':
        self._simulation.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._simulation.stop()

    def seen(self) -> list[Frame]:
        """Return all frames that there were on the bus, in both directions."""
        return [frame for _, frame in self.wire.frames]

    def send(self, frame: Frame) -> None:
        """Send a frame as a stranger."""
        self.wire.carry(frame)


@contextmanager
def stranger(world: World, frame: Frame, after: float) -> Iterator[None]:
    """Send a frame every so many seconds."""
    clock, staying = world.clock, True

    def run() -> None:
        clock.wait(clock.now() + after)
        while staying:
            world.send(frame)
            clock.wait(clock.now() + after)
    worker = clock.worker(run, 'stranger')
    worker.start()
    yield
    staying = False
    worker.join()


@contextmanager
def a_world(directory: Path, **drives: dict[str, Any]) -> Iterator[World]:
    """Play drives; all four families without any."""
    with World(parameter_file(directory, drives or ALL)) as made:
        yield made
