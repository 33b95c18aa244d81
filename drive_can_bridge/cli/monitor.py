# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can monitor``: the live view of all running bridges.

A ROS client that sees what any node could see; bridges are not affected by it.
"""

import argparse
from collections.abc import Callable
import json
import os
import shutil
import sys

from drive_can_bridge.cli.command import imports_of, namespace
from drive_can_bridge.clock import Clock
from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.snapshot import ModelSource
from drive_can_bridge.monitor.summary import balance, documents, Lines
from drive_can_bridge.process import environment
from drive_can_bridge.process.beginning import leave
from drive_can_bridge.process.signals import SignalWatcher

#: s between two lines of a drive, and between two looks at what arrives
LINE_PERIOD = 1.0
_POLL_PERIOD = 0.1
#: s that is shown why a view is not suspended
_REFUSAL_TIME = 5.0
_TITLE = 'drive_can monitor'


def define(parser: argparse.ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Show all bridges and their drives, live, until SIGINT or SIGTERM. Needs ROS, '
        'and nothing of a bridge but its topics and services. In a terminal its last '
        'line names the keys; elsewhere one line per drive and second.')
    parser.add_argument('--namespace', metavar='NS', default='', type=namespace,
                        help='only bridges in this namespace, or below it')
    parser.add_argument('--json', action='store_true', help=(
        'a JSON document per drive and second: time, drive, bridge, state, level, online, '
        'message, control, setpoints and values (name: value, unit), exchanges, missed'))
    # how drive_can demo runs it
    parser.add_argument('--title', default=_TITLE, help=argparse.SUPPRESS)
    parser.add_argument('--quit-code', type=int, default=0, help=argparse.SUPPRESS)
    parser.add_argument('--refuse-to-suspend', metavar='WHY', default='', help=argparse.SUPPRESS)


class _Refusal:
    """Why a view is not suspended, shown for a while after an attempt."""

    def __init__(self, text: str, now: Callable[[], float]) -> None:
        self._text = text
        self._now = now
        self._until = 0.0

    def begin(self) -> None:
        """Show it from now on. From any thread."""
        self._until = self._now() + _REFUSAL_TIME

    def __call__(self) -> str:
        """Return the text to be shown now; '' for none."""
        return self._text if self._now() < self._until else ''


def run(args: argparse.Namespace) -> int:
    """
    Show the drives.

    :return: 0 after SIGINT or SIGTERM, 131 after SIGQUIT.
    :raises DriveCanError: no ROS.
    """
    refusal = _Refusal(args.refuse_to_suspend, args.clock.now)
    # a second signal ends the process at once
    with SignalWatcher(args.clock, keep=True,
                       refuse=refusal.begin if args.refuse_to_suspend else None) as watcher:
        with imports_of('drive_can monitor'):
            from drive_can_bridge.ros.monitor.client import MonitorClient
        # a demo starts its bridge itself, and ends it
        model = Model(args.namespace, started_here=args.title != _TITLE)
        source = MonitorClient(model)
        try:
            code = _show(source, model, watcher, args, refusal)
        finally:
            source.close()
        code = watcher.exit_code(code)
        leave(code)
        return code


def _show(source: ModelSource, model: Model, watcher: SignalWatcher, args: argparse.Namespace,
          refusal: _Refusal) -> int:
    clock: Clock = args.clock
    place = environment.in_words()
    # a demo starts its bridge itself
    elsewhere = '' if args.title != _TITLE else environment.elsewhere(args.namespace or None)
    if (not args.json and sys.stdout.isatty()
            and os.environ.get('TERM', 'dumb') not in ('dumb', 'unknown')):
        try:
            from drive_can_bridge.view.live import show, ViewSetting
        except ImportError as error:
            print(f'{args.title}: no live view without the Python module {error.name}',
                  file=sys.stderr)
        else:
            # a demo starts its bridge itself
            bridge = '' if args.title != _TITLE else (
                f'{"ros2 run drive_can_bridge " if shutil.which("ros2") else ""}drive_can_bridge')
            setting = ViewSetting(
                args.title, place, args.namespace,
                tuple(filter(None, (environment.activate_command(),
                                    environment.export_command()))), bridge, elsewhere)
            code = show(source, model, setting, clock, ended=lambda: watcher.signalled,
                        quit_code=args.quit_code, notice=refusal)
            for text in balance(model.look(clock.now(), 1e-9 * clock.stamp())):
                print(text)
            return code
    for words in filter(None, (place, elsewhere)):
        print(f'{args.title}: {words}', file=sys.stderr, flush=True)
    return _print_lines(source, model, watcher, clock, as_json=args.json)


def _print_lines(source: ModelSource, model: Model, watcher: SignalWatcher, clock: Clock, *,
                 as_json: bool) -> int:
    """Print one line per drive and second, until a signal."""
    lines = Lines()
    due = clock.now() + LINE_PERIOD
    while watcher.wait(_POLL_PERIOD) is None:
        now = clock.now()
        source.poll(now)
        if now < due:
            continue
        due = max(due + LINE_PERIOD, now)
        snapshot = model.look(now, 1e-9 * clock.stamp())
        found = ([json.dumps(each, ensure_ascii=False) for each in documents(snapshot)]
                 if as_json else lines.look(snapshot, now))
        if found:
            print('\n'.join(found), flush=True)
    return 0
