# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What is measured. Each scenario runs the bridge and its floor one after the other, or at once.

All return plain numbers: times in s, CPU time in s, memory in MB; lists are samples.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, ExitStack, nullcontext
from dataclasses import dataclass, replace
import math
import os
from pathlib import Path
import signal
import statistics
import subprocess
import sys
from tempfile import TemporaryDirectory
import time
from typing import Any

from child import child, HERE, PATIENCE
import native
from unix_bus import INTERFACE
from viewer import Viewer

#: s until discovery and the first publishes are over
SETTLE = 2.0
#: the program that a user types
DRIVE_CAN = (sys.executable, '-m', 'drive_can_bridge.cli.start')
#: the Python of the bridge that is measured, where nothing else is said
BUILD = sys.executable
#: drives that a bus of 1 Mbit/s has room for every 10 ms
FULL = 30
#: a user whom no bridge trusts
NOBODY = 65534
#: a process that computes, until who started it has ended
COMPUTES = 'import os; own = os.getppid()\nwhile os.getppid() == own: pass'
REQUESTS = 'speed_setpoint, torque_limit, position_setpoint, digital_outputs'
#: messages after which a reader knows what they look like
JOINTS_KNOWN = 20
#: number of the first setting
SETTINGS_AT = 1000
#: bit/s, and s that a drive takes to answer, for a backup
SLOW = (125_000.0, 0.001)
RESPONSES = 'actual_speed, motor_current, actual_position, digital_inputs'

#: bare loops in Python and in C: how their topics begin, and what runs them
FLOORS = {'floor': 'floor.py', 'c_floor': 'native.py'}

#: keys of an axis: what flows is RPDO, SYNC and TPDO
SERVO = ('        protocol: cia402', '        mode: csp', '        mapping: assume',
         '        heartbeat_producer: 0.0', '        heartbeat_timeout: 0.0',
         '        bridge_heartbeat: 0.0')


@dataclass(frozen=True)
class Load:
    """
    What the bridge has to do.

    :param subscribed: every topic has a subscriber in another process.
    :param commands: setpoints per second and drive.
    :param real_time: the exchange may have the priority that it asks for.
    :param trace: s that the flight recorder keeps; 0: it is off.
    :param control: the drives have a control word.
    :param stuck: nobody reads the bridge's standard error.
    :param buses: among which the drives are shared out.
    :param settings: parameters of each drive that a backup has, none beside another.
    :param servo: the drives are axes of CiA 402 in csp.
    :param tuned: behind a gateway, with or without ``tcp_tune``; None: on a bus of their own.
    :param joints: Hz of the message with all joints; 0: there is none; None: drives have no joint.
    :param cores: on which its processes run; None: on all.
    """

    drives: int
    period: float
    subscribed: bool = True
    commands: float = 0.0
    real_time: bool = True
    trace: float = 0.0
    control: bool = False
    stuck: bool = False
    buses: int = 1
    settings: int = 0
    servo: bool = False
    tuned: bool | None = None
    joints: float | None = None
    cores: frozenset[int] | None = None

    @property
    def how(self) -> tuple[str, ...]:
        """What the process of the bridge is told."""
        return (*(() if self.real_time else ('ordinary',)), *(('stuck',) if self.stuck else ()))


class Bus:
    """
    The drives of one bus, or of several, and the parameter file of a bridge for them.

    :param pace: bit rate, and s that a drive takes for an answer; none: everything at once.
    """

    def __init__(self, stack: ExitStack, load: Load, *pace: float) -> None:
        self._folder = Path(stack.enter_context(TemporaryDirectory()))
        self._load = load
        self.buses = [f'bus{number}' for number in range(load.buses)]
        self.channel = self._folder / self.buses[0]
        self.drives = [stack.enter_context(child(
            'axes.py' if load.servo else 'drives.py', self._folder / bus, *pace))
                       for bus in self.buses]
        #: where the gateway of each bus listens
        self.ports = {} if load.tuned is None else {bus: stack.enter_context(child(
            'gateway.py', self._folder / bus)).ready for bus in self.buses}
        self.file = self.file_of(self.buses, 'drive_can_bridge')

    def file_of(self, buses: Sequence[str], name: str) -> Path:
        """Write a parameter file for these buses and a bridge of this name."""
        load = self._load
        lines = [f'/**/{name}:', '  ros__parameters:', '    buses:']
        for bus in buses:
            lines += [f'      {bus}:', *self._place(bus), '        bitrate: 1000000',
                      f'        trace_seconds: {load.trace}',
                      f'        trace_directory: {self._folder}']
        lines += [f'    joint_state_rate: {load.joints or 0.0}', '    drives:']
        profile, requests, responses = HERE / 'profile.yaml', REQUESTS, RESPONSES
        if load.control:
            profile = HERE / 'profile_control.yaml'
            requests = requests.replace('digital_outputs', 'control_word')
            responses = responses.replace('digital_inputs', 'status_word')
        if load.servo:
            profile, requests = HERE / 'profile_axis.yaml', 'target_position'
            responses = 'actual_position, actual_torque'
        if load.settings:
            profile = self._folder / 'profile.yaml'
            profile.write_text((HERE / 'profile.yaml').read_text() + ''.join(
                f'  setting_{place}: {{number: {SETTINGS_AT + 2 * place}, type: uint16, '
                f'access: rw}}\n' for place in range(load.settings)), encoding='utf-8')
        for number in range(load.drives):
            bus = self.buses[number % load.buses]
            if bus not in buses:
                continue
            lines += [f'      drive{number}:', f'        bus: {bus}',
                      f'        station: {number // load.buses + 1}',
                      *(SERVO if load.servo else (
                          '        protocol: datamodel_extended', '        rearm: immediate')),
                      f'        profile: {profile}',
                      f'        period: {load.period}', f'        cyclic_request: [{requests}]',
                      f'        cyclic_response: [{responses}]']
            if load.joints is not None:
                lines += [f'        joint: {{name: joint{number}, position: actual_position, '
                          'velocity: actual_speed, effort: motor_current, '
                          'velocity_command: speed_setpoint}']
        file = self._folder / f'{name}.yaml'
        file.write_text('\n'.join(lines) + '\n', encoding='utf-8')
        return file

    def _place(self, bus: str) -> tuple[str, ...]:
        """Return where a bus is: its keys."""
        if bus not in self.ports:
            return (f'        interface: {INTERFACE}', f'        channel: {self._folder / bus}')
        return ('        interface: socketcand', '        channel: can0',
                '        host: 127.0.0.1', f'        port: {self.ports[bus]}',
                f'        tcp_tune: {str(self._load.tuned).lower()}')

    def files_each(self) -> list[tuple[object, ...]]:
        """Return the arguments of a bridge for each bus, as ``bridge_per_bus.launch.py`` does."""
        names = [f'drive_can_bridge_{bus}' for bus in self.buses]
        return [(self.file_of([bus], name), '-r', f'__node:={name}')
                for bus, name in zip(self.buses, names)]


class Bridges:
    """
    The processes of one bridge, or of several, that share out the drives; seen from outside.

    What the drives notice, what diagnostics say, and CPU time.
    """

    def __init__(self, stack: ExitStack, load: Load, bus: Bus, *each: tuple[object, ...],
                 python: str = '') -> None:
        self._bus, self._load = bus, load
        self._diagnostics = stack.enter_context(child('subscriber.py', 'diagnostics'))
        with kept_to(load.cores):
            self.processes = [stack.enter_context(child(
                'bridge.py', *load.how, *arguments, python=python or BUILD))
                              for arguments in each or [(bus.file,)]]
        begun = min(process.ready for process in self.processes)
        until = begun + PATIENCE
        while True:
            asked = [at for drives in bus.drives for at in drives.ask('first')]
            if len(asked) == load.drives:
                break
            if time.monotonic() > until:
                raise SystemExit(f'{len(asked)} of {load.drives} drives came online')
            time.sleep(0.02)
        #: s until every drive had its first cyclic frame
        self.ready = max(asked) - begun
        self.clear()

    def clear(self) -> None:
        """Begin a measurement."""
        self._totals = self._diagnostics.ask(f'totals {self._load.drives}')
        for drives in self._bus.drives:
            drives.ask('clear')
        self._before = time.monotonic(), self.cpu(), self._threads()

    def result(self) -> dict[str, Any]:
        """Return what happened since."""
        at, cpu, threads = self._before
        now, threads_now = time.monotonic(), self._threads()
        found = {'elapsed': now - at, 'process_cpu': self.cpu() - cpu,
                 'cpu': {name: threads_now[name] - threads[name] for name in threads}}
        distances = [each for drives in self._bus.drives for each in drives.ask('distances')]
        totals = self._diagnostics.ask(f'totals {self._load.drives}')
        return {**found, 'exchanges': len(distances) + self._load.drives,
                'period_errors': [abs(each - self._load.period) for each in distances],
                'missed': totals['missed'] - self._totals['missed'],
                'latency': totals['latency']}

    def cpu(self) -> float:
        """Return the CPU time of all processes in s."""
        return sum(process.cpu() for process in self.processes)

    def resident_mb(self) -> float:
        """Return their resident memory in MB."""
        return sum(process.resident_mb() for process in self.processes)

    def _threads(self) -> dict[str, float]:
        each = [process.ask('cpu') for process in self.processes]
        return {name: sum(one[name] for one in each) for name in each[0]}


@contextmanager
def kept_to(cores: Iterable[int] | None) -> Iterator[None]:
    """Keep what is started meanwhile to these cores; None: as it is."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, before if cores is None else cores)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


@contextmanager
def bridge_under(load: Load, bus: Bus, *each: tuple[object, ...],
                 python: str = '') -> Iterator[Bridges]:
    """Run the bridge, and whoever commands it."""
    with ExitStack() as stack:
        bridges = Bridges(stack, load, bus, *each, python=python)
        if load.commands:
            stack.enter_context(child('publisher.py', 'commands', load.drives, load.commands))
        time.sleep(SETTLE)
        yield bridges


def subscribers(stack: ExitStack, load: Load) -> None:
    """Let another process subscribe to everything, if so wanted."""
    if load.subscribed:
        stack.enter_context(child(
            'subscriber.py', 'all', ','.join(('drive', *FLOORS)), load.drives))


def exchange(load: Load, duration: float, *, floor: bool = True) -> dict[str, Any]:
    """
    Measure CPU time and regularity of the exchange beside bare loops and a sleeping thread.

    Half of the loops run before the bridge and half behind it: the machine's speed drifts.
    """
    found: dict[str, Any] = {}
    with ExitStack() as stack:
        bus = Bus(stack, load)
        subscribers(stack, load)
        if floor:
            _run_floors(found, load, bus, 0.5 * duration)
        with bridge_under(load, bus) as bridge, child('sleeper.py', load.period) as sleeper:
            sleeper.ask('clear')
            bridge.clear()
            time.sleep(duration)
            found['bridge'] = bridge.result()
            found['wanted'] = load.drives / load.period
            found['sleeper'] = sleeper.ask('errors')
            found['resident_mb'] = bridge.resident_mb()
        if floor:
            _run_floors(found, load, bus, 0.5 * duration)
    return found


def _run_floors(found: dict[str, Any], load: Load, bus: Bus, duration: float) -> None:
    """Let the bare loops run one after the other, and add up what they found."""
    with TemporaryDirectory() as folder:
        for name, script in FLOORS.items():
            try:
                words = [native.build(Path(folder))] if script == 'native.py' else []
            except native.NotBuilt as error:
                print(f'no floor in C: {error}', file=sys.stderr)
                continue
            with ExitStack() as stack:
                loop = stack.enter_context(child(
                    script, *words, name, bus.channel, load.drives, load.period,
                    int(load.commands > 0.0)))
                if load.commands:
                    stack.enter_context(child(
                        'publisher.py', 'commands', load.drives, load.commands, name))
                loop.ask(f'run {SETTLE}')
                result, before = loop.ask(f'run {duration}'), found.get(name)
                found[name] = {key: value + before[key] for key, value in result.items()
                               } if before else result


def axes(load: Load, duration: float) -> dict[str, Any]:
    """Measure axes of CiA 402, each of them two frames and all one SYNC, beside 29-bit drives."""
    return {name: exchange(replace(load, servo=servo), duration, floor=False)['bridge']
            for name, servo in (('axes', True), ('drives', False))}


def buses(load: Load, duration: float) -> dict[str, Any]:
    """Measure full buses: all of them by one process, and by one process each."""
    found: dict[str, Any] = {}
    for name in ('one process', 'one process a bus'):
        found[name] = _full(load, duration, apart=name != 'one process')
    return found


def _full(load: Load, duration: float, *, apart: bool) -> dict[str, Any]:
    """Measure what is subscribed to, by one process or by one for each bus."""
    with ExitStack() as stack:
        bus = Bus(stack, load)
        subscribers(stack, load)
        bridges = stack.enter_context(bridge_under(load, bus, *bus.files_each() if apart else ()))
        bridges.clear()
        time.sleep(duration)
        result = bridges.result()
    return {'exchanges_per_s': result['exchanges'] / result['elapsed'],
            'missed': result['missed'], 'cpu': result['process_cpu'] / result['elapsed'],
            'period_errors': result['period_errors'], 'wanted': load.drives / load.period}


def latency(load: Load, duration: float) -> dict[str, list[float]]:
    """Measure from stamp to callback, of the bridge under load and of a bare pair at once."""
    with ExitStack() as stack:
        bus = Bus(stack, load)
        subscribers(stack, load)
        with (bridge_under(load, bus), child('publisher.py', 'bare', load.period),
              child('subscriber.py', 'listen', 'drive0', 'bare') as listener):
            time.sleep(SETTLE)
            listener.ask('clear')
            time.sleep(duration)
            found: dict[str, list[float]] = listener.ask('latencies')
    return found


def service(load: Load, calls: int) -> dict[str, Any]:
    """Measure parameter service calls beside those of a bare service, and exchanges."""
    with ExitStack() as stack:
        bus = Bus(stack, load)
        with (bridge_under(load, bus) as bridge, child('bare_nodes.py', 1),
              child('caller.py', load.drives) as caller):
            caller.ask('ping 20')
            found: dict[str, Any] = caller.ask(f'ping {calls}')
            found['exchange'] = bridge.result()['latency']
    return found


def flood(load: Load, duration: float, commands: float,
          python: str = '') -> dict[str, Any]:
    """Measure the period of one bridge in quiet and in a flood of services and commands."""
    found: dict[str, Any] = {}
    with ExitStack() as stack:
        bus = Bus(stack, load)
        with (bridge_under(load, bus, python=python) as bridge,
              child('sleeper.py', load.period) as sleeper,
              child('caller.py', load.drives) as caller):
            for name in ('quiet', 'flood'):
                if name == 'flood':
                    stack.enter_context(
                        child('publisher.py', 'commands', load.drives, commands / load.drives))
                    caller.ask('flood 4')
                    time.sleep(SETTLE)
                bridge.clear()
                sleeper.ask('clear')
                time.sleep(duration)
                result = bridge.result()
                found[name] = {'period_errors': result['period_errors'],
                               'missed': result['missed'], 'exchanges': result['exchanges'],
                               'sleeper': sleeper.ask('errors')}
            found['calls'] = caller.ask('calm')
    return found


def monitor(load: Load, duration: float, rounds: int = 4) -> dict[str, Any]:
    """Measure the period of one bridge with and without a monitor, in turn, and the monitor."""
    found: dict[str, Any] = {name: {'period_errors': [], 'missed': 0, 'cpu': 0.0, 'elapsed': 0.0}
                             for name in ('without', 'with')}
    found['monitor'] = []
    with ExitStack() as outer:
        bus = Bus(outer, load)
        subscribers(outer, load)
        with bridge_under(load, bus) as bridge:
            for number in range(2 * rounds):
                with ExitStack() as stack:
                    name = 'with' if number % 2 else 'without'
                    watcher = stack.enter_context(closing(Viewer())) if number % 2 else None
                    time.sleep(2 * SETTLE)
                    bridge.clear()
                    begun = watcher.cpu() if watcher else 0.0
                    time.sleep(duration)
                    spent = watcher.cpu() - begun if watcher else 0.0
                    result = bridge.result()
                    if watcher:
                        found['monitor'].append(spent / result['elapsed'])
                    found[name]['period_errors'] += result['period_errors']
                    for key in ('missed', 'elapsed'):
                        found[name][key] += result[key]
                    found[name]['cpu'] += result['process_cpu']
    return found


def panel(load: Load, duration: float) -> dict[str, Any]:
    """Measure the panel while nobody looks, and with one page in one browser, of either kind."""
    from onlooker import Panel  # needs the extra "panel"
    found: dict[str, Any] = {}
    with ExitStack() as stack:
        bus = Bus(stack, load)
        stack.enter_context(bridge_under(load, bus))
        server = stack.enter_context(closing(Panel()))
        for name, page in (('nobody', None), ('overview', '/'), ('drive', '/drive/drive0')):
            with server.open(page) if page else nullcontext() as opened:
                time.sleep(2 * SETTLE)
                begun, cpu = time.monotonic(), server.cpu()
                before = opened.messages if opened else 0
                time.sleep(2 * duration)
                elapsed = time.monotonic() - begun
                if opened and not opened.is_alive():
                    raise SystemExit(f'the panel has closed {page}')
                found[name] = {'cpu': (server.cpu() - cpu) / elapsed, 'mb': server.memory_mb(),
                               'messages': (opened.messages - before) / elapsed if opened else 0.0,
                               'live': opened.live if opened else 0.0}
    return found


def backup(load: Load, rounds: int = 5) -> dict[str, Any]:
    """Measure backups on a slow bus beside its frames and answers, and what a bridge misses."""
    found: dict[str, Any] = {'backups': [], 'through': []}
    with ExitStack() as stack:
        bus = Bus(stack, replace(load, drives=1), *SLOW)
        with child('backup_client.py', bus.file) as client:
            for _ in range(rounds):
                bus.drives[0].ask('clear')
                each = client.ask('backup')
                found['backups'].append({**each, 'spent': bus.drives[0].ask('spent')})
    with ExitStack() as stack:
        bus = Bus(stack, load)
        with (bridge_under(load, bus) as bridge,
              child('backup_client.py') as client):
            for name in ('quiet', 'during'):
                bridge.clear()
                end = time.monotonic() + 2 * SETTLE
                while time.monotonic() < end:
                    if name == 'during':
                        found['through'].append(client.ask('backup'))
                    else:
                        time.sleep(SETTLE)
                found[name] = bridge.result()
    return found


def stop(load: Load, calls: int, commands: float, under_way: int,
         python: str = '') -> dict[str, Any]:
    """Measure from the call of a stop to its frame at the drive, in quiet and under load."""
    found: dict[str, Any] = {}
    with ExitStack() as stack:
        bus = Bus(stack, load)
        with (bridge_under(load, bus, python=python) as bridge, child('stopper.py') as stopper,
              child('caller.py', load.drives) as caller,
              child('sleeper.py', load.period) as sleeper):
            for name in ('quiet', 'load'):
                if name == 'load':
                    stack.enter_context(
                        child('publisher.py', 'commands', load.drives, commands / load.drives))
                    caller.ask(f'pester {under_way}')
                    time.sleep(SETTLE)
                sleeper.ask('clear')
                bridge.clear()
                answer = stopper.ask(f'stop {calls}')
                stops = bus.drives[0].ask('stops')
                result = bridge.result()
                found[name] = {
                    'missed': result['missed'], 'exchanges': result['exchanges'],
                    'latencies': [min((at - called for at in stops if at > called),
                                      default=float('inf')) for called in answer['called']],
                    'failures': answer['failures'], 'sleeper': sleeper.ask('errors')}
            found['calls'] = caller.ask('calm')
    return found


def gateway(load: Load, duration: float, calls: int) -> dict[str, Any]:
    """Measure an axis behind a gateway, with and without ``tcp_tune``, and its stops with it."""
    found: dict[str, Any] = {}
    for name, tuned in (('tuned', True), ('not tuned', False)):
        with ExitStack() as stack:
            each = replace(load, tuned=tuned)
            bus = Bus(stack, each)
            with bridge_under(each, bus) as bridge:
                time.sleep(duration)
                result = bridge.result()
                found[name] = {key: result[key] for key in (
                    'exchanges', 'missed', 'period_errors')}
                if tuned:
                    with child('stopper.py') as stopper:
                        bus.drives[0].ask('clear')
                        answer = stopper.ask(f'stop {calls}')
                        stops = bus.drives[0].ask('stops')
                    found['stops'] = [min((at - called for at in stops if at > called),
                                          default=math.inf) for called in answer['called']]
                    found['failures'] = answer['failures']
    return found


def by_hand(load: Load, rounds: int, other: str = '') -> dict[str, Any]:
    """
    Measure commands that a person types, from Enter, beside a client that calls one service.

    :param other: the Python of another build, whose commands are measured as well; '': none.
    """
    bare = [sys.executable, str(HERE / 'bare_client.py')]
    who = {'ours': DRIVE_CAN, **({'other': (other, *DRIVE_CAN[1:])} if other else {})}
    names = 'stop', 'stop done', 'read', 'write'
    found: dict[str, Any] = {}
    with ExitStack() as stack:
        bus = Bus(stack, load)
        typed = Typed(stack)
        with bridge_under(load, bus), child('stopper.py') as stopper:
            for number in range(rounds + 1):
                if number < 2:      # with the first ones modules are compiled
                    found.update({name: {each: [] for each in (*who, 'bare')} for name in names},
                                 floor=[], failed=0)
                value = str(1.0 + number / 100)
                turn = [(name, [[*command, 'stop'], [*command, 'read', 'drive0', 'ramp_time'],
                                [*command, 'write', 'drive0', f'ramp_time={value}']])
                        for name, command in who.items()]
                turn.append(('bare', [[*bare, 'stop'], [*bare, 'read'], [*bare, 'write', value]]))
                for each, commands in turn[::1 - 2 * (number % 2)]:
                    if not stopper.ask('enable'):
                        raise SystemExit('the drive was not enabled')
                    bus.drives[0].ask('clear')
                    if each == 'bare':   # as much Python as nobody does without
                        begun = time.monotonic()
                        typed([sys.executable, '-c', 'import socket'])
                        found['floor'].append(time.monotonic() - begun)
                    for name, command in zip(('stop', 'read', 'write'), commands):
                        begun = time.monotonic()
                        code, _ = typed(command)
                        elapsed = time.monotonic() - begun
                        found['failed'] += each == 'ours' and code != 0
                        if name == 'stop':
                            found['stop done'][each].append(elapsed)
                            elapsed = min(bus.drives[0].ask('stops'), default=math.inf) - begun
                        found[name][each].append(elapsed)
    return found


class Typed:
    """
    Runs commands as a shell does, nowhere near these sources.

    Python keeps what it has compiled, as it does with what is installed, whatever the environment
    of the bench says: else each command would compile all of its modules.
    """

    def __init__(self, stack: ExitStack) -> None:
        self._environment = {**os.environ, 'PYTHONPYCACHEPREFIX': stack.enter_context(
            TemporaryDirectory())}
        self._environment.pop('PYTHONDONTWRITEBYTECODE', None)

    def __call__(self, command: Sequence[str]) -> tuple[int, str]:
        """Run one; return its exit code, and what it has said."""
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                              check=False, cwd='/', env=self._environment)
        return done.returncode, done.stdout


def one_hangs(load: Load, rounds: int) -> dict[str, Any]:
    """Measure a stop where one of two bridges is suspended: the other's drives, and the end."""
    found: dict[str, Any] = {'stop': [], 'done': [], 'named': 0}
    with ExitStack() as stack:
        bus = Bus(stack, replace(load, drives=2 * load.drives, buses=2))
        typed = Typed(stack)
        with (bridge_under(replace(load, drives=2 * load.drives, buses=2), bus,
                           *bus.files_each()) as bridges, child('stopper.py') as stopper):
            hung = bridges.processes[1].process
            for number in range(rounds + 1):
                if number < 2:      # with the first one modules are compiled
                    found = {'stop': [], 'done': [], 'named': 0}
                if not stopper.ask('enable'):
                    raise SystemExit('the drive was not enabled')
                bus.drives[0].ask('clear')
                hung.send_signal(signal.SIGSTOP)
                try:
                    time.sleep(0.1)
                    begun = time.monotonic()
                    _, told = typed([*DRIVE_CAN, 'stop'])
                    found['done'].append(time.monotonic() - begun)
                finally:
                    hung.send_signal(signal.SIGCONT)
                found['stop'].append(min(bus.drives[0].ask('stops'), default=math.inf) - begun)
                found['named'] += 'drive_can_bridge_bus1: NOT STOPPED' in told
                time.sleep(SETTLE)
    return found


def busy_hand(load: Load, commands: int, loops: int) -> dict[str, Any]:
    """Measure stops that a person types at low priority, beside so many processes that compute."""
    found: dict[str, Any] = {'done': [], 'failed': 0, 'loops': loops}
    with ExitStack() as stack:
        bus = Bus(stack, load)
        typed = Typed(stack)
        stack.enter_context(bridge_under(load, bus))
        typed([*DRIVE_CAN, 'stop'])     # compiles modules
        for _ in range(loops):
            loop = subprocess.Popen(    # in another terminal
                [sys.executable, '-c', COMPUTES], start_new_session=True)
            stack.callback(loop.wait)
            stack.callback(loop.kill)
        for _ in range(commands):
            begun = time.monotonic()
            code, _ = typed(['nice', '-n', '10', *DRIVE_CAN, 'stop'])
            found['done'].append(time.monotonic() - begun)
            found['failed'] += code != 0
    return found


def attacked_hand(load: Load, duration: float, rounds: int) -> dict[str, Any]:
    """
    Measure the exchange while others do harm by the local way, and stops that a person types.

    Without harm the same processes compute: in turn, so that the machine is the same.
    """
    found: dict[str, Any] = {kind: {'period_errors': [], 'missed': 0, 'exchanges': 0, 'stops': [],
                                    'failed': 0, 'said': 0, 'answered': 0}
                             for kind in ('calm', 'talk', 'call')}
    with ExitStack() as stack:
        bus = Bus(stack, load)
        typed = Typed(stack)
        with (bridge_under(load, bus) as bridge, child('attacker.py') as ours,
              child('attacker.py', NOBODY) as strange):
            typed([*DRIVE_CAN, 'stop'])     # compiles modules
            for number in range(3 * rounds):
                kind = list(found)[number % 3]
                each = found[kind]
                for attacker in (ours, strange):
                    attacker.ask(kind)
                bridge.clear()
                until = time.monotonic() + duration
                while time.monotonic() < until:
                    begun = time.monotonic()
                    code, _ = typed([*DRIVE_CAN, 'stop'])
                    each['stops'].append(time.monotonic() - begun)
                    each['failed'] += code != 0
                    time.sleep(0.2)
                result = bridge.result()
                each['period_errors'] += result['period_errors']
                each['missed'] += result['missed']
                each['exchanges'] += result['exchanges']
                for attacker in (ours, strange):
                    said, answered = attacker.ask('calm')
                    each['said'] += said
                    each['answered'] += answered
                time.sleep(1.0)
    return found


def do_it_yourself(load: Load, duration: float) -> dict[str, Any]:
    """Measure the bridge and the node that a user writes, from the outside."""
    found: dict[str, Any] = {}
    with ExitStack() as stack:
        bus = Bus(stack, load)
        subscribers(stack, load)
        for name, script, arguments in (
                ('diy', 'diy_node.py', (bus.channel, load.drives, load.period)),
                ('bridge', 'bridge.py', (*load.how, bus.file))):
            with child(script, *arguments) as process, ExitStack() as inner:
                if load.commands:
                    inner.enter_context(
                        child('publisher.py', 'commands', load.drives, load.commands))
                time.sleep(SETTLE)
                bus.drives[0].ask('clear')
                cpu, begun = process.cpu(), time.monotonic()
                time.sleep(duration)
                elapsed = time.monotonic() - begun
                distances = bus.drives[0].ask('distances')
                found[name] = {
                    'cpu': (process.cpu() - cpu) / elapsed,
                    'requests_per_s': len(distances) / elapsed,
                    'wanted': load.drives / load.period,
                    'period_errors': [abs(each - load.period) for each in distances]}
    return found


def most(load: Load, duration: float, first: int,
         fewer_than: float = math.inf) -> dict[str, Any]:
    """
    Find how many drives one core holds: one process for each full bus, none of it missed.

    All others have the other cores, if there are any. A number that is not held is tried twice.

    :param first: the number that is tried first.
    :return: the largest number that was held, and what was found of each that was tried.
    """
    *others, core = sorted(os.sched_getaffinity(0))
    found: dict[str, Any] = {'most': 0, 'tried': {}}
    with kept_to(others or [core]):
        too_many, number = fewer_than, first
        while too_many - found['most'] > 2:
            tried = found['tried'].setdefault(number, [])
            each = replace(load, drives=number, buses=math.ceil(number / FULL),
                           cores=frozenset([core]))
            try:
                tried.append(_full(each, duration, apart=True))
            except SystemExit as error:     # drives are offline, or nobody can say
                tried.append({'missed': math.inf, 'why': str(error)})
            if not tried[-1]['missed']:
                found['most'] = number
            elif len(tried) == 1:
                continue
            else:
                too_many = number
            number = int(1.5 * number if too_many == math.inf else 0.5 * (
                found['most'] + too_many))
    return found


def sweep(numbers: Sequence[int], period: float, duration: float) -> dict[int, dict[str, Any]]:
    """Measure the same for so many drives, all of them on one bus."""
    return {number: do_it_yourself(Load(number, period, commands=100.0), duration)
            for number in numbers}


def start(drives: int, duration: float) -> dict[str, Any]:
    """Measure the time to the first exchange of all drives, and memory, beside bare nodes."""
    load = Load(drives, 0.02)
    found: dict[str, Any] = {'drives': drives}
    with child('bare_nodes.py', drives) as bare:
        found['bare_nodes_s'] = bare.ready
        found['bare_nodes_mb'] = bare.resident_mb()
    with ExitStack() as stack:
        bus = Bus(stack, load)
        subscribers(stack, load)
        with bridge_under(load, bus) as bridge:
            found['first_exchange_s'] = bridge.ready
            found['resident_mb'] = [bridge.resident_mb()]
            for _ in range(4):
                time.sleep(duration / 4)
                found['resident_mb'].append(bridge.resident_mb())
    for number in (1, 2 * drives):
        with ExitStack() as stack:
            load = Load(number, 0.02)
            bus = Bus(stack, load)
            subscribers(stack, load)
            with bridge_under(load, bus) as bridge:
                found[f'resident_mb_{"one" if number == 1 else "twice"}'] = bridge.resident_mb()
    return found


def flight(load: Load, duration: float, rounds: int = 40) -> dict[str, Any]:
    """Measure what the flight recorder costs, and exchanges while a trace is written."""
    found: dict[str, Any] = {'share': _beside(load, replace(load, trace=0.0), duration / 10,
                                              rounds)[1]}
    with ExitStack() as stack:
        bus = Bus(stack, load)
        with bridge_under(load, bus) as bridge, child('caller.py', load.drives) as caller:
            for name in ('recording', 'writing'):
                time.sleep(duration)
                bridge.clear()
                if name == 'writing':   # the duration before is what is written
                    found['trace'] = caller.ask('trace')
                else:
                    time.sleep(duration)
                found[name] = bridge.result()
    return found


def joints(load: Load, duration: float, rate: float, rounds: int = 40) -> dict[str, Any]:
    """Measure what the message of all joints costs, and then commands for all joints as often."""
    load, without = replace(load, joints=rate), replace(load, joints=0.0)
    with ExitStack() as stack:
        listener = stack.enter_context(child('subscriber.py', 'joints'))
        commander = stack.enter_context(child('publisher.py', 'joints', load.drives))
        states, commands = _beside(load, without, duration / 10, rounds, lambda commanded: (
            listener.ask('clear'), commander.ask(f'rate {rate if commanded else 0.0}')))
        return {'states': states, 'states and commands': commands,
                'received': listener.ask('count')}


def joint_take(joints: int, rate: float, rounds: int, other: str = '') -> dict[str, Any]:
    """
    Measure what takes a message for all joints out of a topic, and reads it, each in µs.

    :param rate: Hz, of messages.
    :param other: the Python of another build, measured in turn with this one; '': none.
    """
    builds = {'ours': sys.executable, **({'other': other} if other else {})}
    found: dict[str, dict[str, list[float]]] = {name: {} for name in builds}
    with ExitStack() as stack:
        publisher = stack.enter_context(child('publisher.py', 'joints', joints))
        takers = {name: stack.enter_context(child('joint_take.py', python=python))
                  for name, python in builds.items()}
        publisher.ask(f'rate {rate}')
        for taker in takers.values():
            known, until = 0, time.monotonic() + PATIENCE
            while known < JOINTS_KNOWN:
                if time.monotonic() > until:
                    raise SystemExit('no command for joints has come')
                known += min(count for _, count in taker.ask('take 0.1').values())
        for number in range(rounds):
            for name in list(takers)[::1 - 2 * (number % 2)]:
                for what, (spent, count) in takers[name].ask('take 0.25').items():
                    found[name].setdefault(what, []).append(1e6 * spent / max(1, count))
    return found


def builds(drives: int, windows: int, duration: float, other: str) -> dict[str, Any]:
    """
    Measure this build and another at the same time, so that the machine is as fast for both.

    They change places half-way: discovery and scheduling favour one that was there first.

    :param windows: of a measurement in either place.
    :param other: its Python; '' is this build once more, which shows how far to believe a ratio.
    :return: by load, pairs of CPU shares of this build and of the other.
    """
    pythons = [BUILD, other or BUILD]
    quiet = Load(drives, 0.01, subscribed=False)
    found: dict[str, Any] = {}
    for name, load in (('nobody subscribed', quiet),
                       ('subscribed', replace(quiet, subscribed=True)),
                       ('subscribed, commands', replace(quiet, subscribed=True, commands=100.0)),
                       ('one drive', replace(quiet, drives=1))):
        found[name] = pairs = []
        for turned in (1, -1):
            with ExitStack() as stack:
                if load.subscribed:
                    stack.enter_context(child(
                        'subscriber.py', 'all', 'drive,beside/drive', load.drives))
                bridges = [stack.enter_context(bridge_under(
                    replace(load, commands=0.0), bus, (bus.file, *words), python=python))
                           for python, words in zip(
                               pythons[::turned], ((), ('-r', '__ns:=/beside')))
                           for bus in [Bus(stack, load)]]
                for prefix in ('drive', 'beside/drive') if load.commands else ():
                    stack.enter_context(child(
                        'publisher.py', 'commands', load.drives, load.commands, prefix))
                time.sleep(SETTLE)
                for _ in range(windows):
                    begun, spent = time.monotonic(), [bridge.cpu() for bridge in bridges]
                    time.sleep(duration)
                    elapsed = time.monotonic() - begun
                    shares = [(bridge.cpu() - cpu) / elapsed
                              for bridge, cpu in zip(bridges, spent)]
                    pairs.append(shares[::turned])
    return found


def in_turn(scenario: Callable[[str], Any], rounds: int, other: str) -> list[list[Any]]:
    """
    Measure a scenario of this build and of another in turn, the order reversed every other time.

    :param scenario: is called with the Python of a build.
    :param other: '' is this build once more, which shows how far to believe a difference.
    :return: what was found of this build, and of the other.
    """
    pythons = [BUILD, other or BUILD]
    found: list[list[Any]] = [[], []]
    for number in range(2 * rounds):
        place = number % 2 ^ number // 2 % 2
        found[place].append(scenario(pythons[place]))
    return found


def _beside(load: Load, without: Load, duration: float, rounds: int,
            before: Callable[[bool], object] = lambda _: None) -> list[list[tuple[float, float]]]:
    """
    Measure two bridges at the same time, so that the machine is as fast for the one as the other.

    :param before: is called before each measurement, with False and True in turn.
    :return: pairs of CPU shares of the bridge with this load and of that without, by ``before``.
    """
    found: list[list[tuple[float, float]]] = [[], []]
    with ExitStack() as stack:
        bridges = [stack.enter_context(bridge_under(each, bus, (bus.file, *words)))
                   for each, words in ((load, ()), (without, ('-r', '__ns:=/without')))
                   for bus in [Bus(stack, each)]]
        for number in range(2 * rounds):
            before(number % 2 == 1)
            time.sleep(0.1)
            begun, spent = time.monotonic(), [bridge.cpu() for bridge in bridges]
            time.sleep(duration)
            elapsed = time.monotonic() - begun
            one, other = ((bridge.cpu() - cpu) / elapsed for bridge, cpu in zip(bridges, spent))
            found[number % 2].append((one, other))
    return found


def decode(frames: int) -> dict[str, dict[str, float]]:
    """Measure ``drive_can decode`` of a long trace: time, and memory beside a short one."""
    found: dict[str, dict[str, float]] = {}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()))
        file = folder / 'bench.yaml'
        file.write_text('/**/drive_can_bridge: {ros__parameters: {buses: {main: {interface: '
                        'socketcan, channel: can0}}, drives: {drive0: {bus: main, protocol: '
                        f'datamodel_extended, station: 1, profile: {HERE / "profile.yaml"}, '
                        f'cyclic_request: [{REQUESTS}], cyclic_response: [{RESPONSES}]}}}}}}}}\n')
        for name, count in (('short', frames // 20), ('long', frames)):
            trace = folder / f'{name}.log'
            with trace.open('w') as stream:
                for cycle in range(count // 2):
                    begin, word = 1.7e9 + 0.02 * cycle, cycle % 3000
                    stream.write(f'({begin:.6f}) can0 003FFFF0#{word:04X}03E800000000 T\n'
                                 f'({begin + 0.001:.6f}) can0 103FFFF0#{word:04X}00C8000001F4 R\n')
            for what in ('lines', '--summary'):
                command = [*DRIVE_CAN, 'decode', str(trace),
                           '--params-file', str(file), *([] if what == 'lines' else [what])]
                begun = time.monotonic()
                with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
                    _, _, usage = os.wait4(process.pid, 0)
                found[f'{name} {what}'] = {
                    'frames': count, 'elapsed': time.monotonic() - begun,
                    'cpu': usage.ru_utime + usage.ru_stime, 'resident_mb': usage.ru_maxrss / 1024}
    return found


def p99(samples: list[float]) -> float:
    """Return the 99th percentile; NaN without samples."""
    ordered = sorted(samples)
    return ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))] if ordered else float('nan')


def median(samples: list[float]) -> float:
    """Return the median; NaN without samples."""
    return statistics.median(samples) if samples else float('nan')


def ratio(measured: float, floor: float) -> float:
    """Return a ratio; NaN where a floor took nothing that could be measured."""
    return measured / floor if floor else float('nan')
