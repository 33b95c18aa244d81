# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A bridge with the drives at the other end of its buses."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import copy
import gc
import itertools
from pathlib import Path
import struct
import threading
from types import TracebackType
from typing import Any

import can
from clients import wait_until
import plant
import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions
import waiting
import world

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.ros.bridge_node import BridgeNode
from drive_can_bridge.ros.threads import ExecutorThread
from drive_can_bridge.simulation.registers import Mechanics
from drive_can_bridge.simulation.simulation import PlayedDrive, Simulation

_COUNTER = itertools.count(1)
#: an identifier that nobody listens to
MARK = 0x7FF

#: generous: nothing may depend on how busy the machine is
GENEROUS = {'period': 0.02, 'command_timeout': 20.0, 'missed_limit': 100,
            'parameter_timeout': 2.0}
CONVEYOR: dict[str, Any] = {**plant.CONVEYOR, **GENEROUS}
LIFT: dict[str, Any] = {**plant.LIFT, **GENEROUS, 'control_timeout': 20.0}
#: drives that tell soon when something is missing, for the tests of what happens then
HASTY: dict[str, Any] = {'missed_limit': 10, 'parameter_timeout': 0.2}


def parameters(*, buses: dict[str, Any] | None = None, **drives: dict[str, Any]) -> dict[str, Any]:
    """Return the parameters of a bridge with these drives; the conveyor without any."""
    return {
        'diagnostics_period': 0.1,
        'buses': buses or {'main': {'interface': 'virtual', 'bitrate': 1_000_000,
                                    'reconnect_period': 0.1}},
        'drives': {name: dict(keys) for name, keys in (drives or {'conveyor': CONVEYOR}).items()}}


class Bridge:
    """
    A BridgeNode in a context of its own, and simulated drives.

    :param content: parameters as a dictionary, or the text of a parameter file; None: a conveyor.
        A bus without a channel gets one that nobody else has.
    :param arguments: further ROS arguments, ``-r __ns:=/cell1``.
    :param simulated: play the drives.
    :param autostart: configure and activate.
    :param key: to whom the parameter file is addressed.
    :param mechanics: what simulated motors carry, by drive.
    """

    def __init__(self, directory: Path, content: Any = None, *, arguments: tuple[str, ...] = (),
                 simulated: bool = True, autostart: bool = True,
                 key: str = '/**/drive_can_bridge',
                 mechanics: dict[str, Mechanics] | None = None) -> None:
        clock = waiting.clock()
        number = next(_COUNTER)
        self.file = directory / f'bridge_{number}.yaml'
        if not isinstance(content, str):
            content = copy.deepcopy(content or parameters())
            for name, bus in content['buses'].items():
                bus.setdefault('channel', f'ros_test_{number}_{name}')
            content = plant.text(content.pop('drives'), node=key, **content)
        self.file.write_text(content, encoding='utf-8')
        self._simulated = simulated
        self._autostart = autostart
        self._mechanics = mechanics
        self.fatal: list[str] = []
        self.errors: list[str] = []
        self.simulation: Simulation | None = None
        self._closed = False
        self.context = Context()
        rclpy.init(args=['--ros-args', '--params-file', str(self.file), *arguments],
                   context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.spinner = ExecutorThread('services', self.errors.append, self.context, clock)
        self.node = BridgeNode(self.spinner, self.fatal.append, clock, context=self.context)

    def begin(self) -> None:
        """Start the simulation and the bridge."""
        if self._simulated:
            self.simulation = Simulation(configuration_from_file(self.file), waiting.clock(),
                                         complain=self.errors.append,
                                         mechanics=self._mechanics)
            self.simulation.start()
        self.spinner.start()
        if self._autostart:
            assert self.node.start(), 'the bridge did not start'

    @property
    def played(self) -> dict[str, PlayedDrive]:
        """The simulated drives by name."""
        assert self.simulation is not None
        return self.simulation.drives

    def channel(self, bus: str = 'main') -> str:
        """Return the channel of a bus."""
        return str(self.node.overrides[f'buses.{bus}.channel'])

    def record(self, bus: str = 'main') -> 'Recorder':
        """Record the frames of a bus; use as a context manager."""
        if waiting.virtual is not None:
            return ClockedRecorder(self.channel(bus))
        return Recorder(self.channel(bus))

    def online(self, *names: str, timeout: float = 60.0) -> 'Bridge':
        """Wait until drives are online; all of them by default."""
        wait_until(lambda: all(self.node.drives[name].session.online
                               for name in names or self.node.drives), timeout,
                   'drives that come online')
        return self

    def close(self) -> None:
        """End everything, in the order of the executable."""
        if self._closed:
            return
        self._closed = True
        self.node.stop()
        self.spinner.stop()
        self.node.close()
        self.node.destroy_node()
        # rclpy's state machine keeps a node in the graph for as long as it is in memory
        del self.node, self.spinner
        gc.collect()
        self.context.try_shutdown()
        del self.context
        if waiting.virtual is None:
            gc.collect()
        if self.simulation is not None:
            self.simulation.stop()


class Recorder:
    """All frames on a virtual bus, in order: (identifier, data)."""

    def __init__(self, channel: str) -> None:
        self._channel = channel
        self._frames: list[tuple[int, bytes]] = []
        self._ending = threading.Event()

    def __enter__(self) -> 'Recorder':
        self._bus = can.Bus(interface='virtual', channel=self._channel, ignore_config=True)
        self._thread = threading.Thread(target=self._run, name='recorder')
        self._thread.start()
        return self

    def __exit__(self, exception_type: type[BaseException] | None,
                 exception: BaseException | None, traceback: TracebackType | None) -> None:
        self._ending.set()
        self._thread.join()
        self._bus.shutdown()

    def _run(self) -> None:
        while not self._ending.is_set():
            message = self._bus.recv(0.02)
            if message is not None:
                self._frames.append((message.arbitration_id, bytes(message.data)))

    def frames(self, *identifiers: int) -> list[tuple[int, bytes]]:
        """Return the frames so far, or only those of some identifiers."""
        return [frame for frame in list(self._frames)
                if not identifiers or frame[0] in identifiers]

    def requests(self) -> list[tuple[int, bytes]]:
        """Return what was sent to drives so far, and really all of it."""
        self.catch_up()
        return [frame for frame in self.frames() if frame[0] < 0x10000000]

    def catch_up(self) -> None:
        """Wait until everything is recorded that is on the bus by now."""
        mark = next(_COUNTER).to_bytes(8, 'big')
        with can.Bus(interface='virtual', channel=self._channel, ignore_config=True) as bus:
            bus.send(can.Message(arbitration_id=MARK, data=mark, is_extended_id=False))
        wait_until(lambda: (MARK, mark) in self._frames)
        self._frames.remove((MARK, mark))

    def words(self, station: int = 1) -> tuple[int, ...]:
        """Return the signed words of the last cyclic request to a station; () without any."""
        sent = self.cycles(station)
        return sent[-1] if sent else ()

    def cycles(self, station: int = 1) -> list[tuple[int, ...]]:
        """Return the signed words of all cyclic requests to a station."""
        return [struct.unpack('>4h', data)
                for _, data in self.frames(cyclic_identifier(station))]

    def clear(self) -> None:
        """Forget what was seen."""
        self._frames.clear()

    def send(self, identifier: int, data: bytes, *, extended: bool = True) -> None:
        """Send a frame as a stranger."""
        self._bus.send(can.Message(arbitration_id=identifier, data=data,
                                   is_extended_id=extended))


class ClockedRecorder(Recorder):
    """The same on the bench: there is no time between a frame and its record."""

    def __enter__(self) -> 'ClockedRecorder':
        assert world.current is not None
        self._wire = world.current.wires.of(self._channel)
        self._wire.watchers.append(self._see)
        return self

    def __exit__(self, exception_type: type[BaseException] | None,
                 exception: BaseException | None, traceback: TracebackType | None) -> None:
        self._wire.watchers.remove(self._see)

    def _see(self, frame: Frame) -> None:
        self._frames.append((frame.identifier, frame.data))

    def catch_up(self) -> None:
        """Wait for nothing."""

    def send(self, identifier: int, data: bytes, *, extended: bool = True) -> None:
        """Send a frame as a stranger."""
        self._wire.carry(Frame(identifier, data, extended))


@contextmanager
def late(exchange: BusExchange) -> Iterator[None]:
    """Keep an exchange, but nobody else, from going on."""
    # its own lock is for what does not wait: whoever has it keeps the turn
    lock = waiting.clock().lock()
    exchange.lock = lock    # type: ignore[assignment]
    with lock:
        yield


StartBridge = Callable[..., Bridge]


def cyclic_identifier(station: int) -> int:
    """Return the identifier of a drive's cyclic request."""
    return station << 21 | 0x1FFFF0


def acyclic(recorder: Recorder) -> list[tuple[int, bytes]]:
    """Return what was sent to station 1 beside cycles and looks at the maps."""
    recorder.catch_up()
    return [(identifier, data) for identifier, data in recorder.frames()
            if identifier >> 21 == 1 and identifier & 0x1FFFF0 != 0x1FFFF0
            and not 122 <= (identifier >> 4 & 0xFFFF) <= 129]
