# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The demo itself: what is started in which order, and stopped in the opposite one.

The main thread shows and waits; everything else has threads of its own, as in the executable
``drive_can_bridge``. At the end the drives are stopped like there, neutral frames first, and only
when the last frame is in the frame log do the simulated drives lose their bus.
"""

from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import rclpy
from rclpy.logging import get_logger
from rclpy.parameter import Parameter as NodeParameter
from rclpy.signals import SignalHandlerOptions

from drive_can_bridge.configuration.load import declared_parameters
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.process.scheduling import be_punctual
from drive_can_bridge.process.signals import SignalWatcher
from drive_can_bridge.ros.bridge_node import BridgeNode
from drive_can_bridge.ros.demo.commander import Commander
from drive_can_bridge.ros.demo.frame_log import FrameLog
from drive_can_bridge.ros.demo.hints import Hint, hints
from drive_can_bridge.ros.demo.observer import Observer
from drive_can_bridge.ros.executor_thread import ExecutorThread
from drive_can_bridge.simulation.faults import Fault
from drive_can_bridge.simulation.simulation import Simulation
from drive_can_bridge.transport.failures import in_words
from drive_can_bridge.transport.link import steady_now


@dataclass(frozen=True)
class Options:
    """
    What is to run.

    :param configuration: its buses are replaced by virtual ones.
    :param environment: command that lets another terminal see the demo; may be ''.
    :param duration: s; None: until a signal.
    """

    configuration: BridgeConfiguration
    faults: tuple[tuple[str, Fault], ...] = ()
    commanded: bool = False
    frame_log: Path | None = None
    duration: float | None = None
    environment: str = ''


class Presenter(Protocol):
    """
    Shows the demo to somebody.

    :ivar period: s between two calls of ``show``.
    """

    period: float

    def open(self, observer: Observer, told: list[Hint]) -> None:
        """Everything runs."""

    def show(self) -> None:
        """Show how things are."""

    def close(self) -> None:
        """Make way for whatever else is written. May come without ``open``, and twice."""

    def conclude(self, code: int, frame_log: FrameLog | None) -> None:
        """Say how it went: everything has stopped."""


def run(options: Options, watcher: SignalWatcher, presenter: Presenter) -> int:
    """
    Run until a signal, or as long as the options say.

    :return: 0 after a signal or the duration, 1 when the bridge could not start or go on.
    :raises DriveCanError: something is not there or not right.
    """
    be_punctual()
    frame_log = None
    code = 1
    try:
        with ExitStack() as stack:
            # the last that is put on the stack ends first
            _start_ros(stack)
            configuration = on_virtual_buses(options.configuration)
            if options.frame_log is not None:
                frame_log = FrameLog(options.frame_log, configuration.buses.values())
                stack.callback(frame_log.close)
            simulation = _simulation(configuration, options.faults)
            stack.enter_context(simulation)
            bridge, observer = _start_bridge(stack, configuration, watcher, options)
            if bridge is not None:
                told = hints(configuration, bridge=bridge.get_fully_qualified_name(),
                             namespace=bridge.get_namespace(), environment=options.environment,
                             commanded=options.commanded)
                stack.callback(presenter.close)
                presenter.open(observer, told)
                code = _show(presenter, watcher, simulation, options.duration)
    finally:
        presenter.close()
        presenter.conclude(code, frame_log)
    return code


def on_virtual_buses(configuration: BridgeConfiguration) -> BridgeConfiguration:
    """Replace every bus by one inside this process, and a wait for transitions by a start."""
    buses = {name: replace(bus, interface='virtual', channel=name, options={})
             for name, bus in configuration.buses.items()}
    return replace(configuration, buses=buses, autostart=True)


def _start_ros(stack: ExitStack) -> None:
    try:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rcl fails in several types
        raise DriveCanError(f'drive_can demo: ROS does not start: {in_words(error)}') from error
    stack.callback(rclpy.try_shutdown)


def _simulation(configuration: BridgeConfiguration,
                faults: tuple[tuple[str, Fault], ...]) -> Simulation:
    logger = get_logger('simulation')

    def say(line: str) -> None:
        logger.info(line)

    def complain(line: str) -> None:
        logger.warning(line)

    simulation = Simulation(configuration, say=say, complain=complain)
    for name, fault in faults:
        simulation.drives[name].fault(fault)
    return simulation


def _start_bridge(stack: ExitStack, configuration: BridgeConfiguration, watcher: SignalWatcher,
                  options: Options) -> tuple[BridgeNode | None, Observer]:
    """Start the bridge, and the commander; None instead of a bridge that refuses (logged)."""
    spinner = ExecutorThread('services', lambda text: bridge.log.error(text),
                             rclpy.get_default_context())
    # every parameter is given: no file on ROS's own command line, whose buses would mix with ours
    bridge = BridgeNode(spinner.executor, watcher.fatal, parameter_overrides=[
        NodeParameter(name, value=value)
        for name, value, *_ in declared_parameters(configuration)])
    observer = Observer(bridge, configuration)
    stack.callback(bridge.destroy_node)
    stack.callback(bridge.close)
    after_spinning = stack.enter_context(ExitStack())
    spinner.start()
    stack.callback(spinner.stop)
    stack.callback(bridge.stop)
    if not bridge.start():
        return None, observer
    if options.commanded:
        commander = Commander(bridge, spinner.executor)
        after_spinning.callback(commander.destroy)
        stack.callback(commander.stop)
        commander.start()
    return bridge, observer


def _show(presenter: Presenter, watcher: SignalWatcher, simulation: Simulation,
          duration: float | None) -> int:
    now = steady_now()
    end = None if duration is None else now + duration
    due = now
    while True:
        due = max(due + presenter.period, now)
        reason = watcher.wait(max(0.0, (due if end is None else min(due, end)) - now))
        if reason is not None:
            return 1 if reason else 0
        now = steady_now()
        if simulation.failure:
            raise DriveCanError(f'drive_can demo: the simulation ended: {simulation.failure}')
        if end is not None and now >= end:
            return 0
        presenter.show()
