# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Backups through a running bridge, and restores that are broken off: processes and signals."""

from collections.abc import Iterable, Sequence
import json
from pathlib import Path
import signal

from processes import Client, Process, Processes, Simulator
import pytest
import yaml

from drive_can_bridge.backup.document import read_backup
from drive_can_bridge.resources import share_directory

BY_HAND = {
    'conveyor': 'set=ramp_time:4.5 set=maximum_speed:1200 set=brake_enabled:true',
    'lift': 'set=ramp_time:3 set=maximum_speed:7 set=torque_limit:55',
    'mixer': 'set=acceleration_time:5 set=minimum_frequency_set_2:3 set=torque_current_limit:7',
    'pump': 'set=flc1_ratio:50 set=motor_trip_class:10 set=network_fallback:2',
}
#: requests to the pump that write register 601, in and out of the configuration mode
INTO_MODE, OUT_OF_MODE = '^505#5902..[2A]A0100', '^505#5902..[2A]A0000'


def write_file(directory: Path, *, patience: float = 10.0) -> Path:
    """
    Write the shipped file with one drive of each family, for the simulator's terminal.

    :param patience: s without an answer until it is missed: nothing depends on how busy the
        machine is.
    """
    content = yaml.safe_load((share_directory() / 'config' / 'all_families.yaml').read_text())
    parameters, = (node['ros__parameters'] for node in content.values())
    parameters['buses']['main'].update(interface='slcan', channel=f'{directory}/links/main')
    for drive in parameters['drives'].values():
        # a servo interpolates over 0.02 s at most
        drive['period'] = max(drive['period'], 0.02 if 'mode' in drive else 0.05)
        drive.update(parameter_timeout=patience, missed_limit=round(patience / drive['period']))
    file = directory / 'bridge.yaml'
    file.write_text(yaml.dump(content, sort_keys=False))
    return file


def prepare(processes: Processes, **options: float) -> Simulator:
    """Start the drives; the pump is not in configuration mode."""
    simulator = processes.simulator(write_file(processes.directory, **options))
    simulator.write('pump set=general_configuration:0')
    simulator.line('pump: fault set=general_configuration')
    return simulator


def ask(processes: Processes, *arguments: str, code: int = 0) -> Process:
    """Run a command to its end."""
    process, = ask_all(processes, [arguments], code=code)
    return process


def ask_all(processes: Processes, commands: Iterable[Sequence[str]], code: int = 0,
            ) -> list[Process]:
    """Run commands beside each other, all to their ends."""
    started = [processes.drive_can(*arguments) for arguments in commands]
    for process in started:
        assert process.wait() == code, process.dump()
    return started


def documents(process: Process) -> dict[str, dict[str, object]]:
    """Return the JSON documents of a command by parameter, of several the last."""
    return {each['parameter']: each for each in map(json.loads, process.lines)}


class TestThroughTheBridge:

    @pytest.mark.real
    def test_as_a_user_starts_them(self, processes: Processes, client: Client,
                                   namespace: str) -> None:
        simulator = prepare(processes)
        processes.bridge(processes.directory / 'bridge.yaml', namespace)
        client.online(f'/{namespace}/pump')
        file, way = str(processes.directory / 'b.yaml'), ('--namespace', namespace)
        ask(processes, 'backup', 'pump', '-o', file, *way)
        simulator.write(f'pump {BY_HAND["pump"]}')
        simulator.line('pump: fault set=network_fallback')
        restored = ask(processes, 'restore', file, '--yes', '--json', *way)
        assert {key for key, one in documents(restored).items() if one['ok']} == {
            'flc1_ratio', 'motor_trip_class', 'network_fallback'}
        assert ask(processes, 'compare', 'pump', file, *way).lines == ['the same']

    def test_one_drive_of_each_family(self, processes: Processes, client: Client,
                                      namespace: str) -> None:
        simulator = prepare(processes)
        processes.bridge(processes.directory / 'bridge.yaml', namespace)
        way = ('--namespace', namespace)
        files = {name: processes.directory / f'{name}_backup.yaml' for name in BY_HAND}
        for name in BY_HAND:
            client.online(f'/{namespace}/{name}')

        def each(*command: str, code: int = 0) -> dict[str, Process]:
            """Run a command for each drive; NAME and FILE stand for its own."""
            return dict(zip(files, ask_all(processes, (
                [*(word.replace('NAME', name).replace('FILE', str(file)) for word in command),
                 *way] for name, file in files.items()), code)))
        each('backup', 'NAME', '-o', 'FILE')
        # what ros2 param load sends, as rclpy reads the file for it
        parameter = pytest.importorskip('rclpy.parameter')
        for name, file in files.items():
            backup = read_backup(file)
            assert backup.node == f'/{namespace}/{name}'
            loaded = {key: parameter.parameter_value_to_python(message.value)
                      for key, message in parameter.parameter_dict_from_yaml_file(
                          str(file), use_wildcard=True, target_nodes=[backup.node]).items()}
            assert loaded == backup.values
            answers = client.set(f'/{namespace}/{name}', **loaded)
            assert all(success for success, _ in answers), answers
        for process in each('compare', 'FILE', 'NAME').values():
            assert process.lines == ['the same']
        for name, faults in BY_HAND.items():
            simulator.write(f'{name} {faults}')
            simulator.line(f'{name}: fault {faults.split()[-1]}')
        compared = each('compare', 'NAME', 'FILE', '--json', code=1)
        shown = each('restore', 'FILE', '--dry-run', '--json')
        for name in BY_HAND:
            simulator.write(name)
        restored = each('restore', 'FILE', '--yes', '--json')
        for name, faults in BY_HAND.items():
            changed = {text.partition('=')[2].partition(':')[0] for text in faults.split()}
            found = documents(compared[name])
            assert set(found) == changed
            assert {key: (one['found'], one['wanted'])
                    for key, one in documents(shown[name]).items()} == {
                key: (one['a'], one['b']) for key, one in found.items()}
            assert {key for key, one in documents(restored[name]).items()
                    if one['ok']} == changed
        for process in each('compare', 'NAME', 'FILE').values():
            assert process.lines == ['the same']


class TestBrokenOff:

    @pytest.mark.real
    def test_by_a_signal(self, processes: Processes) -> None:
        simulator = prepare(processes)
        file = processes.directory / 'b.yaml'
        way = ('--params-file', str(processes.directory / 'bridge.yaml'), '--nmt-start')
        ask(processes, 'backup', 'pump', '-o', str(file), *way)
        simulator.write(f'pump {BY_HAND["pump"]} late=0.3')
        simulator.line('pump: fault late')
        restore = processes.drive_can('restore', str(file), '--yes', *way)
        simulator.frame(INTO_MODE)
        restore.send(signal.SIGTERM)
        restore.send(signal.SIGTERM)        # impatience changes nothing
        assert restore.wait() == 128 + signal.SIGTERM
        assert restore.errors[-2:-1] == ['pump: ending after the write under way'], restore.errors
        assert restore.errors[-1] == (
            'pump: interrupted. Written: nothing. Not written: motor_trip_class, flc1_ratio, '
            'network_fallback. Repeat the command to go on')
        assert simulator.frames(OUT_OF_MODE)
        simulator.write('pump ok')
        ask(processes, 'restore', str(file), '--yes', *way)
        assert ask(processes, 'compare', str(file), 'pump', *way).lines == ['the same']
