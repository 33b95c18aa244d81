# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Simulated LTMRs for tests, and what is said to them in candump's notation."""

from collections.abc import Iterable
from typing import Any

import builders

from drive_can_bridge.configuration.profiles import read_profile
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.resources import profiles_directory
from drive_can_bridge.simulation.canopen_pkw import SimulatedPkwDrive

NODE = 5
LTMR = read_profile(profiles_directory() / 'tesys_t_ltmr.yaml').profile


def names(*wanted: str, profile: Profile = LTMR) -> tuple[Parameter, ...]:
    """Return parameters by their names."""
    return tuple(profile.parameters[name] for name in wanted)


def configuration(profile: Profile = LTMR, *, name: str = 'pump', station: int = NODE,
                  request: Iterable[str] = (), response: Iterable[str] = ('system_status_1',),
                  **options: Any) -> DriveConfiguration:
    """Make the configuration of a controller; further keywords are family options."""
    return builders.drive(
        'canopen_pkw', name=name, station=station, table=profile.parameters.values(),
        control=profile.control, request=names(*request, profile=profile),
        response=names(*response, profile=profile), **options)


class Ltmr:
    """
    One simulated controller, spoken to in hex and literal times.

    :param started: switched on at 0.0 and brought to operational at once.
    """

    def __init__(self, *args: Any, started: bool = True, **options: Any) -> None:
        self.drive = SimulatedPkwDrive(configuration(*args, **options))
        if started:
            assert self.at(0.0) == [f'{0x700 + self.drive.node.number:03X}#00']
            assert self.ask(f'000#01{self.drive.node.number:02X}', 0.0) == []

    def sent(self) -> list[str]:
        """Return what it has sent since the last look."""
        return [str(answer) for answer in self.drive.take_frames()]

    def ask(self, text: str, now: float) -> list[str]:
        """Send it a frame; return what it sends."""
        self.drive.receive_frame(builders.frame(text), now)
        return self.sent()

    def at(self, now: float) -> list[str]:
        """Let its timer run once."""
        self.drive.handle_timer(now)
        return self.sent()

    def until(self, end: float) -> list[tuple[float, str]]:
        """Serve every timer up to and including ``end``, each at its own time."""
        found = []
        for _ in range(10_000):
            due = self.drive.next_timer()
            if due > end:
                return found
            found += [(round(due, 6), text) for text in self.at(due)]
        raise AssertionError(f'the timer spins at {due}')

    def fault(self, text: str, now: float) -> list[str]:
        """Play a fault; return what it sends."""
        self.drive.fault(text, now)
        return self.sent()

    def write(self, register: int, word: int, now: float) -> list[str]:
        """Write a register with one request of its own; return what it sends."""
        self.ask('505#0000000000000000', now)
        return self.ask(f'505#{register % 256:02X}{register // 256:02X}002A'
                        f'{word % 256:02X}{word // 256:02X}0000', now)

    def read(self, register: int, now: float) -> int:
        """Read a register with one request of its own."""
        self.ask('505#0000000000000000', now)
        answer = self.ask(f'505#{register % 256:02X}{register // 256:02X}002500000000', now)[0]
        assert answer[10:12] == '25', answer
        return int(answer[14:16] + answer[12:14], 16)
