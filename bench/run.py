# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the bridge costs and how regular it is, each figure beside its floor from the same run.

Rows are printed as they are measured; what fails is told, and the others go on (exit code 1).
Compare the ratios, not the milliseconds: machines differ and are noisy.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
import json
import os
from pathlib import Path
import platform
import sys
from tempfile import TemporaryDirectory
import traceback
from typing import Any

import own_network
import plots
import report
import scenarios
from scenarios import Load

#: numbers of drives for which bridge and do-it-yourself node are compared
SWEEP = (1, 2, 4, 8, 15, 22, 30)
#: share of the time that the hypervisor may take from a scenario, and how often it is measured
STOLEN_MAX, ATTEMPTS = 0.05, 3
#: takes long, and is run when it is named only
NAMED_ONLY = ('builds', 'builds flood', 'builds stop', 'most', 'sweep')

#: what others run as well, and nobody need see twice that it runs
RUN_BY_OTHERS = ('builds stop', 'flood')


@dataclass(frozen=True)
class Pace:
    """How much of everything is measured."""

    calls: int = 300
    stops: int = 200
    commands: int = 10
    rounds: int = 40
    windows: int = 16
    turns: int = 4
    backups: int = 5
    loops: int = 8
    most: tuple[int, ...] = (30,)
    sweep: tuple[int, ...] = SWEEP


#: each scenario for a second or two, to see that it runs
SMOKE = Pace(calls=5, stops=4, commands=1, rounds=2, windows=2, turns=1, backups=1,
             loops=1, most=(2, 3), sweep=(1, 2))


def plan(options: argparse.Namespace) -> dict[str, Callable[[], Any]]:
    """Return the scenarios by name."""
    drives, period, duration = options.drives, options.period, options.duration
    pace = SMOKE if options.smoke else Pace()
    few, stopped = Load(8, 0.01, subscribed=False), Load(
        8, 0.01, subscribed=False, control=True, stuck=True)
    return {
        'full': lambda: scenarios.exchange(Load(drives, period, commands=200.0), duration),
        'subscribed': lambda: scenarios.exchange(Load(drives, period), duration),
        'unsubscribed': lambda: scenarios.exchange(
            Load(drives, period, subscribed=False), duration),
        'ordinary': lambda: scenarios.exchange(
            Load(drives, period, commands=200.0, real_time=False), duration),
        'axes': lambda: scenarios.axes(Load(drives, period, subscribed=False), duration),
        'buses': lambda: scenarios.buses(
            Load(2 * drives, period, commands=800.0, buses=2), duration),
        'most': lambda: scenarios.most(Load(0, 0.01), duration, *pace.most),
        'latency': lambda: scenarios.latency(Load(drives, period), duration),
        'diy': lambda: scenarios.do_it_yourself(Load(8, 0.01, commands=100.0), duration),
        'service': lambda: scenarios.service(Load(1, 0.02, subscribed=False), pace.calls),
        'flood': lambda: scenarios.flood(few, duration, 10000.0),
        'monitor': lambda: scenarios.monitor(
            Load(drives, period, subscribed=False), duration, pace.turns),
        'panel': lambda: scenarios.panel(
            Load(drives, period, subscribed=False, commands=20.0), duration),
        'stop': lambda: scenarios.stop(stopped, pace.stops, 10000.0, 64),
        'gateway': lambda: scenarios.gateway(
            Load(1, 0.02, subscribed=False, servo=True), duration, pace.rounds),
        # a stop without a name would reach every bridge of this machine
        'hand': lambda: own_network.run(lambda: scenarios.by_hand(
            Load(8, 0.01, subscribed=False, control=True), pace.commands, options.beside)),
        'hand hung': lambda: own_network.run(lambda: scenarios.one_hangs(
            Load(8, 0.01, subscribed=False, control=True), pace.commands)),
        'hand busy': lambda: own_network.run(lambda: scenarios.busy_hand(
            Load(8, 0.01, subscribed=False, control=True), 3 * pace.commands, pace.loops)),
        'hand attacked': lambda: own_network.run(lambda: scenarios.attacked_hand(
            Load(8, 0.01, subscribed=False, control=True), duration / 3, pace.rounds)),
        'backup': lambda: scenarios.backup(
            Load(8, 0.01, subscribed=False, settings=119), pace.backups),
        'drives': lambda: {number: scenarios.exchange(
            Load(number, period, subscribed=False), duration, floor=False)
            for number in sorted({1, 4, 8, drives})},
        'alone': lambda: scenarios.exchange(Load(1, 0.01, subscribed=False), duration),
        'flight': lambda: scenarios.flight(
            Load(drives, period, subscribed=False, trace=2 * duration), duration, pace.rounds),
        'joints': lambda: scenarios.joints(
            Load(drives, period, subscribed=False), duration, 100.0, pace.rounds),
        'joint take': lambda: scenarios.joint_take(drives, 1000.0, pace.rounds, options.beside),
        'builds': lambda: scenarios.builds(
            drives, pace.windows, 0.2 * duration, options.beside),
        'builds flood': lambda: scenarios.in_turn(
            lambda python: scenarios.flood(few, duration, 10000.0, python),
            pace.turns, options.beside),
        'builds stop': lambda: scenarios.in_turn(
            lambda python: scenarios.stop(stopped, pace.stops // 2, 10000.0, 64, python),
            pace.turns, options.beside),
        'decode': lambda: scenarios.decode(options.frames),
        'start': lambda: scenarios.start(drives, options.memory_duration),
        'sweep': lambda: scenarios.sweep(pace.sweep, 0.01, duration),
    }


def measured(name: str, scenario: Callable[[], Any],
             attempts: int) -> tuple[Any, float] | None:
    """
    Run a scenario and print its rows; again where the hypervisor took too much.

    :param attempts: how often at most; 1: nobody is going to believe the figures.
    :return: what it found, and the share that the hypervisor took; None: it failed, which is told.
    """
    print(f'{name} …', file=sys.stderr, flush=True)
    try:
        for attempt in range(1, attempts + 1):
            before = processor_times()
            found = scenario()
            stolen, every = (now - then for now, then in zip(processor_times(), before))
            share = stolen / every if every else 0.0
            print('\n'.join(map(report.row, report.figures({name: [found]}, {name: [share]}))),
                  flush=True)
            if share <= STOLEN_MAX or attempts == 1:
                break
            print(f'{name}: the hypervisor took {100 * share:.1f} % of the time, more than '
                  f'{100 * STOLEN_MAX:.0f} %: '
                  + (f'taken again (attempt {attempt + 1} of {attempts})' if attempt < attempts
                     else f'so it did in all of {attempts} attempts, believe it less'),
                  file=sys.stderr, flush=True)
    except (Exception, SystemExit) as error:    # noqa: BLE001  the others are measured all the same
        traceback.print_exc()
        print(f'{name} failed: {type(error).__name__}: {error}', file=sys.stderr, flush=True)
        return None
    return found, share


def processor_times() -> tuple[int, int]:
    """Return what the hypervisor took of all processors, and all of their time, in ticks."""
    try:
        ticks = [int(each) for each in Path('/proc/stat').read_text().split('\n')[0].split()[1:9]]
    except OSError:     # no Linux: nobody knows
        return 0, 0
    return ticks[7], sum(ticks)


def machine() -> str:
    """Describe the machine and how busy it is."""
    model = platform.processor() or platform.machine()
    try:
        for line in Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines():
            if line.startswith('model name'):
                model = line.split(':', 1)[1].strip()
                break
    except OSError:
        pass
    load = ', '.join(f'{value:.1f}' for value in os.getloadavg())
    return (f'{os.cpu_count()} × {model}, Python {platform.python_version()}, '
            f'load average {load}')


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('scenarios', nargs='*',
                        help=f'which ones (default: all but {", ".join(NAMED_ONLY)})')
    parser.add_argument('--drives', type=int, default=15)
    parser.add_argument('--period', type=float, default=0.005, help='s')
    parser.add_argument('--duration', type=float, default=5.0, help='s of each measurement')
    parser.add_argument('--memory-duration', type=float, default=60.0, help='s')
    parser.add_argument('--frames', type=int, default=1_000_000, help='of a trace to decode')
    parser.add_argument('--repeat', type=int, default=1, help='runs; the median one is shown')
    parser.add_argument('--beside', metavar='PYTHON', default='', help=(
        'of another build (its .venv/bin/python): `hand` measures its commands as well, what '
        'begins with `builds` its bridge, `joint take` how it takes commands'))
    parser.add_argument('--bridge', metavar='PYTHON', default=sys.executable, help=(
        'of the build whose bridge is measured (default: this one); bare loops are of this one'))
    parser.add_argument('--json', type=Path, help='write figures and samples to this file')
    parser.add_argument('--plot', type=Path, help='write the distributions to this PNG file')
    parser.add_argument('--sweep-plot', type=Path,
                        help='write CPU and period error over the number of drives to this PNG')
    parser.add_argument('--smoke', action='store_true',
                        help='every scenario, for a second each: does it run?')
    options = parser.parse_args(arguments)
    scenarios.BUILD = options.bridge
    if options.smoke:
        options.drives, options.period, options.duration = 2, 0.02, 1.0
        options.memory_duration, options.frames = 1.0, 20_000
        scenarios.SETTLE = 0.5
    planned = plan(options)
    unknown = [name for name in options.scenarios if name not in planned]
    if unknown:
        parser.error(f'{", ".join(unknown)}: allowed are {", ".join(planned)}')
    begun = machine()
    logs = TemporaryDirectory(prefix='drive_can_bridge_bench_log_')
    os.environ.setdefault('ROS_LOG_DIR', logs.name)     # nobody wants them later
    results: dict[str, list[Any]] = {}
    stolen: dict[str, list[float]] = {}
    left_out = RUN_BY_OTHERS if options.smoke else NAMED_ONLY
    names = options.scenarios or [each for each in planned if each not in left_out]
    failed: list[str] = []
    print(f'before: {begun}\n\n{report.HEAD}', flush=True)
    try:
        for name in names * options.repeat:
            found = measured(name, planned[name], 1 if options.smoke else ATTEMPTS)
            if found is None:
                failed.append(name)
            else:
                results.setdefault(name, []).append(found[0])
                stolen.setdefault(name, []).append(found[1])
    except KeyboardInterrupt:
        print('ended early', file=sys.stderr)
    lines = report.figures(results, stolen)
    if options.repeat > 1:
        print('\nmedians:\n\n' + '\n'.join([report.HEAD, *map(report.row, lines)]))
    print(f'\nafter:  {machine()}')
    if options.json:
        options.json.write_text(json.dumps(
            {'machine': begun, 'figures': report.as_json(lines), 'results': results}))
    for draw, path in ((plots.distributions, options.plot), (plots.sweep, options.sweep_plot)):
        reason = draw(results, path) if path else ''
        if reason:
            print(f'no plot: {reason}', file=sys.stderr)
    if failed:
        print(f'failed: {", ".join(failed)}', file=sys.stderr)
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
