# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A bridge of each distribution, and clients of the other one: they talk, whatever is between them.

usage: two_distributions.py PYTHON PYTHON [--only WORD]

Each PYTHON is that of an environment with one distribution (``.ci/setup``). A simulated conveyor
and its bridge run from one, a plain rclpy node (``system/ros_client.py``) and the commands of this
package from the other, and then the other way round: on one host, as it is and over UDP alone, and
between two. (There is no shared memory between Fast DDS 2 and 3: each calls its files otherwise.)
Hosts are network namespaces with a link of their own, so it needs root, and iproute2; between two
of them also ``/dev/shm`` and the name of the host differ. Where that cannot be had it exits with
77, and its last line says why.

Nothing here is a test of pytest: each story needs two installations. ``.ci/run all`` tells them.
"""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass, field
import json
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any

import plant

HERE = Path(__file__).parent
#: s after which a thing that has not happened never will
DEADLINE = 120.0
DRIVE = '/both/conveyor'
CONVEYOR = {**plant.CONVEYOR, 'period': 0.02, 'command_timeout': 5.0, 'missed_limit': 25,
            'parameter_timeout': 0.3}
#: what is between them -> what Fast DDS may use, whether the client has another host
WAYS = {'one host': ('DEFAULT', False), 'UDP alone': ('UDPv4', False),
        'two hosts': ('DEFAULT', True)}

#: what the wheels of one distribution leave to whoever is started, and profiles of ours
INHERITED = ('LD_LIBRARY_PATH', '_ROS_WHEELS_BOOTSTRAP_COMPLETE', 'PYTHONPATH',
             'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')


class Missing(Exception):
    """What cannot be had here."""


@dataclass
class Host:
    """
    A network of its own.

    :ivar before: what a command has to begin with to run on it.
    """

    name: str
    before: list[str] = field(default_factory=list)


@contextmanager
def two_hosts() -> Iterator[tuple[Host, Host]]:
    """Make two hosts with a link between them."""
    if os.geteuid() != 0:
        raise Missing('hosts of its own need root')
    for program in 'ip', 'unshare':
        if shutil.which(program) is None:
            raise Missing(f'no {program}: apt install iproute2 util-linux')
    hosts = [Host(f'drive-can-{number}-{os.getpid()}') for number in (1, 2)]
    ends = [f'dc{number}x{os.getpid() % 1_000_000}' for number in (1, 2)]
    with ExitStack() as stack:
        for host in hosts:
            _ip('netns', 'add', host.name)
            stack.callback(_ip, 'netns', 'del', host.name)
        _ip('link', 'add', ends[0], 'netns', hosts[0].name, 'type', 'veth', 'peer', 'name',
            ends[1], 'netns', hosts[1].name)
        for number, (host, end) in enumerate(zip(hosts, ends), 1):
            for words in (
                    ['link', 'set', 'lo', 'up'], ['link', 'set', end, 'up'],
                    ['addr', 'add', f'10.79.0.{number}/24', 'dev', end],
                    ['route', 'add', '224.0.0.0/4', 'dev', end]):
                _ip('-n', host.name, *words)
            host.before = ['ip', 'netns', 'exec', host.name]
        # the second one shares neither memory nor name with the first
        hosts[1].before += ['unshare', '-mu', 'sh', '-c', 'mount -t tmpfs none /dev/shm && '
                            f'hostname {hosts[1].name} && exec "$@"', '-']
        yield hosts[0], hosts[1]


def _ip(*words: str) -> None:
    done = subprocess.run(['ip', *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise Missing(f'ip {" ".join(words)}: {done.stderr.strip()}')


class Place:
    """
    Where programs of one distribution run.

    :param python: of its environment.
    :param folder: for what they write.
    :param transports: what Fast DDS may use.
    """

    def __init__(self, python: str, host: Host, folder: Path, transports: str) -> None:
        self._python, self._host, self._folder = python, host, folder
        folder.mkdir(parents=True, exist_ok=True)
        self._environment = {
            **{name: value for name, value in os.environ.items() if name not in INHERITED},
            'PYTHONPATH': os.pathsep.join(map(str, (HERE, HERE / 'system'))),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'DRIVE_CAN_LOCAL': 'off',
            'FASTDDS_BUILTIN_TRANSPORTS': transports, 'ROS_LOG_DIR': str(folder / 'log')}
        self._started: list[tuple[str, subprocess.Popen[str]]] = []

    def run(self, name: str, *words: str, **options: Any) -> subprocess.Popen[str]:
        """Start a program of Python; both outputs go to a file of this name."""
        if 'stdout' not in options:
            options['stdout'] = (self._folder / name).open('w', encoding='utf-8')
        process = subprocess.Popen(
            [*self._host.before, self._python, *words], env=self._environment, cwd=self._folder,
            text=True, stderr=(self._folder / f'{name}.errors').open('w'), **options)
        self._started.append((name, process))
        return process

    def drive_can(self, *words: str) -> str:
        """Return what a command of the package says; it must end well, on a busy machine too."""
        deadline = time.monotonic() + DEADLINE
        while True:
            process = self.run(f'drive_can_{words[0]}', '-m', 'drive_can_bridge.cli.start', *words)
            code = process.wait(DEADLINE)
            said = self.said(f'drive_can_{words[0]}')
            if code == 0:
                return said
            if time.monotonic() > deadline:
                raise AssertionError(f'drive_can {" ".join(words)}: exit code {code}\n{said}')

    def said(self, name: str) -> str:
        """Return what a program has written so far."""
        return ''.join((self._folder / each).read_text(encoding='utf-8', errors='replace')
                       for each in (name, f'{name}.errors') if (self._folder / each).exists())

    def end(self) -> None:
        """End what still runs; the background of a script may ignore SIGINT."""
        for _, process in reversed(self._started):
            if process.poll() is None:
                process.terminate()
                try:
                    process.wait(60.0)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()

    def dump(self) -> str:
        """Return the ends of all that was written."""
        return '\n'.join(f'--- {name}\n{self.said(name)[-1500:]}' for name, _ in self._started)


class Client:
    """The plain rclpy node."""

    def __init__(self, place: Place) -> None:
        self._process = place.run('client', str(HERE / 'system' / 'ros_client.py'),
                                  stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def ask(self, action: str, **arguments: Any) -> Any:
        """Have it do something; return its answer."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps(
            {'action': action, 'timeout': DEADLINE, **arguments}) + '\n')
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise AssertionError('the client has ended')
        answer = json.loads(line)
        if 'failure' in answer:
            raise AssertionError(f'{action} {arguments}: {answer["failure"]}')
        return answer['result']


def wait_for(condition: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + DEADLINE
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(f'waited {DEADLINE:g} s for {what}')
        time.sleep(0.05)


def story(bridge: Place, other: Place, folder: Path) -> None:
    """Move a conveyor from the other side, look at it, write to it, and stop it."""
    link = folder / 'links' / 'main'
    file = folder / 'bridge.yaml'
    buses = {'main': {**plant.SLCAN, 'channel': str(link), 'bitrate': 125_000}}
    file.write_text(plant.text({'conveyor': CONVEYOR}, diagnostics_period=0.5, buses=buses),
                    encoding='utf-8')
    bridge.run('simulator', '-m', 'drive_can_bridge.cli.start', 'simulate', '--params-file',
               str(file), '--pty-link', str(link.parent))
    wait_for(link.is_symlink, 'the simulated drive')
    bridge.run('bridge', '-m', 'drive_can_bridge.ros.start', '--ros-args', '-r', '__ns:=/both',
               '--params-file', str(file))
    client = Client(other)
    # topics to the client, services both ways, commands to the bridge
    client.ask('latched', topic=f'{DRIVE}/online', wanted=True)
    found, = client.ask('get', drive=DRIVE, names=['ramp_time'])
    (written, reason), = client.ask('set', drive=DRIVE, values={'ramp_time': 2.0})
    assert written, reason
    assert client.ask('get', drive=DRIVE, names=['ramp_time']) == [2.0], found
    for value in 0.0, 50.0:
        client.ask('publish', topic=f'{DRIVE}/command/speed_setpoint', value=value, rate=50.0)
        client.ask('value', topic=f'{DRIVE}/actual_speed', kind='Float64',
                   low=value - 2.0, high=value + 2.0)
    facts = client.ask('diagnostics', name='both/drive_can_bridge: drive conveyor',
                       conditions={'state': '^online$'})
    assert facts['commands_refused'] == '0', facts
    # and the commands of this package, which go through ROS
    said = other.drive_can('read', 'conveyor', 'ramp_time')
    assert '2' in said, said
    monitor = other.run('monitor', '-m', 'drive_can_bridge.cli.start', 'monitor')
    wait_for(lambda: 'actual_speed=' in other.said('monitor') or monitor.poll() is not None,
             'a line of the monitor')
    assert 'actual_speed=' in other.said('monitor'), other.said('monitor')
    other.drive_can('stop', 'conveyor')
    client.ask('value', topic=f'{DRIVE}/actual_speed', kind='Float64', low=-2.0, high=2.0)
    assert 'Traceback' not in bridge.said('bridge') + other.said('monitor')


def main() -> int:
    # whoever ends us gets everything ended
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    if os.environ.get('ROS_DISTRO'):
        print('ROS 2 is sourced: what one distribution sets is in the way of the other')
        return 77
    parser = argparse.ArgumentParser(description='see the top of this file')
    parser.add_argument('pythons', nargs=2, metavar='PYTHON')
    parser.add_argument('--only', default='', help='of ways: that have this in their name')
    options = parser.parse_args()
    names = [subprocess.run(
        [python, '-c', 'from importlib.metadata import version; print(version("ros-rclpy"))'],
        env={name: value for name, value in os.environ.items() if name not in INHERITED},
        capture_output=True, text=True, check=True).stdout.strip() for python in options.pythons]
    failed = 0
    try:
        with two_hosts() as hosts, tempfile.TemporaryDirectory() as top:
            for way, (transports, apart) in WAYS.items():
                if options.only not in way:
                    continue
                for place, python in enumerate(options.pythons):
                    title = f'{way}, bridge with rclpy {names[place]}, clients {names[1 - place]}'
                    folder = Path(top, f'{way}_{place}'.replace(' ', '_'))
                    bridge = Place(python, hosts[0], folder / 'bridge', transports)
                    other = Place(options.pythons[1 - place], hosts[apart], folder / 'client',
                                  transports)
                    begun = time.monotonic()
                    try:
                        story(bridge, other, folder)
                    except (AssertionError, subprocess.TimeoutExpired) as error:
                        failed += 1
                        print(f'FAILED: {title}: {error}\n{bridge.dump()}\n{other.dump()}')
                    else:
                        print(f'{title}: they talk ({time.monotonic() - begun:.0f} s)')
                    finally:
                        other.end()
                        bridge.end()
                    sys.stdout.flush()
    except Missing as missing:
        print(missing)
        return 77
    return int(failed > 0)


if __name__ == '__main__':
    sys.exit(main())
