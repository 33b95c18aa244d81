# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can demo``: simulated drives, a bridge and the live view, each a process of its own.

Needs rclpy, but no hardware, no root and no kernel module.
"""

import argparse
from pathlib import Path
import sys
from threading import Event

from drive_can_bridge.cli.command import above_zero, of_drive, what_is_missing, whole, WrongUsage
from drive_can_bridge.core.errors import DriveCanError, ValueRefused
from drive_can_bridge.process import environment
from drive_can_bridge.process.signals import SignalWatcher
from drive_can_bridge.resources import config_file
from drive_can_bridge.simulation.faults import parse_fault, usage_lines
from drive_can_bridge.simulation.simulation import Simulation

PARAMETER_FILE = 'demo.yaml'


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
                        help='command the drives, too: arm, enable, then a slow sine')
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
    with SignalWatcher(refuse=suspension.set) as watcher:
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
        for text in args.fault:
            name, fault = of_drive('--fault', text, configuration, parse_fault)
            try:
                Simulation(configuration, args.clock).drives[name].fault(fault)
            except ValueRefused as error:
                raise WrongUsage(f'--fault {text}: {error}') from None
        return watcher.exit_code(run_demo(Options(
            configuration, tuple(args.fault), args.drive, args.log_frames, args.duration),
            watcher, suspension, args.clock))
