# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can read`` and ``write`` as a user starts them: directly and through a bridge."""

import json
import os
from pathlib import Path
import signal
from typing import Any

from parameter_files import bridge_file, CONVEYOR
import plant
from processes import Client, Process, Processes
import pytest
from waiting import wait_for

from drive_can_bridge.transport.bus_identity import DeviceLock

#: nothing here may depend on how busy the machine is
PATIENT: dict[str, Any] = {'missed_limit': 100, 'parameter_timeout': 10.0}
ALL = {'conveyor': {**CONVEYOR, **PATIENT}, 'mixer': {**plant.MIXER, **PATIENT},
       'lift': {**plant.LIFT, 'protocol': 'datamodel_standard', 'period': 0.1, **PATIENT},
       'pump': {**plant.PUMP, **PATIENT, 'period': 0.2}}
#: what each family is told, and how the value is then written
WRITES = {'conveyor': ('ramp_time', '2.5'), 'lift': ('ramp_time', '1.5'),
          'mixer': ('acceleration_time', '4'), 'pump': ('motor_trip_class', '10')}


def ended(process: Process, code: int = 0) -> list[str]:
    """Wait for the end of a command and return its lines."""
    assert process.wait() == code, process.dump()
    return process.lines


def documents(process: Process, code: int = 0) -> list[dict[str, Any]]:
    return [json.loads(line) for line in ended(process, code)]


@pytest.mark.real
def test_as_a_user_starts_them(processes: Processes, client: Client, namespace: str,
                               tmp_path: Path) -> None:
    file = bridge_file(tmp_path, drives=ALL)
    processes.simulator(file)
    direct, through = ('--params-file', str(file), '--nmt-start'), ('--namespace', namespace)
    assert ended(processes.drive_can('write', 'conveyor', 'ramp_time=2.5', *direct))[1].endswith(
        '  written')
    bridge = processes.bridge(file, namespace)
    client.online(f'/{namespace}/conveyor')
    document, = documents(processes.drive_can('read', 'conveyor', 'ramp_time', '--json', *through))
    assert document['value'] == 2.5
    # nobody gets between
    refused = processes.drive_can('read', 'pump', *direct)
    written = processes.drive_can('write', 'conveyor', 'ramp_time=4', *through)
    assert ended(written)[1].endswith('  written')
    assert refused.wait() == 1
    assert refused.errors == [f'bus main: drive pump is used by process {bridge.pid}; leave '
                              f'--params-file away to go through it']
    assert bridge.end() == 0


def test_both_ways_show_the_same(processes: Processes, client: Client, namespace: str,
                                 tmp_path: Path) -> None:
    file = bridge_file(tmp_path, drives=ALL)
    processes.simulator(file)
    direct = ('--params-file', str(file), '--nmt-start')
    for drive, (name, value) in WRITES.items():
        written, = ended(processes.drive_can('write', drive, f'{name}={value}', *direct))[1:]
        assert written.endswith('  written')
    alone = ended(processes.drive_can('read', '*', *direct))
    assert len(alone) > 150
    bridge = processes.bridge(file, namespace)
    for drive in ALL:
        client.online(f'/{namespace}/{drive}')
    through = ('--namespace', namespace)
    for drive, (name, value) in WRITES.items():
        document, = documents(processes.drive_can('read', drive, name, '--json', *through))
        assert document['value'] == float(value)
        written, = ended(processes.drive_can('write', drive, f'{name}={value}', *through))[1:]
        assert written.endswith('  written')
        mine = ended(processes.drive_can('read', drive, *through))
        # the same rows: only what the motors do differs from one moment to the next
        names = {line.split()[1] for line in alone if line.split()[0] == drive}
        assert names <= {line.split()[0] for line in mine}
        row = next(line for line in mine if line.split()[0] == name)
        other = next(line for line in alone if line.split()[:2] == [drive, name])
        assert row.split() == other.split()[1:]
    assert bridge.end() == 0


@pytest.mark.real
def test_a_second_bridge_names_the_first_and_a_killed_one_leaves_no_lock(
        processes: Processes, namespace: str, tmp_path: Path) -> None:
    file = bridge_file(tmp_path)
    simulator = processes.simulator(file)
    first = processes.bridge(file, namespace)
    first.error('active: 1 drive')
    port = simulator.line('^bus main: slcan ').split()[-1]
    # the same port by another name
    second = processes.bridge(file, f'{namespace}_b', '-p', f'buses.main.channel:={port}')
    assert second.wait() == 1
    assert any(f'bus main: drive conveyor is used by process {first.pid}; ' in line
               for line in second.errors), second.errors
    scan = processes.drive_can('scan', '--interface', 'slcan', '--channel', port, '--listen',
                               '0.1')
    assert scan.wait() == 1
    assert scan.errors == [f'bus main: the serial port {port} is used by process {first.pid}; '
                           f'end that first']
    first.kill()
    third = processes.bridge(file, f'{namespace}_c')
    third.error('active: 1 drive')
    assert third.end() == 0


@pytest.mark.real
def test_where_only_the_device_is_shared_nothing_is_written_to_it(
        processes: Processes, namespace: str, tmp_path: Path) -> None:
    """As with two containers: the locks of the host do not meet."""
    file = bridge_file(tmp_path)
    simulator = processes.simulator(file)
    port = simulator.line('^bus main: slcan ').split()[-1]
    file = bridge_file(tmp_path, channel=port)
    lock = DeviceLock(port)
    for begin in (lambda: processes.bridge(file, namespace),
                  lambda: processes.drive_can('read', '--params-file', str(file)),
                  lambda: processes.drive_can('simulate', '--params-file', str(file)),
                  lambda: processes.drive_can('scan', '--interface', 'slcan', '--channel', port)):
        process = begin()
        assert process.wait() == 1
        assert any(f'slcan {port}: the serial port is used by process {os.getpid()}; a drive has '
                   f'one master' in line for line in process.errors), process.errors
    assert simulator.frames() == []
    lock.release()
    bridge = processes.bridge(file, namespace)
    bridge.error('conveyor: online')
    assert bridge.end() == 0


@pytest.mark.real
def test_ctrl_c_waits_for_the_write_under_way(processes: Processes, client: Client,
                                              namespace: str, tmp_path: Path) -> None:
    slow = {**CONVEYOR, 'parameter_timeout': 2.0}
    file = bridge_file(tmp_path, drives={'conveyor': slow})
    simulator = processes.simulator(file)
    processes.bridge(file, namespace)
    client.online(f'/{namespace}/conveyor')
    before = len(simulator.frames())
    simulator.write('conveyor late=0.5')
    simulator.line('fault late')
    write = processes.drive_can('write', 'conveyor', 'ramp_time=7', 'maximum_speed=1000',
                                '--namespace', namespace)
    # the write frame itself: read, then written, then read back half a second later
    simulator.frame('#02BC', since=before)
    write.send(signal.SIGINT)
    assert write.wait() == 130
    assert [line.split()[0] for line in write.lines] == ['name', 'ramp_time', 'maximum_speed']
    assert write.lines[1].endswith('  written')
    assert write.lines[2].endswith('  not written: ended before')
    assert write.errors == ['drive_can write: interrupted']
    assert not simulator.frames('#2710', since=before)


@pytest.mark.real
def test_watching_ends_with_ctrl_c(processes: Processes, tmp_path: Path) -> None:
    file = bridge_file(tmp_path)
    processes.simulator(file)
    watch = processes.drive_can('read', 'motor_current', 'ramp_time', '--watch', '0.05', '--json',
                                '--params-file', str(file))
    wait_for(lambda: len(watch.lines) >= 6, 'three rounds')
    assert watch.end(signal.SIGINT) == 0
    found = [json.loads(line) for line in watch.lines]
    assert [each['name'] for each in found[:4]] == ['motor_current', 'ramp_time'] * 2
    assert found[0]['time'] < found[2]['time']
    assert watch.errors == []
