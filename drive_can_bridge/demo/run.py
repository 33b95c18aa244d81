# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The demo itself: which processes start in which order, and end in the opposite one.

First the drives, so that the bridge finds its buses; the view at once, since it takes a while. At
the end the bridge stops the drives, and only then do they lose their bus.
"""

from collections.abc import Iterator
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass, replace
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import termios
from threading import Event

from drive_can_bridge.clock import Clock
from drive_can_bridge.configuration.load import write_parameter_file
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.demo.child import Child
from drive_can_bridge.process.signals import NOT_SUSPENDED, SignalWatcher

#: bit/s that SLCAN adapters know; any other is replaced by the next one above
_BITRATES = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 750_000, 1_000_000)
#: s; who looks at the demo wants to see something soon
_DIAGNOSTICS_PERIOD_MAX = 1.0


def on_terminals(configuration: BridgeConfiguration, directory: Path) -> BridgeConfiguration:
    """
    Replace every bus by the pseudo-terminal at ``directory/BUS``, and waiting by a start.

    Nothing of a bus that is replaced is kept but its bit rate.
    """
    buses = {name: replace(bus, interface='slcan', channel=str(directory / name), options={},
                           bitrate=next((rate for rate in _BITRATES if rate >= bus.bitrate),
                                        _BITRATES[-1]))
             for name, bus in configuration.buses.items()}
    period = min(configuration.diagnostics_period, _DIAGNOSTICS_PERIOD_MAX)
    return replace(configuration, buses=buses, autostart=True, diagnostics_period=period)


TITLE = 'drive_can demo'
#: with which the view ends when the user has enough, and not somebody else of the view
ENOUGH = 64
#: s between two looks at the processes
_LOOK_PERIOD = 0.1
#: s that the simulated drives may take to appear
_DRIVES_TIMEOUT = 60.0
#: s that each process gets for its end. A bridge that has lost its drives tries for a while.
_BRIDGE_PATIENCE = 10.0
_PATIENCE = 5.0
#: s that the view gets to end of its own accord, when all others have ended
_VIEW_PATIENCE = 2.0
#: leaves the view's screen, shows the cursor
_RESTORE = '\x1b[?1049l\x1b[?25h'


@dataclass(frozen=True)
class Options:
    """
    What is to run.

    :param configuration: its buses are replaced by pseudo-terminals.
    :param faults: to begin with, ``DRIVE:FAULT``.
    :param commanded: somebody moves the drives.
    :param frame_log: file for all frames.
    :param duration: s; None: until a signal.
    """

    configuration: BridgeConfiguration
    faults: tuple[str, ...] = ()
    commanded: bool = False
    frame_log: Path | None = None
    duration: float | None = None


class Demo:
    """
    The processes of a demo.

    :param directory: a place of its own.
    :param suspension: set when somebody wants to suspend the demo.
    :param live: there is a terminal that the view takes.
    """

    def __init__(self, options: Options, directory: Path, suspension: Event, clock: Clock, *,
                 live: bool) -> None:
        self._clock = clock
        self._options = options
        self._directory = directory
        self._suspension = suspension
        # the view has the terminal: others tell what they have to tell afterwards
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
        options, directory = self._options, self._directory
        # the view is in the terminal's foreground, too, and must not be suspended either
        before = signal.signal(signal.SIGTSTP, signal.SIG_IGN)
        refusal = ['--refuse-to-suspend', NOT_SUSPENDED] if self._live else []
        self._view = self._start('the view', 'drive_can', 'monitor', '--title', TITLE,
                                 '--quit-code', str(ENOUGH), *refusal, view=True)
        signal.signal(signal.SIGTSTP, before)
        configuration = on_terminals(options.configuration, directory)
        file = directory / 'demo.yaml'
        write_parameter_file(configuration, file)
        arguments = ['--params-file', str(file), '--pty-link', str(directory)]
        for fault in options.faults:
            arguments += ['--fault', fault]
        if options.frame_log is not None:
            arguments += ['--log-frames', str(options.frame_log)]
        self._drives = self._start('the simulation', 'drive_can', 'simulate', *arguments)
        deadline = self._clock.now() + _DRIVES_TIMEOUT
        while not all((directory / name).is_symlink() for name in configuration.buses):
            if watcher.wait(_LOOK_PERIOD / 4) is not None:
                return False
            if self._drives.code is not None or self._clock.now() > deadline:
                raise DriveCanError(f'{TITLE}: the simulated drives did not start')
        self._bridge = self._start('the bridge', 'drive_can_bridge', '--ros-args',
                                   '--params-file', str(file))
        if options.commanded:
            self._start('the commander', 'commander', str(file))
        return True

    def watch(self, watcher: SignalWatcher) -> int:
        """
        Wait for the end.

        :return: exit code: 0 after a signal, the duration, or when the user has enough.
        """
        begun, duration = self._clock.now(), self._options.duration
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
                if child.code > 0:  # of its own accord: it has said why, or will
                    return 1
                child.told = True
                self._tell(child)
            if duration is not None and self._clock.now() >= begun + duration:
                return 0

    def stop(self, *, view_knows: bool) -> None:
        """
        End everything, the drives after the bridge.

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
                    self._say(f'{process.what} did not end in {patience:g} s and was killed')
        if view is not None and not view.ends(_VIEW_PATIENCE):
            view.ask_to_end()
        for child in self._children:
            child.wait(_PATIENCE)

    def conclude(self, code: int) -> None:
        """Say what is left to say, now that the terminal is free."""
        for child in self._children:
            if code and child.errors():
                sys.stderr.write(child.errors())
        frame_log = self._options.frame_log
        if self._live and frame_log is not None:
            with frame_log.open('rb') as file:
                count = sum(1 for _ in file)
            print(f'{count} frames in {frame_log}')

    # -- inside -----------------------------------------------------------------------------------

    def _start(self, what: str, program: str, *arguments: str, view: bool = False) -> Child:
        log = self._directory / f'{len(self._children)}.log' if self._quiet and not view else None
        child = Child(what, program, *arguments, shared=view, log=log,
                      output=None if view else subprocess.DEVNULL)
        self._children.append(child)
        return child

    def _refuse_to_suspend(self) -> None:
        """Say why, or have it said by the view, which has the terminal."""
        if self._live and self._view is not None and self._view.code is None:
            self._view.process.send_signal(signal.SIGTSTP)
        else:
            self._say(NOT_SUSPENDED)

    def _tell(self, child: Child) -> None:
        """Say that a process has ended, and that the others go on."""
        if child is self._view:
            if self._live:
                sys.stdout.write(_RESTORE)
                sys.stdout.flush()
            self._say(f'the view has ended ({child.end}); bridge and drives run on until Ctrl-C, '
                      f'and drive_can monitor shows them')
        elif not (self._live and self._view is not None and self._view.code is None):
            self._say(f'{child.what} has ended ({child.end}); the others run on until Ctrl-C')

    def _say(self, text: str) -> None:
        print(f'{TITLE}: {text}', file=sys.stderr, flush=True)


def run(options: Options, watcher: SignalWatcher, suspension: Event, clock: Clock) -> int:
    """
    Run until a signal, or as long as the options say.

    :param suspension: set when somebody wants to suspend the demo, which says why it refuses.
    :return: 0, or 1 when a process could not start or go on.
    :raises DriveCanError: the drives do not start.
    :raises OSError: a file cannot be written.
    """
    if options.frame_log is not None:
        options.frame_log.write_bytes(b'')  # whether it can be written is known now
    live = sys.stdout.isatty() and os.environ.get('TERM', 'dumb') not in ('dumb', 'unknown')
    code = 1
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix='drive_can_')))
        stack.enter_context(_terminal_restored())
        demo = Demo(options, directory, suspension, clock, live=live)
        try:
            try:
                code = demo.watch(watcher) if demo.start(watcher) else 0
            finally:
                demo.stop(view_knows=watcher.interrupted)
        finally:
            demo.conclude(code)
    return code


@contextmanager
def _terminal_restored() -> Iterator[None]:
    """Leave the keyboard as it was, whatever the view died of."""
    try:
        settings = termios.tcgetattr(0)
    except termios.error:
        yield
        return
    try:
        yield
    finally:
        termios.tcsetattr(0, termios.TCSANOW, settings)
