# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
One fault after the other, at random, for a long time: what is promised holds after each.

``DRIVE_CAN_SOAK_SECONDS`` says for how long (15; 60 with ``DRIVE_CAN_TEST_PROFILE=long``),
``DRIVE_CAN_TEST_SEED`` which faults; a failure names both.
"""

from collections.abc import Callable
import os
from pathlib import Path
import random
import signal
import time

from extent import times
from parameter_files import bridge_file, CONVEYOR
from processes import Client, Process, Processes, Simulator
import pytest
from test_system_reconnection import status_of
from waiting import SLOWNESS, wait_for_end

SECONDS = float(os.environ.get('DRIVE_CAN_SOAK_SECONDS', times(15, 60)))
SEED = int(os.environ['DRIVE_CAN_TEST_SEED'])
#: how often something that has to work is tried, because a busy machine may lose the drive
ATTEMPTS = 5
#: s; an answer within two of them is known to be late: late=0.5 must never cause a wrong value
PARAMETER_TIMEOUT = 0.35
#: rounds after which buffers and caches have the size that they keep
WARM = 3
#: MB
GROWTH = 16.0
#: frames after which a simulator, and its log, is replaced
LOG_MAX = 50_000

CYCLIC = '^003FFFF0#'
NEUTRAL = '^003FFFF0#000003E80{8} R'
MOVING = '^003FFFF0#(?!000003E80{8} R).* R'
#: to the neighbour, which nobody ever sends a neutral command
NEIGHBOUR_MOVING = '^005FFFF0#(?!000003E80{8} R).* R'
FAULTS = ('silent', 'late=0.015', 'late=0.5', 'drop=2', 'drop=5', 'length=3', 'length=0',
          'foreign', 'duplicate', 'stuck=ramp_time', 'off', 'restart', 'restart=0.1', 'forget',
          'trip', 'foreign duplicate drop=3')


class Soak:
    """A bridge, its drives, and what is done to them."""

    def __init__(self, processes: Processes, client: Client, namespace: str,
                 directory: Path) -> None:
        self.processes = processes
        self.client = client
        self.random = random.Random(SEED)
        drive = {**CONVEYOR, 'mapping': 'configure', 'missed_limit': 10,
                 'parameter_timeout': PARAMETER_TIMEOUT, 'command_timeout': 2.0 * SLOWNESS}
        self.file = bridge_file(directory, drives={'conveyor': drive,
                                                   'neighbour': {**drive, 'station': 2}})
        self.simulator: Simulator = processes.simulator(self.file)
        self.bridge: Process = processes.bridge(self.file, namespace)
        self.conveyor = f'/{namespace}/conveyor'
        self.neighbour = f'/{namespace}/neighbour'
        self.megabytes: list[float] = []
        self.files: list[int] = []
        self.ramp: float | None = None
        self.losses = 0
        client.online(self.conveyor)
        client.online(self.neighbour)
        client.publish(f'{self.neighbour}/command/speed_setpoint', 150.0)
        client.publish(f'{self.neighbour}/command/torque_limit', 100.0)

    # -- what happens -----------------------------------------------------------------------------

    def fault(self) -> None:
        """Let a drive, or both, be faulty for a while."""
        fault = self.random.choice(FAULTS)
        for name in self.random.choice((['conveyor'], ['neighbour'], ['conveyor', 'neighbour'])):
            self.simulator.write(f'{name} {fault}')
        self.during()
        for name in ('conveyor', 'neighbour'):
            self.simulator.write(f'{name} ok')

    def cut(self) -> None:
        """Take the adapter away, and put another one in its place."""
        self.judge_neighbour()
        if self.random.random() < 0.5:
            self.simulator.kill()
        else:
            self.simulator.end()
        self.during()
        self.simulator = self.processes.simulator(self.file)
        # whatever was written to the one before is gone with it
        self.ramp = None

    def stand_still(self) -> None:
        """Stop the process for a while, shorter or longer than the second it believes in."""
        self.bridge.send(signal.SIGSTOP)
        time.sleep(self.random.uniform(0.05, 1.6))
        self.bridge.send(signal.SIGCONT)

    def fall_silent(self) -> None:
        """Let nobody command for longer than the time-out, then let somebody begin in between."""
        self.client.silence(f'{self.conveyor}/command/speed_setpoint')
        self.client.diagnostics(status_of(self.conveyor), state='^not armed$')
        self.client.publish(f'{self.conveyor}/command/speed_setpoint', 150.0)

    def during(self) -> None:
        """Use the bridge while something is wrong; any answer will do that is not a lie."""
        end = time.monotonic() + self.random.uniform(0.1, 1.5)
        while time.monotonic() < end:
            name, = self.client.get(self.conveyor, 'ramp_time')
            assert name is None or self.ramp is None or abs(name - self.ramp) < 1e-6, \
                f'ramp_time is {name}, {self.ramp} was written'
            self.write()

    def write(self) -> None:
        """Write a parameter, and remember what is known of it."""
        value = round(self.random.uniform(0.1, 50.0), 2)
        (success, reason), = self.client.set(self.conveyor, ramp_time=value)
        assert success or reason
        # it may have been written although nobody heard of it
        self.ramp = value if success else None

    # -- what has to hold -------------------------------------------------------------------------

    def judge(self) -> None:
        """See that all is well again, and that nothing moves that nobody armed."""
        client, drive = self.client, self.conveyor
        client.online(drive)
        client.online(self.neighbour)
        # what else there may be to tell (frames rejected) is told once
        facts = client.diagnostics(status_of(drive), message='^(online|not armed)')
        since = len(self.simulator.frames())
        not_armed = 'speed_setpoint' in facts['message']
        assert not_armed or self.losses == len(self.lost()), 'lost, and armed again by itself'
        if not_armed:
            # it was lost: the publisher of 150 rpm goes on, and has no effect
            self.simulator.frame(NEUTRAL, since, count=5)
            assert not self.simulator.frames(MOVING, since), 'moves without having been armed'
        self.move(since)
        for _ in range(ATTEMPTS):  # a busy machine may answer too late
            self.write()
            if self.ramp is not None:
                break
        assert self.ramp is not None, 'a write to a drive that works'
        values = [client.get(drive, 'ramp_time')[0] for _ in range(ATTEMPTS)]
        known = [value for value in values if value is not None]
        assert known
        assert known == [pytest.approx(self.ramp)] * len(known)
        self.judge_neighbour()
        process = Path(f'/proc/{self.bridge.pid}')
        status = (process / 'status').read_text(encoding='ascii')
        line = next(line for line in status.splitlines() if line.startswith('VmRSS'))
        self.megabytes.append(int(line.split()[1]) / 1024.0)
        self.files.append(len(list((process / 'fd').iterdir())))
        if len(self.simulator.frames()) > LOG_MAX:
            self.cut()

    def move(self, since: int) -> None:
        """Arm and move; again where a busy machine loses the drive in between."""
        client, drive = self.client, self.conveyor
        for _ in range(ATTEMPTS):
            client.publish(f'{drive}/command/speed_setpoint', 0.0)
            client.diagnostics(status_of(drive), state='^online$')
            client.publish(f'{drive}/command/speed_setpoint', 150.0)
            self.losses = len(self.lost())
            end = time.monotonic() + 5.0 * SLOWNESS
            while time.monotonic() < end:
                if self.simulator.frames(MOVING, since):
                    return
                time.sleep(0.02)
            client.diagnostics(status_of(drive), state='^not armed$')
        raise AssertionError(f'armed {ATTEMPTS} times, and never moved')

    def lost(self) -> list[str]:
        """Return what the bridge says of each loss of the conveyor."""
        return [line for line in self.bridge.errors if 'conveyor: offline' in line]

    def judge_neighbour(self) -> None:
        """See that it never moved."""
        assert not self.simulator.frames(NEIGHBOUR_MOVING), 'the neighbour was never armed'

    def judge_the_end(self) -> None:
        """See an orderly end, and that nothing has grown."""
        assert self.bridge.end(self.random.choice((signal.SIGINT, signal.SIGTERM))) == 0
        wait_for_end(lambda: self.simulator.frames('^003FFFF0.* R$'),
                     ['003FFFF0#000003E800000000 R'] * 3)
        assert not [line for line in self.bridge.errors
                    if 'internal error' in line or '[FATAL]' in line]
        warm, late = self.megabytes[WARM:], self.megabytes[-WARM:]
        if len(warm) > WARM:
            assert min(late) - min(warm) < GROWTH, self.megabytes
            assert min(self.files[-WARM:]) <= max(self.files[:WARM]) + 2, self.files


@pytest.mark.real
@pytest.mark.timeout(SECONDS * SLOWNESS + 900.0)
def test_soak(processes: Processes, client: Client, namespace: str, tmp_path: Path) -> None:
    print(f'DRIVE_CAN_SOAK_SECONDS={SECONDS:g} DRIVE_CAN_TEST_SEED={SEED}')
    soak = Soak(processes, client, namespace, tmp_path)
    what: list[Callable[[], None]] = [soak.fault, soak.fault, soak.fault, soak.cut,
                                      soak.stand_still, soak.fall_silent]
    soak.judge()
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        for action in soak.random.sample(what, soak.random.choice((1, 1, 2))):
            print(f'{action.__name__} at {len(soak.simulator.frames())}')
            action()
        soak.judge()
    print(f'{len(soak.megabytes)} rounds, {soak.megabytes[-1]:.1f} MB')
    soak.judge_the_end()
