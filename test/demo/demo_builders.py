# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Snapshots without a bridge, and the demo as a process."""

import math
import os
from pathlib import Path
import re
import subprocess
import sys
from typing import Any

from waiting import wait_for

from drive_can_bridge.core.session import DriveState
from drive_can_bridge.ros.demo.snapshot import (
    Bits, BusSnapshot, DriveSnapshot, Shown, Snapshot, Times, Trend,
)

#: of 0 to 101; a domain of its own keeps tests away from whatever else runs on this machine
DOMAIN_ID = int(os.environ['ROS_DOMAIN_ID'])  # the test run's own
UNKNOWN = Times(math.nan, math.nan)


def drive(name: str = 'conveyor', *, state: DriveState = DriveState.ONLINE, speed: float = 12.3,
          advice: str = '', values: int = 2, answering: bool | None = None) -> DriveSnapshot:
    """Make a snapshot of a drive."""
    answers = state is not DriveState.OFFLINE if answering is None else answering
    shown = [Shown('actual_speed', f'{speed:.1f}' if answers else '', 'rpm', 7),
             Shown('motor_current', '1.25' if answers else '', 'A', 7)]
    shown += [Shown(f'value_{number}', '7', '', 5) for number in range(2, values)]
    return DriveSnapshot(
        name=name, state=state, answering=answers, place='main, station 1', control='',
        advice=advice,
        setpoints=(Shown('speed_setpoint', f'{speed:.1f}', 'rpm', 7, strong=answers),),
        values=tuple(shown),
        bits=(Bits('status_word', (('ready', True if answers else None),
                                   ('fault', False if answers else None))),),
        rate=50.0, exchanges=1000, missed=3, period_error=Times(0.00012, 0.0019) if answers
        else UNKNOWN, latency=Times(0.0004, 0.0021) if answers else UNKNOWN,
        trend=Trend('actual_speed', 'rpm', (0.0, speed, -speed)))


def snapshot(*drives: DriveSnapshot, buses: int = 1) -> Snapshot:
    """Make a snapshot of everything."""
    return Snapshot(
        drives=drives or (drive(),),
        buses=tuple(BusSnapshot(f'bus_{number}', 'virtual', 125_000, 'up', 36.4, '1234', '1230',
                                '0') for number in range(buses)),
        uptime=3725.0, processor=0.07)


class Demo:
    """
    A running ``drive_can demo``.

    :param environment: variables to be set, or with None to be left out.
    """

    def __init__(self, directory: Path, *arguments: str,
                 environment: dict[str, str | None] | None = None, **options: Any) -> None:
        self.out, self.err = directory / 'out', directory / 'err'
        variables: dict[str, str | None] = {
            **os.environ, 'ROS_DOMAIN_ID': str(DOMAIN_ID),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', 'ROS_LOG_DIR': str(directory / 'log'),
            **(environment or {})}
        with self.out.open('wb') as out, self.err.open('wb') as err:
            options = {'stdin': subprocess.DEVNULL, 'stdout': out, 'stderr': err, **options}
            self.process = subprocess.Popen(
                [sys.executable, '-m', 'drive_can_bridge.cli.main', 'demo', *arguments],
                env={name: value for name, value in variables.items() if value is not None},
                **options)

    @property
    def lines(self) -> list[str]:
        """Standard output."""
        return self.out.read_text(encoding='utf-8').splitlines()

    @property
    def errors(self) -> str:
        """Standard error."""
        return self.err.read_text(encoding='utf-8')

    def line(self, pattern: str, timeout: float = 30.0) -> str:
        """Wait for a line of standard output."""
        def find() -> str | None:
            found = next((line for line in self.lines if re.search(pattern, line)), None)
            if found is None and self.process.poll() is not None:
                raise AssertionError(f'the demo ended without {pattern}: {self.errors}')
            return found
        return str(wait_for(find, f'line {pattern}', timeout))

    def end(self, signum: int, timeout: float = 2.0) -> int:
        """Send a signal and wait for the end."""
        self.process.send_signal(signum)
        return self.process.wait(timeout)

    def close(self) -> None:
        """End it whatever it does."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
