# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What ``processes.py`` and ``slcan_peer.py`` have, on the bench (``clocked/``): no process, no wait.

The bridge is what its executable runs, with a watcher that is handed its signals; the client is
the script ``ros_client.py``. A second signal, which ends a process, nobody can send here.
"""

from collections import deque
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
import io
from pathlib import Path
import signal
from typing import Any

from processes import Client, Told, Witness
import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions
import ros_client
from slcan_peer import answer_to, Answers, Line
from waiting import DEADLINE, wait_for
from world import World

from drive_can_bridge.cli.main import main
from drive_can_bridge.cli.simulate import Console
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.process.signals import SignalWatcher
from drive_can_bridge.ros import main as executable
from drive_can_bridge.simulation.simulation import Simulation

RUNNING = -1


class BenchBridge(Told):
    """What the executable runs, in a thread of the bench."""

    name = 'bridge'

    def __init__(self, world: World, arguments: list[str]) -> None:
        self._graph = world.graph
        self._begun = len(self._graph.written)
        self._code = RUNNING
        self._watcher = SignalWatcher(world.clock)
        self._thread = world.clock.worker(
            partial(self._run, world, ['drive_can_bridge', *arguments]), self.name)
        self._thread.start()

    def _run(self, world: World, arguments: list[str]) -> None:
        self._code = self._watcher.exit_code(
            executable.run(self._watcher, world.clock, arguments))

    @property
    def running(self) -> bool:
        return self._code == RUNNING

    @property
    def lines(self) -> list[str]:
        return []

    @property
    def errors(self) -> list[str]:
        return list(self._graph.written[self._begun:])

    def send(self, number: int) -> None:
        """Send the first signal."""
        self._watcher.take(number)

    def wait(self) -> int:
        """Wait for the end; return the exit code."""
        wait_for(lambda: not self.running, 'the end of the bridge')
        return self._code

    def end(self, number: int = signal.SIGTERM) -> int:
        """Send a signal and wait for the end; return the exit code."""
        self.send(number)
        return self.wait()


class BenchSimulator(Told, Witness):
    """What ``drive_can simulate --log-frames`` plays; its standard input is a call."""

    name = 'simulate'
    running = True

    def __init__(self, world: World, file: Path) -> None:
        self._said: list[str] = []
        self._frames: list[str] = []
        self._complaints: list[str] = []
        self.simulation = Simulation(
            configuration_from_file(file), world.clock, say=self._said.append,
            complain=self._complaints.append, show_frame=self._see)
        self._console = Console(self.simulation, say=self._said.append,
                                complain=self._complaints.append)

    def _see(self, _: str, frame: Frame, sent: bool) -> None:
        self._frames.append(f'{frame} {"T" if sent else "R"}')

    @property
    def lines(self) -> list[str]:
        return list(self._said)

    @property
    def errors(self) -> list[str]:
        return list(self._complaints)

    def frames(self, pattern: str = '', since: int = 0) -> list[str]:
        return [frame for frame in self._frames[since:] if self.matches(pattern, frame)]

    def write(self, text: str) -> None:
        """Have it obey a line."""
        self._console.obey(text)
        assert not self._complaints

    def end(self) -> int:
        """End; return what the process would: it broke no rule."""
        self.simulation.stop()
        return int(bool(self.simulation.failure))


class BenchCommand(Told):
    """``drive_can``, run to its end by whoever starts it."""

    running = False

    def __init__(self, arguments: tuple[str, ...]) -> None:
        self.name = arguments[0]
        self._out, self._err = io.StringIO(), io.StringIO()
        with redirect_stdout(self._out), redirect_stderr(self._err):
            self._code = main(arguments)

    @property
    def lines(self) -> list[str]:
        return self._out.getvalue().splitlines()

    @property
    def errors(self) -> list[str]:
        return self._err.getvalue().splitlines()

    def wait(self) -> int:
        """Return the exit code."""
        return self._code

    def dump(self) -> str:
        """Return both outputs."""
        return self._err.getvalue() + self._out.getvalue()


class BenchProcesses:
    """The "processes" of one story."""

    def __init__(self, directory: Path, world: World) -> None:
        self.directory = directory
        self._world = world
        self._bridges: list[BenchBridge] = []
        self._simulators: list[BenchSimulator] = []

    def simulator(self, file: Path, *faults: str) -> BenchSimulator:
        """Start simulated drives; ``--fault`` and DRIVE:FAULT as the command takes them."""
        started = BenchSimulator(self._world, file)
        for text in faults[1::2]:
            started.write(text.replace(':', ' ', 1))
        started.simulation.start()
        self._simulators.append(started)
        return started

    def drive_can(self, *arguments: str) -> BenchCommand:
        """Run the command ``drive_can``."""
        return BenchCommand(arguments)

    def bridge(self, file: Path, namespace: str = '', *arguments: str) -> BenchBridge:
        """Start the bridge."""
        options = ['-r', f'__ns:=/{namespace}'] if namespace else []
        started = BenchBridge(self._world, ['--ros-args', '--params-file', str(file), *options,
                                            *arguments])
        self._bridges.append(started)
        return started

    def end(self) -> None:
        """End what is still running."""
        for bridge in self._bridges:
            if bridge.running:
                bridge.end()
        for simulator in self._simulators:
            simulator.simulation.stop()


class BenchClient(Client):
    """The script, in a thread of the bench."""

    def __init__(self, world: World) -> None:
        self._clock = world.clock
        self._context = Context()
        rclpy.init(args=[], context=self._context,
                   signal_handler_options=SignalHandlerOptions.NO)
        self._client: Any = ros_client.Client(  # type: ignore[no-untyped-call]
            rclpy.create_node('system_test_client', context=self._context))
        self._asked: deque[Callable[[], None]] = deque()
        self._told = self._client.node.create_guard_condition(lambda: None)
        self._ending = False
        self._thread = world.clock.worker(self._run, 'client')
        self._thread.start()

    def _run(self) -> None:
        while not self._ending:
            if self._asked:
                self._asked.popleft()()
            else:
                self._client.spin(1.0)

    def ask(self, action: str, timeout: float = DEADLINE, **arguments: Any) -> Any:
        answers: list[Any] = []

        def carry_out() -> None:
            try:
                answers.append(getattr(self._client, action)(timeout=timeout, **arguments))
            except ros_client.Failed as failure:
                answers.append(failure)
        self._asked.append(carry_out)
        self._told.trigger()
        wait_for(lambda: answers, f'the client to {action}', 2.0 * timeout)
        if isinstance(answers[0], ros_client.Failed):
            raise AssertionError(f'{action} {arguments}: {answers[0]}')
        return answers[0]

    def close(self) -> None:
        """End."""
        self._ending = True
        self._told.trigger()
        self._thread.join()
        self._client.executor.shutdown()
        self._client.node.destroy_node()
        self._context.try_shutdown()


class BenchPeer:
    """A drive in literal text at the other end of the bus, without an adapter."""

    def __init__(self, world: World, link: Path, answers: Answers) -> None:
        self.answers = answers
        self.received: list[Line] = []
        self._clock = world.clock
        self._wire = world.wires.of(str(link))
        self._wire.watchers.append(self._see)
        self._answering = False

    def _see(self, frame: Frame) -> None:
        if self._answering:
            return
        now = self._clock.now()
        kind, digits = ('T', 8) if frame.extended else ('t', 3)
        text = f'{kind}{frame.identifier:0{digits}X}{len(frame.data)}{frame.data.hex().upper()}'
        self.received.append(Line(text, now, now))
        for line in answer_to(self.answers, text):
            self.send(f'{line}\r'.encode())

    @property
    def lines(self) -> list[str]:
        """All frames received."""
        return [line.text for line in self.received]

    def wait_for(self, start: str, since: int = 0, count: int = 1) -> list[str]:
        """Wait for ``count`` lines that begin with ``start``; return all of them."""
        def find() -> list[str] | None:
            found = [line for line in self.lines[since:] if line.startswith(start)]
            return found if len(found) >= count else None
        return list(wait_for(find, f'{count} lines {start}'))

    def send(self, data: bytes) -> None:
        """Send frames, each a whole line."""
        self._answering = True
        for line in data.decode().split():
            end = 9 if line[0] == 'T' else 4
            content = bytes.fromhex(line[end + 1:])
            assert len(content) == int(line[end]), line
            self._wire.carry(Frame(int(line[1:end], 16), content, line[0] == 'T'))
        self._answering = False

    def close(self) -> None:
        """Leave the bus."""
        self._wire.watchers.remove(self._see)
