# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can demo``: bridge and simulated drives in one process, on buses inside it.

Needs rclpy, but no hardware, no root and no kernel module.
"""

import argparse
import math
import os
from pathlib import Path
import sys
from typing import Any

from drive_can_bridge.core.errors import DriveCanError, ValueRefused
from drive_can_bridge.process import environment
from drive_can_bridge.process.signals import SignalWatcher
from drive_can_bridge.resources import config_file
from drive_can_bridge.simulation.faults import Fault, parse_fault, USAGE

WRONG_USAGE = 2
PARAMETER_FILE = 'demo.yaml'
NO_ROS = ('drive_can demo: needs ROS 2 (Python module {module}): source your installation '
          "(/opt/ros/jazzy/setup.bash), or get it as wheels with the extra 'ros' of this package "
          "(pip install '.[ros]')")


def add_parser(subparsers: Any) -> None:
    """Add the subcommand to the parser of ``drive_can``."""
    faults = '\n'.join(f'  {usage:17}  {meaning}' for usage, meaning in USAGE)
    parser = subparsers.add_parser(
        'demo', help='run a bridge and simulated drives in one process',
        description='Run the bridge and simulated drives in one process, until SIGINT or '
                    'SIGTERM. In a terminal with a live view; elsewhere with one line per drive '
                    'and second.',
        epilog=f'faults:\n{faults}\n\nROS traffic stays on this machine unless '
               f'{environment.DISCOVERY_RANGE} says otherwise.',
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--params-file', metavar='FILE', type=Path,
                        help='parameter file of a bridge, instead of the one of the demo; its '
                             'buses are replaced by virtual ones')
    parser.add_argument('--drive', action='store_true',
                        help='command the drives, too: arm, enable, then a slow sine')
    parser.add_argument('--fault', metavar='DRIVE:FAULT', action='append', default=[],
                        help='begin with a fault, for example lift:silent; repeatable')
    parser.add_argument('--log-frames', metavar='FILE', type=Path,
                        help='write every frame, as candump -L does')
    parser.add_argument('--duration', metavar='SECONDS', type=_duration,
                        help='end by itself after that time')
    parser.add_argument('--domain-id', metavar='N', type=_domain_id,
                        help='ROS domain, instead of the one of the environment')
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """
    Run the demo.

    :return: 0 after SIGINT, SIGTERM or the duration, 1 failure, 2 wrong usage.
    :raises DriveCanError: a parameter file with problems, no ROS.
    :raises OSError: a file cannot be read or written.
    """
    # before the imports, which take their time: a signal counts from the very beginning
    with SignalWatcher() as watcher:
        environment.prepare(args.domain_id)
        try:
            from drive_can_bridge.ros.demo import application
        except ImportError as error:
            raise DriveCanError(_what_is_missing(error)) from error
        # imported late: it reads schemas, and --help needs none
        from drive_can_bridge.configuration.load import configuration_from_file
        configuration = configuration_from_file(args.params_file or config_file(PARAMETER_FILE))
        for warning in configuration.warnings:
            print(f'warning: {warning}', file=sys.stderr)
        try:
            faults = tuple(_fault(text, list(configuration.drives)) for text in args.fault)
            return watcher.exit_code(application.run(application.Options(
                configuration=configuration, faults=faults, commanded=args.drive,
                frame_log=args.log_frames, duration=args.duration,
                environment=environment.export_command()), watcher, _presenter()))
        except ValueRefused as error:
            print(f'drive_can demo: --fault {error}', file=sys.stderr)
            return WRONG_USAGE


def _presenter() -> Any:
    """Choose the live view where there is a terminal to draw on."""
    from drive_can_bridge.ros.demo.lines import LineWriter
    if not sys.stdout.isatty() or os.environ.get('TERM', 'dumb') in ('dumb', 'unknown'):
        return LineWriter(environment.in_words())
    try:
        from drive_can_bridge.ros.demo.live import LiveView
    except ImportError as error:
        print(f'drive_can demo: no live view without the Python module {error.name}',
              file=sys.stderr)
        return LineWriter(environment.in_words())
    return LiveView(environment.in_words())


def _fault(text: str, drives: list[str]) -> tuple[str, Fault]:
    """
    Read an argument of ``--fault``.

    :raises ValueRefused: it makes no sense; says what is allowed.
    """
    name, colon, fault = text.partition(':')
    if not colon:
        raise ValueRefused(f'{text}: write DRIVE:FAULT, for example conveyor:late=0.15')
    if name not in drives:
        raise ValueRefused(f"{text}: no drive '{name}'; drives: {', '.join(drives) or 'none'}")
    try:
        return name, parse_fault(fault)
    except ValueRefused as error:
        raise ValueRefused(f'{text}: {error}') from None


def _duration(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not (math.isfinite(seconds) and seconds > 0):
        raise argparse.ArgumentTypeError(f'{text}: allowed are seconds, more than 0')
    return seconds


def _domain_id(text: str) -> int:
    if not (text.isdecimal() and int(text) <= environment.DOMAIN_ID_MAX):
        raise argparse.ArgumentTypeError(
            f'{text}: allowed are 0 to {environment.DOMAIN_ID_MAX}')
    return int(text)


def _what_is_missing(error: ImportError) -> str:
    module = error.name or str(error)
    if module.startswith('drive_can_bridge'):
        return f'drive_can demo: {error}'
    if module.partition('.')[0] in ('can', 'yaml', 'jsonschema'):
        return f'drive_can demo: the Python module {module} is not installed'
    return NO_ROS.format(module=module)
