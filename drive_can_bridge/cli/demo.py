# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can demo``: simulated drives, a bridge and the live view, each a process of its own.

Needs rclpy, but no hardware, no root and no kernel module.
"""

import argparse
import math
from pathlib import Path
import sys
from typing import Any

from drive_can_bridge.cli.without_ros import what_is_missing
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.errors import DriveCanError, ValueRefused
from drive_can_bridge.process import environment
from drive_can_bridge.process.signals import SignalWatcher
from drive_can_bridge.resources import config_file
from drive_can_bridge.simulation.faults import parse_fault, usage_lines
from drive_can_bridge.simulation.simulation import Simulation

WRONG_USAGE = 2
PARAMETER_FILE = 'demo.yaml'


def add_parser(subparsers: Any) -> None:
    """Add the subcommand to the parser of ``drive_can``."""
    faults = '\n'.join(usage_lines())
    parser = subparsers.add_parser(
        'demo', help='run a bridge, simulated drives and the live view of them',
        description='Run simulated drives, a bridge for them and the view of drive_can monitor, '
                    'until SIGINT or SIGTERM. In a terminal the view is live; elsewhere it is one '
                    'line per drive and second.',
        epilog=f'faults:\n{faults}\n\nROS traffic stays on this machine unless '
               f'{environment.DISCOVERY_RANGE} says otherwise.',
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--params-file', metavar='FILE', type=Path,
                        help='parameter file of a bridge, instead of the one of the demo; its '
                             'buses are replaced by pseudo-terminals')
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
            # what the other processes import: better to know now
            from drive_can_bridge.ros.demo import commander  # noqa: F401
        except ImportError as error:
            raise DriveCanError(what_is_missing('drive_can demo', error)) from error
        # imported late: it reads schemas, and --help needs none
        from drive_can_bridge.configuration.load import configuration_from_file
        from drive_can_bridge.demo.run import Options, run as run_demo
        configuration = configuration_from_file(args.params_file or config_file(PARAMETER_FILE))
        for warning in configuration.warnings:
            print(f'warning: {warning}', file=sys.stderr)
        try:
            for text in args.fault:
                _check_fault(text, configuration)
        except ValueRefused as error:
            print(f'drive_can demo: --fault {error}', file=sys.stderr)
            return WRONG_USAGE
        return watcher.exit_code(run_demo(Options(
            configuration, tuple(args.fault), args.drive, args.log_frames, args.duration),
            watcher))


def _check_fault(text: str, configuration: BridgeConfiguration) -> None:
    """
    Look at an argument of ``--fault``.

    :raises ValueRefused: it makes no sense; says what is allowed.
    """
    name, colon, fault = text.partition(':')
    if not colon:
        raise ValueRefused(f'{text}: write DRIVE:FAULT, for example conveyor:late=0.15')
    drives = configuration.drives
    if name not in drives:
        raise ValueRefused(f"{text}: no drive '{name}'; drives: {', '.join(drives) or 'none'}")
    try:
        Simulation(configuration).drives[name].fault(parse_fault(fault))
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
