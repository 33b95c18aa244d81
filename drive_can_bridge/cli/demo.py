# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can demo``: simulated drives, a bridge and the live view, each a process of its own.

Needs rclpy, but no hardware, no root and no kernel module. First the drives start, so that the
bridge finds its buses; the view at once, since it takes a while. At the end the bridge stops the
drives, and only then do they lose their bus.
"""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager, ExitStack, suppress
from dataclasses import replace
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import termios
from threading import Event

from drive_can_bridge.cli.command import above_zero, imports_of, of_drive, whole, WrongUsage
from drive_can_bridge.clock import Clock
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.errors import DriveCanError, ValueRefused
from drive_can_bridge.core.text import counted
from drive_can_bridge.demo.child import Child
from drive_can_bridge.process import environment
from drive_can_bridge.process.critical_sections import handled
from drive_can_bridge.process.signals import NOT_SUSPENDED, SignalWatcher
from drive_can_bridge.resources import config_file
from drive_can_bridge.simulation.faults import parse_fault, usage_lines
from drive_can_bridge.simulation.simulation import Simulation

PARAMETER_FILE = 'demo.yaml'
TITLE = 'drive_can demo'
#: with which the view ends when the user quits it, and not by a signal
ENOUGH = 64
#: s between two looks at the processes
_LOOK_PERIOD = 0.1
#: s that the simulated drives may take to appear
_DRIVES_TIMEOUT = 60.0
#: s that each process gets for its end. A bridge that has lost its drives tries for a while.
_BRIDGE_PATIENCE = 10.0
_PATIENCE = 5.0
#: s that the view gets to end by itself, when all others have ended
_VIEW_PATIENCE = 2.0
#: leaves the view's screen, shows the cursor
_RESTORE = '\x1b[?1049l\x1b[?25h'
#: bit/s that SLCAN adapters know; any other is replaced by the next one above
_BITRATES = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 750_000, 1_000_000)
#: s; users want to see something soon
_DIAGNOSTICS_PERIOD_MAX = 1.0


def define(parser: argparse.ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    faults = '\n'.join(usage_lines())
    parser.description = (
        'Run simulated drives, a bridge for them and the view of drive_can monitor, '
        'until SIGINT or SIGTERM. In a terminal the view is live; elsewhere it is one '
        'line per drive and second.')
    parser.epilog = (
        f'faults:\n{faults}\n\nROS traffic stays on this machine unless '
        f'{environment.DISCOVERY_RANGE} says otherwise.')
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument('-p', '--params-file', metavar='FILE', type=Path,
                        help='parameter file of a bridge, instead of the one of the demo; its '
                             'buses are replaced by pseudo-terminals')
    parser.add_argument('--drive', action='store_true',
                        help='command the drives, too: arm, enable, then a slow sine; one '
                             'that was stopped is enabled again after a moment')
    parser.add_argument('--fault', metavar='DRIVE:FAULT', action='append', default=[],
                        help='begin with a fault, for example lift:silent; repeatable')
    parser.add_argument('--log-frames', metavar='FILE', type=Path,
                        help='write every frame, as candump -L does')
    parser.add_argument('--duration', metavar='SECONDS', type=above_zero,
                        help='end by itself after that time')
    parser.add_argument('--domain-id', metavar='N', type=whole(0, environment.DOMAIN_ID_MAX),
                        help='ROS domain, instead of the one of the environment')


def run(args: argparse.Namespace) -> int:
    """
    Run the demo.

    :return: 0 after SIGINT, SIGTERM or the duration, 131 after SIGQUIT, 1 failure.
    :raises WrongUsage: a fault that no drive can have.
    :raises DriveCanError: a parameter file with problems, no ROS.
    :raises OSError: a file cannot be read or written.
    """
    # before the imports, which take their time: a signal counts from the very beginning
    suspension = Event()
    with SignalWatcher(args.clock, refuse=suspension.set) as watcher:
        environment.prepare(args.domain_id)
        with imports_of('drive_can demo'):  # by the other processes: better to know now
            from drive_can_bridge.ros.demo import commander  # noqa: F401
        # imported late: it reads schemas, and --help needs none
        from drive_can_bridge.configuration.load import configuration_from_file
        configuration = configuration_from_file(args.params_file or config_file(PARAMETER_FILE))
        for warning in configuration.warnings:
            print(f'warning: {warning}', file=sys.stderr)
        for text in args.fault:
            name, fault = of_drive('--fault', text, configuration, parse_fault)
            try:
                Simulation(configuration, args.clock).drives[name].fault(fault)
            except ValueRefused as error:
                raise WrongUsage(f'--fault {text}: {error}') from None
        return watcher.exit_code(_run(args, configuration, watcher, suspension))


def _run(args: argparse.Namespace, configuration: BridgeConfiguration, watcher: SignalWatcher,
         suspension: Event) -> int:
    if args.log_frames is not None:
        args.log_frames.write_bytes(b'')    # whether it can be written is known now
    live = sys.stdout.isatty() and os.environ.get('TERM', 'dumb') not in ('dumb', 'unknown')
    code = 1
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix='drive_can_')))
        stack.enter_context(_terminal_restored())
        demo = Demo(args, configuration, directory, suspension, live=live)
        try:
            try:
                code = demo.watch(watcher) if demo.start(watcher) else 0
            finally:
                demo.stop(view_knows=watcher.interrupted)
        finally:
            demo.conclude(code)
    return code


def on_terminals(configuration: BridgeConfiguration, directory: Path) -> BridgeConfiguration:
    """
    Replace every bus by the pseudo-terminal at ``directory/BUS``, and start by itself.

    Only the bit rate of a replaced bus is kept.
    """
    buses = {name: replace(bus, interface='slcan', channel=str(directory / name), options={},
                           bitrate=next((rate for rate in _BITRATES if rate >= bus.bitrate),
                                        _BITRATES[-1]))
             for name, bus in configuration.buses.items()}
    period = min(configuration.diagnostics_period, _DIAGNOSTICS_PERIOD_MAX)
    return replace(configuration, buses=buses, autostart=True, diagnostics_period=period)


class Demo:
    """
    The processes of a demo.

    :param configuration: its buses are replaced by pseudo-terminals.
    :param directory: a place of its own.
    :param suspension: called to refuse a suspension of the demo.
    :param live: there is a terminal for the view.
    """

    def __init__(self, args: argparse.Namespace, configuration: BridgeConfiguration,
                 directory: Path, suspension: Event, *, live: bool) -> None:
        self._clock: Clock = args.clock
        self._args = args
        self._configuration = on_terminals(configuration, directory)
        self._directory = directory
        self._suspension = suspension
        # the view has the terminal: others print afterwards
        self._quiet = live and os.isatty(2)
        self._live = live
        self._children: list[Child] = []
        self._view: Child | None = None
        self._bridge: Child | None = None
        self._drives: Child | None = None

    def start(self, watcher: SignalWatcher) -> bool:
        """
        Start everything.

        :return: False: a signal came first.
        :raises DriveCanError: the drives do not start.
        """
        # imported late: it reads schemas, and --help needs none
        from drive_can_bridge.configuration.load import write_parameter_file
        args, directory = self._args, self._directory
        # the view is in the terminal's foreground, too, and must not be suspended either
        refusal = ['--refuse-to-suspend', NOT_SUSPENDED] if self._live else []
        with handled((signal.SIGTSTP,), signal.SIG_IGN):
            self._view = self._start('the view', 'drive_can', 'monitor', '--title', TITLE,
                                     '--quit-code', str(ENOUGH), *refusal, view=True)
        file = directory / PARAMETER_FILE
        write_parameter_file(self._configuration, file)
        arguments = ['--params-file', str(file), '--pty-link', str(directory)]
        for fault in args.fault:
            arguments += ['--fault', fault]
        if args.log_frames is not None:
            arguments += ['--log-frames', str(args.log_frames)]
        self._drives = self._start('the simulation', 'drive_can', 'simulate', *arguments)
        deadline = self._clock.now() + _DRIVES_TIMEOUT
        while not all((directory / name).is_symlink() for name in self._configuration.buses):
            if watcher.wait(_LOOK_PERIOD / 4) is not None:
                return False
            if self._drives.code is not None or self._clock.now() > deadline:
                raise DriveCanError(command_sentences.drives_not_started(title=TITLE))
        self._bridge = self._start('the bridge', 'drive_can_bridge', '--ros-args',
                                   '--params-file', str(file))
        if args.drive:
            self._start('the commander', 'commander', str(file))
        return True

    def watch(self, watcher: SignalWatcher) -> int:
        """
        Wait for the end.

        :return: exit code: 0 after a signal or ``--duration``, or when the view was quit; 1 when
            a process ended by itself with an error.
        """
        begun, duration = self._clock.now(), self._args.duration
        while True:
            left = _LOOK_PERIOD if duration is None else min(
                _LOOK_PERIOD, max(0.0, begun + duration - self._clock.now()))
            if watcher.wait(left) is not None:
                return 0
            if self._suspension.is_set():
                self._suspension.clear()
                self._refuse_to_suspend()
            for child in self._children:
                if child.code is None or child.told:
                    continue
                if watcher.signalled or child is self._view and child.code == ENOUGH:
                    return 0
                if child.code > 0:  # by itself: it has printed why, or will
                    return 1
                child.told = True
                self._tell(child)
            if duration is not None and self._clock.now() >= begun + duration:
                return 0

    def stop(self, *, view_knows: bool) -> None:
        """
        End all processes, the drives after the bridge.

        :param view_knows: it has got Ctrl-C itself: another signal would end it before it has
            given the terminal back.
        """
        bridge, drives, view = self._bridge, self._drives, self._view
        for child in self._children:
            if child is not bridge and child is not drives and not (view_knows and child is view):
                child.ask_to_end()
        for process, signum, patience in ((bridge, signal.SIGINT, _BRIDGE_PATIENCE),
                                          (drives, signal.SIGTERM, _PATIENCE)):
            if process is not None:
                process.ask_to_end(signum)
                if not process.wait(patience):
                    self._say(command_sentences.process_killed(
                        what=process.what, patience=patience))
        if view is not None and not view.ends(_VIEW_PATIENCE):
            view.ask_to_end()
        for child in self._children:
            child.wait(_PATIENCE)

    def conclude(self, code: int) -> None:
        """Print what is left to report, now that the terminal is free."""
        for child in self._children:
            if code and child.errors():
                sys.stderr.write(child.errors())
        frame_log = self._args.log_frames
        if self._live and frame_log is not None:
            with frame_log.open('rb') as file:
                count = sum(1 for _ in file)
            print(f'{counted(count, "frame")} in {frame_log}')

    # -- inside -----------------------------------------------------------------------------------

    def _start(self, what: str, program: str, *arguments: str, view: bool = False) -> Child:
        log = self._directory / f'{len(self._children)}.log' if self._quiet and not view else None
        child = Child(what, program, *arguments, shared=view, log=log,
                      output=None if view else subprocess.DEVNULL)
        self._children.append(child)
        return child

    def _refuse_to_suspend(self) -> None:
        """Print why a suspension is refused, by the view where that has the terminal."""
        if self._live and self._view is not None and self._view.code is None:
            self._view.process.send_signal(signal.SIGTSTP)
        else:
            self._say(NOT_SUSPENDED)

    def _tell(self, child: Child) -> None:
        """Print that a process has ended, and that the others go on."""
        if child is self._view:
            if self._live:
                sys.stdout.write(_RESTORE)
                sys.stdout.flush()
            self._say(command_sentences.view_ended(end=child.end))
        elif not (self._live and self._view is not None and self._view.code is None):
            self._say(command_sentences.process_ended(what=child.what, end=child.end))

    def _say(self, text: str) -> None:
        print(f'{TITLE}: {text}', file=sys.stderr, flush=True)


@contextmanager
def _terminal_restored() -> Iterator[None]:
    """Restore the settings of the terminal, however the view has ended."""
    try:
        settings = termios.tcgetattr(0)
    except termios.error:
        yield
        return
    try:
        yield
    finally:
        with suppress(termios.error):   # the terminal is gone
            termios.tcsetattr(0, termios.TCSANOW, settings)
