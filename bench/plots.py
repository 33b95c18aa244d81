# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the scenarios found as pictures, where matplotlib is there."""

from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import quantiles
from typing import Any

from scenarios import median, p99

#: colours of the bridge and of the do-it-yourself node
COLOURS = {'bridge': 'tab:blue', 'diy': 'tab:orange'}
#: share of its exchanges that makes a point a full circle; others are hollow
HELD = 0.98
LABELS = {'bridge': 'drive_can_bridge', 'diy': 'do-it-yourself node'}


def _pyplot() -> Any:
    """Return what draws, without a screen; None: matplotlib is not installed."""
    try:
        import matplotlib
        matplotlib.use('Agg')
        from matplotlib import pyplot
    except ImportError:
        return None
    return pyplot


def distributions(results: dict[str, list[Any]], path: Path) -> str:
    """
    Draw the distributions of period errors and latencies.

    :return: why not, or ''.
    """
    pyplot = _pyplot()
    if pyplot is None:
        return 'matplotlib is not installed'
    chart, (left, right) = pyplot.subplots(1, 2, figsize=(11, 4.5), layout='constrained')
    curves: list[tuple[Any, str, list[float]]] = []
    for name in ('full', 'subscribed', 'unsubscribed'):
        for run in results.get(name, [])[:1]:
            curves.append((left, f'bridge, {name}', run['bridge']['period_errors']))
            curves.append((left, f'sleeping thread, {name}', run['sleeper']))
    for run in results.get('diy', [])[:1]:
        curves.append((left, 'do-it-yourself node, 8 drives', run['diy']['period_errors']))
    for run in results.get('latency', [])[:1]:
        curves += [(right, 'bridge', run['drive0']), (right, 'bare pair', run['bare'])]
    for run in results.get('service', [])[:1]:
        curves += [(right, 'get_parameters, bridge', run['drive']),
                   (right, 'get_parameters, bare service', run['bare'])]
    for axes, label, samples in curves:
        ordered = sorted(1e3 * max(each, 1e-6) for each in samples)
        shares = [1.0 - place / len(ordered) for place in range(len(ordered))]
        axes.plot(ordered, shares, label=label, drawstyle='steps-post')
    left.set_xlim(left=0.003)
    for axes, title in ((left, 'period error'), (right, 'latency')):
        axes.set(xscale='log', yscale='log', xlabel='ms', title=title,
                 ylabel='share of samples that are worse')
        axes.grid(which='both', alpha=0.3)
        axes.xaxis.set(major_formatter='{x:g}', minor_formatter='{x:g}',
                       minor_locator=pyplot.LogLocator(subs=(2, 5)))
        if axes.lines:
            axes.legend(fontsize='small')
    chart.savefig(path, dpi=110)
    return ''


def sweep(results: dict[str, list[Any]], path: Path) -> str:
    """
    Draw CPU time and period error over the number of drives.

    Lines are medians of all runs; where there are several, the ground goes from the lower quartile
    to the upper one.

    :return: why not, or ''.
    """
    runs, pyplot = results.get('sweep'), _pyplot()
    if pyplot is None or not runs:
        return 'matplotlib is not installed' if runs else 'sweep was not run'
    chart, (left, right) = pyplot.subplots(1, 2, figsize=(9, 3.2), layout='constrained')
    numbers = list(runs[0])

    def over_numbers(name: str, measure: Callable[[dict[str, Any]], float],
                     ) -> Sequence[Sequence[float]]:
        return [[measure(run[number][name]) for run in runs] for number in numbers]
    for name, colour in COLOURS.items():
        held = [median(each) for each in over_numbers(
            name, lambda each: each['requests_per_s'] / each['wanted'])]
        for axes, found in ((left, over_numbers(name, lambda each: 100 * each['cpu'])),
                            (right, over_numbers(
                                name, lambda each: 1e3 * p99(each['period_errors'])))):
            values = [median(each) for each in found]
            axes.plot(numbers, values, color=colour, marker='o', label=LABELS[name])
            if len(runs) > 1:
                ends = [quantiles(each, n=4, method='inclusive') for each in found]
                axes.fill_between(numbers, [low for low, _, _ in ends],
                                  [high for _, _, high in ends], color=colour, alpha=0.2,
                                  linewidth=0)
            late = [place for place, share in enumerate(held) if share < HELD]
            axes.plot([numbers[place] for place in late], [values[place] for place in late], 'o',
                      color=colour, markerfacecolor='white')
    left.set(title='what it costs', ylabel='CPU of the process, % of a core', ylim=(0, None))
    right.set(title='how evenly drives are served', ylabel='period error, p99, ms', yscale='log')
    right.yaxis.set_major_formatter('{x:g}')
    for axes in (left, right):
        axes.set(xlabel='drives, one exchange each 10 ms', xlim=(0, None))
        axes.grid(which='both', alpha=0.3)
    left.legend(fontsize='small')
    if len(runs) > 1:
        chart.suptitle(f'medians and quartiles of {len(runs)} runs', fontsize='small')
    chart.savefig(path, dpi=100)
    return ''
