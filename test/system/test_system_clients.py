# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Clients that want too much, nonsense, or nothing any more: the exchange does not mind."""

from collections.abc import Sequence
import json
from pathlib import Path
import signal
import sys

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Process, Processes, Simulator
import pytest
from test_system_reconnection import status_of

#: Who is killed with a lock of Fast DDS in his hands holds up whoever meets it, this bridge or the
#: next client: "Shared memory left behind", docs/troubleshooting.md.
WITHOUT_SHARED_MEMORY = ('env', 'FASTDDS_BUILTIN_TRANSPORTS=UDPv4')
#: MB by which the bridge may have grown after a flood, when it had seen one already
GROWTH = 12.0

pytestmark = pytest.mark.real


class Bench:
    """A bridge with a conveyor that moves, and clients that flood it."""

    def __init__(self, processes: Processes, client: Client, namespace: str,
                 directory: Path) -> None:
        self.processes = processes
        self.client = client
        self.drive = f'/{namespace}/conveyor'
        # a queue of requests that moves: each is answered long before the caller gives up
        file = bridge_file(directory, drives={'conveyor': {
            **CONVEYOR, 'command_timeout': 60.0, 'parameter_timeout': 1.0,
            # how regular the exchange stays is the bench's business; machines may be slow
            'missed_limit': 250}})
        self.simulator: Simulator = processes.simulator(file)
        self.bridge: Process = processes.bridge(file, namespace)
        client.online(self.drive)

    def flood(self, *arguments: str, before: Sequence[str] = ()) -> Process:
        """Start a client without manners, behind such words; it has begun."""
        script = Path(__file__).with_name('flood_client.py')
        started = self.processes.start([*before, sys.executable, str(script), *arguments], 'flood')
        started.line('^ready$')
        return started

    def result(self, flood: Process) -> dict[str, object]:
        """Wait for the end of a client; return what it says."""
        assert flood.wait() == 0
        result: dict[str, object] = json.loads(flood.lines[-1])
        return result

    def facts(self) -> dict[str, str]:
        """Return the next diagnostic status of the drive."""
        return self.client.diagnostics(status_of(self.drive))

    def megabytes(self) -> float:
        """Return the resident memory of the bridge."""
        status = Path(f'/proc/{self.bridge.pid}/status').read_text(encoding='ascii')
        line = next(line for line in status.splitlines() if line.startswith('VmRSS'))
        return int(line.split()[1]) / 1024.0

    def exchanges_go_on(self) -> None:
        """See ten more exchanges, without the drive having been lost."""
        before = int(self.facts()['exchanges'])
        self.client.diagnostics(status_of(self.drive))
        while int(self.facts()['exchanges']) < before + 10:
            pass
        assert not self.bridge.losses()


@pytest.fixture
def bench(processes: Processes, client: Client, namespace: str, tmp_path: Path) -> Bench:
    return Bench(processes, client, namespace, tmp_path)


def test_a_thousand_calls_from_another_process(bench: Bench) -> None:
    # twice: what the first makes grow (queues, buffers of the middleware) the second finds grown
    memory = []
    for _ in range(3):
        answer = bench.result(bench.flood('calls', bench.drive, '1000'))
        assert answer['answered'] == 1000
        assert answer['in_order']
        # one being served, and 64 behind it; the others are told that it is busy
        assert int(str(answer['served'])) >= 65
        assert int(str(answer['served'])) + int(str(answer['refused'])) == 1000
        assert len(list(answer['values'])) == 1  # type: ignore[call-overload]
        memory.append(bench.megabytes())
        bench.exchanges_go_on()
    assert memory[2] - memory[0] < GROWTH, memory
    if int(str(answer['refused'])):
        bench.bridge.error(r'conveyor: read ramp_time \(P30\): busy')
    assert bench.bridge.end() == 0


def test_callers_that_vanish(bench: Bench) -> None:
    memory = []
    for _ in range(4):
        # it is answered slowly, and is gone before
        bench.simulator.write('conveyor late=0.01')
        flood = bench.flood('calls', bench.drive, '1000', before=WITHOUT_SHARED_MEMORY)
        bench.simulator.frame('^002001E1', since=len(bench.simulator.frames()), count=3)
        assert flood.end(signal.SIGKILL) == -signal.SIGKILL
        bench.simulator.write('conveyor ok')
        # others are served as soon as those before them are through, or told to come again
        while bench.client.get(bench.drive, 'ramp_time') == [None]:
            pass
        memory.append(bench.megabytes())
    bench.exchanges_go_on()
    assert memory[3] - memory[1] < GROWTH, memory
    assert bench.bridge.end() == 0
    assert not [line for line in bench.bridge.errors if '[ERROR]' in line]


def test_flood_of_commands_and_requests(bench: Bench) -> None:
    client, drive = bench.client, bench.drive
    client.publish(f'{drive}/command/speed_setpoint', 0.0)
    client.diagnostics(status_of(drive), state='^online$')
    client.silence(f'{drive}/command/speed_setpoint')
    before = bench.facts()
    memory = []
    for _ in range(2):
        commands = bench.flood('commands', f'{drive}/command/speed_setpoint', '4')
        calls = bench.flood('calls', drive, '1000')
        assert client.get(drive, 'maximum_speed') is not None
        assert bench.result(calls)['answered'] == 1000
        assert int(str(bench.result(commands)['published'])) > 0
        # whatever the flood left, too late or armed: who comes then has the drive
        client.publish(f'{drive}/command/speed_setpoint', 0.0)
        client.diagnostics(status_of(drive), state='^online$')
        client.publish(f'{drive}/command/speed_setpoint', 125.0)
        client.value(f'{drive}/actual_speed', 124.0, 126.0)
        client.silence(f'{drive}/command/speed_setpoint')
        memory.append(bench.megabytes())
    after = bench.facts()
    assert after['state'] == 'online'
    assert int(after['exchanges']) > int(before['exchanges']) + 20
    # none but those that came too late for a bridge that had all this to do, which was said
    assert after['commands_refused'] == '0' or any(
        'thrown away' in line for line in bench.bridge.errors)
    assert memory[1] - memory[0] < GROWTH, memory
    # each cyclic frame carried a setpoint that was really sent: whole rpm, 0 to 99, or 125
    cyclic = {frame[9:13] for frame in bench.simulator.frames('^003FFFF0.* R$')}
    assert {int(word, 16) for word in cyclic} <= {*range(0, 1000, 10), 1250}
    assert bench.bridge.end() == 0
