# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Simulated drives of all families on one bus in this process, and who watches it."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
import copy
import itertools
from pathlib import Path
import threading
from types import TracebackType
from typing import Any

import can
from clocks import REAL
from repeating import again_and_again
from waiting import wait_for
import yaml

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.simulation.simulation import PlayedDrive, Simulation

_COUNTER = itertools.count(1)
#: an identifier that nobody listens to
MARK = 0x7FF

CONVEYOR: dict[str, Any] = {
    'bus': 'main', 'protocol': 'datamodel_extended', 'station': 1, 'profile': 'datamodel_example',
    'cyclic_request': ['speed_setpoint', 'torque_limit'],
    'cyclic_response': ['actual_speed', 'motor_current', 'status_word'],
    'parameter_timeout': 0.3}
LIFT: dict[str, Any] = {
    'bus': 'main', 'protocol': 'datamodel_standard', 'station': 2,
    'profile': 'datamodel_control_example', 'cyclic_request': ['control_word', 'speed_setpoint'],
    'cyclic_response': ['status_word', 'actual_speed'], 'period': 0.05,
    'parameter_timeout': 0.3}
MIXER: dict[str, Any] = {
    'bus': 'main', 'protocol': 'cannord', 'station': 50, 'profile': 'nord_sk500e',
    'cyclic_request': ['frequency_setpoint'], 'cyclic_response': ['actual_frequency'],
    'parameter_timeout': 0.3}
PUMP: dict[str, Any] = {
    'bus': 'main', 'protocol': 'canopen_pkw', 'station': 5, 'profile': 'tesys_t_ltmr',
    'cyclic_response': ['system_status_1'], 'period': 0.1}
ALL = {'conveyor': CONVEYOR, 'lift': LIFT, 'mixer': MIXER, 'pump': PUMP}


def parameter_file(directory: Path, drives: dict[str, dict[str, Any]],
                   **bus: Any) -> Path:
    """Write a parameter file with a virtual bus that nobody else has."""
    number = next(_COUNTER)
    content = {'buses': {'main': {'interface': 'virtual', 'channel': f'client_test_{number}',
                                  'bitrate': 1_000_000, **bus}},
               'drives': copy.deepcopy(drives)}
    file = directory / f'drives_{number}.yaml'
    file.write_text(yaml.dump({'/**/drive_can_bridge': {'ros__parameters': content}},
                              sort_keys=False), encoding='utf-8')
    return file


class World:
    """
    Drives that are played, and all that is sent to them.

    :ivar file: the parameter file.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        configuration = configuration_from_file(file)
        self.channel = str(configuration.buses['main'].channel)
        self.errors: list[str] = []
        self._simulation = Simulation(configuration, REAL, complain=self.errors.append)

    @property
    def drives(self) -> dict[str, PlayedDrive]:
        return dict(self._simulation.drives)

    def __enter__(self) -> 'World':
        self._bus = can.Bus(interface='virtual', channel=self.channel, ignore_config=True)
        self._simulation.start()
        self._ending = threading.Event()
        self._seen: list[Frame] = []
        self._thread = threading.Thread(target=self._listen, name='witness')
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        self._ending.set()
        self._thread.join()
        self._simulation.stop()
        self._bus.shutdown()

    def _listen(self) -> None:
        while not self._ending.is_set():
            message = self._bus.recv(0.02)
            if message is not None:
                self._seen.append(Frame(message.arbitration_id, bytes(message.data),
                                        message.is_extended_id))

    def seen(self) -> list[Frame]:
        """Return all frames that are on the bus by now, in both directions."""
        mark = Frame(MARK, next(_COUNTER).to_bytes(8, 'big'), False)
        self.send(mark)
        wait_for(lambda: mark in self._seen, 'the mark')
        return [frame for frame in self._seen if frame.identifier != MARK or frame.extended]

    def send(self, frame: Frame) -> None:
        """Send a frame as a stranger."""
        with can.Bus(interface='virtual', channel=self.channel, ignore_config=True) as bus:
            bus.send(can.Message(arbitration_id=frame.identifier, data=frame.data,
                                 is_extended_id=frame.extended))


def stranger(world: World, frame: Frame, after: float) -> AbstractContextManager[None]:
    """Send a frame again and again, for the first time after some seconds."""
    return again_and_again(lambda: world.send(frame), after, after=after)


@contextmanager
def a_world(directory: Path, **drives: dict[str, Any]) -> Iterator[World]:
    """Play drives; all four families without any."""
    with World(parameter_file(directory, drives or ALL)) as world:
        yield world
