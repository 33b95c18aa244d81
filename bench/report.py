# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Figures from what the scenarios found, as a table."""

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
import math
from typing import Any

from scenarios import median, p99, ratio


@dataclass(frozen=True)
class Figure:
    """
    One line of the table.

    :param value: as measured; ``floor``: beside it; ``goal``: of ``judged``, at most.
    :param stolen: share of the time that the hypervisor gave to others meanwhile.
    """

    name: str
    value: str
    floor: str
    judged: float
    goal: float
    at_least: bool = False
    stolen: float = 0.0

    @property
    def met(self) -> bool:
        """The goal is reached."""
        return self.judged >= self.goal if self.at_least else self.judged <= self.goal


def exchange_figures(found: dict[str, Any], name: str, goal: float,
                     c_goal: float = math.inf) -> list[Figure]:
    """CPU, exchanges held, period."""
    bridge, floor = found['bridge'], found['floor']
    cpu = _per_exchange(bridge, 'process_cpu')
    beside = [Figure(f'CPU of the process per exchange, {name}, beside {language}',
                     f'{1e6 * cpu:.0f} µs', f'{1e6 * floor_cpu:.0f} µs',
                     ratio(cpu, floor_cpu), each)
              for key, language, each in (('floor', 'Python', goal), ('c_floor', 'C', c_goal))
              if key in found for floor_cpu in [_per_exchange(found[key], 'cpu')]]
    parts = ', '.join(f'{thread} {1e6 * value / max(1, bridge["exchanges"]):.0f}'
                      for thread, value in bridge['cpu'].items())
    period, sleeping = p99(bridge['period_errors']), p99(found['sleeper'])
    held = bridge['exchanges'] / bridge['elapsed']
    return [
        *(replace(line, value=f'{line.value} ({parts})') for line in beside[:1]), *beside[1:],
        Figure(f'exchanges/s, {name}', f'{held:.0f}', f'{bridge["missed"]} missed',
               held if not bridge['missed'] else 0.0, 0.9967 * found['wanted'], at_least=True),
        Figure(f'period error p99, {name}', f'{1e3 * period:.3f} ms',
               f'sleeping {1e3 * sleeping:.3f} ms, bare loop '
               f'{1e3 * p99(floor["period_errors"]):.3f} ms', ratio(period, sleeping), 2.0),
    ]


def _per_exchange(found: dict[str, Any], cpu: str) -> float:
    return float(found[cpu] / max(1, found['exchanges']))


def axes_figures(found: dict[str, Any]) -> list[Figure]:
    """Axes of CiA 402 beside 29-bit drives."""
    axes, drives = found['axes'], found['drives']
    cpu, floor = (1e6 * each['process_cpu'] / max(1, each['exchanges']) for each in (axes, drives))
    return [
        Figure('CPU of the process per exchange, csp axes with SYNC', f'{cpu:.0f} µs',
               f'29-bit drives {floor:.0f} µs', ratio(cpu, floor), 1.5),
        Figure('exchanges missed, csp axes with SYNC',
               f'{axes["missed"]} of {axes["exchanges"]}, period error p99 '
               f'{1e3 * p99(axes["period_errors"]):.2f} ms',
               f'29-bit drives {drives["missed"]} of {drives["exchanges"]}, '
               f'{1e3 * p99(drives["period_errors"]):.2f} ms',
               axes['missed'], drives['missed']),
    ]


def buses_figures(found: dict[str, Any]) -> list[Figure]:
    """Two full buses."""
    figures = []
    for name, result in found.items():
        held = result['exchanges_per_s'] / result['wanted']
        figures.append(Figure(
            f'exchanges/s held, two full buses, {name}',
            f'{result["exchanges_per_s"]:.0f} ({result["missed"]} missed, '
            f'{100 * result["cpu"]:.0f} % of a core, period error p99 '
            f'{1e3 * p99(result["period_errors"]):.2f} ms)',
            f'{result["wanted"]:.0f}', held if not result['missed'] else 0.0, 0.995,
            at_least=True))
    return figures


def diy_figures(found: dict[str, Any]) -> list[Figure]:
    """Against the node of an ordinary user."""
    bridge, diy = found['bridge'], found['diy']
    return [
        Figure('CPU of the process, do-it-yourself node / bridge', f'{100 * bridge["cpu"]:.0f} %',
               f'{100 * diy["cpu"]:.0f} %', ratio(diy['cpu'], bridge['cpu']), 3.5, at_least=True),
        Figure('period error p99 at the drive, bridge / do-it-yourself',
               f'{1e3 * p99(bridge["period_errors"]):.3f} ms '
               f'({bridge["requests_per_s"]:.0f} requests/s)',
               f'{1e3 * p99(diy["period_errors"]):.3f} ms '
               f'({diy["requests_per_s"]:.0f} requests/s)',
               ratio(p99(bridge['period_errors']), p99(diy['period_errors'])), 1.0),
    ]


def gateway_figures(found: dict[str, Any]) -> list[Figure]:
    """Judge an axis behind a gateway on the loopback."""
    shares = {name: found[name]['missed'] / max(1, found[name]['exchanges'])
              for name in ('tuned', 'not tuned')}
    return [
        Figure('exchanges missed behind a gateway, one axis every 20 ms',
               f'{100 * shares["tuned"]:.1f} %', f'without tcp_tune '
               f'{100 * shares["not tuned"]:.1f} %', 100 * shares['tuned'], 3.0),
        Figure('the same, `tcp_tune: false`', f'{100 * shares["not tuned"]:.1f} %', '',
               100 * shares['not tuned'], 30.0, at_least=True),
        Figure('call of a stop to its frame behind the gateway, worst',
               f'{1e3 * max(found["stops"], default=math.inf):.1f} ms of {len(found["stops"])} '
               f'(median {1e3 * median(found["stops"]):.1f}; {len(found["failures"])} failed)',
               '', 1e3 * max(found['stops'], default=math.inf), 50.0),
    ]


def sweep_figures(found: dict[int, Any]) -> list[Figure]:
    """Against the node of an ordinary user, by the number of drives."""
    return [Figure(f'{name.split(",")[0]}, {number} drives', *rest)
            for number, each in found.items()
            for name, *rest in ((line.name, line.value, line.floor, line.judged,
                                 1.0, line.at_least) for line in diy_figures(each))]


def latency_figures(found: dict[str, list[float]]) -> list[Figure]:
    """From frame to callback."""
    drive, bare = median(found['drive0']), median(found['bare'])
    return [Figure('frame to callback, median', f'{1e3 * drive:.3f} ms', f'{1e3 * bare:.3f} ms',
                   drive / bare, 1.25)]


def service_figures(found: dict[str, list[float]]) -> list[Figure]:
    """Parameter services."""
    drive, bare = median(found['drive']), median(found['bare'])
    exchange = found['exchange']
    return [Figure('get_parameters, median', f'{1e3 * drive:.3f} ms',
                   f'{1e3 * bare:.3f} ms + exchange {1e3 * exchange:.3f} ms',
                   drive / (bare + exchange), 1.2)]


def flood_figures(found: dict[str, Any]) -> list[Figure]:
    """Regularity in a flood."""
    quiet, flood = (p99(found[name]['period_errors']) for name in ('quiet', 'flood'))
    sleeping = [p99(found[name]['sleeper']) for name in ('quiet', 'flood')]
    return [Figure(f'period error p99 in a flood ({found["calls"]} calls answered)',
                   f'{1e3 * flood:.3f} ms ({found["flood"]["missed"]} missed)',
                   f'{1e3 * quiet:.3f} ms; sleeping {1e3 * sleeping[1]:.3f}, '
                   f'{1e3 * sleeping[0]:.3f} ms', ratio(flood, quiet), 2.0)]


def monitor_figures(found: dict[str, Any]) -> list[Figure]:
    """Monitor: what a bridge notices of it, and what it takes."""
    before, beside = found['without'], found['with']
    periods = [p99(each['period_errors']) for each in (before, beside)]
    shares = [each['cpu'] / each['elapsed'] for each in (before, beside)]
    return [
        Figure('period error p99 with a monitor', f'{1e3 * periods[1]:.3f} ms',
               f'without {1e3 * periods[0]:.3f} ms', ratio(periods[1], periods[0]), 1.1),
        Figure('exchanges missed with a monitor', str(beside['missed']),
               f'without {before["missed"]}', beside['missed'], 0.0),
        Figure('CPU of the bridge with a monitor', f'{100 * shares[1]:.1f} %',
               f'without {100 * shares[0]:.1f} %', ratio(shares[1], shares[0]), 1.25),
        Figure('CPU of the monitor, of one core', f'{100 * median(found["monitor"]):.1f} %', '',
               median(found['monitor']), 0.1),
    ]


def panel_figures(found: dict[str, Any]) -> list[Figure]:
    """Panel: what it takes, for whoever looks."""
    lines = []
    for name, who in (('nobody', 'nobody looks'), ('overview', 'one browser, all drives'),
                      ('drive', 'one browser, one drive and its chart')):
        one = found[name]
        lines.append(Figure(f'CPU of the panel, of one core, {who}', f'{100 * one["cpu"]:.1f} %',
                            f'{one["messages"]:.1f} messages/s', one['cpu'], 0.05))
    for name in ('overview', 'drive'):
        seconds = found[name]['live']
        lines.append(Figure(f'a page ({name}), asked for until it is live', f'{seconds:.2f} s', '',
                            seconds, 2.0))
    resident, own = found['drive']['mb']
    return [*lines, Figure('memory of the panel', f'{resident:.0f} MB', f'its own {own:.0f} MB',
                           resident, 120.0)]


def stop_figures(found: dict[str, Any]) -> list[Figure]:
    """From the call of a stop to its frame."""
    figures = []
    for name, how in (('quiet', 'in quiet'), ('load', f'under load ({found["calls"]} calls '
                                                      f'answered)')):
        samples = found[name]['latencies']
        failures = Counter(found[name]['failures'])
        failed = ''.join(f', {count} failed ({what})' for what, count in failures.items())
        figures.append(Figure(
            f'call of a stop to its frame, p99, {how}',
            f'{1e3 * p99(samples):.1f} ms (median {1e3 * median(samples):.1f}, worst '
            f'{1e3 * max(samples, default=float("nan")):.1f} ms of {len(samples)}{failed})',
            f'sleeping {1e3 * p99(found[name]["sleeper"]):.3f} ms', p99(samples), 0.05))
    return figures


def hand_figures(found: dict[str, Any]) -> list[Figure]:
    """Commands that a person types, beside clients that call one service."""
    names = {'stop': '`drive_can stop`, Enter to the first stop frame',
             'stop done': '`drive_can stop`, Enter to its end',
             'read': '`drive_can read` of one value', 'write': '`drive_can write` of one value'}
    goals = {'stop': 1 / 25, 'stop done': 1 / 15, 'read': 1 / 12, 'write': 1 / 12}
    other_goals = {'stop': 1 / 40, 'stop done': 1 / 20, 'read': 1 / 15, 'write': 1 / 15}
    failed = f', {found["failed"]} failed' if found['failed'] else ''
    figures = [Figure(text, _spread(found[name]['ours']),
                      f'{who} {_spread(found[name][key])}{failed}',
                      math.inf if failed else (
                          median(found[name]['ours']) / median(found[name][key])), goal)
               for name, text in names.items()
               for key, who, goal in (('bare', 'bare client', goals[name]),
                                      ('other', 'the other build', other_goals[name]))
               if key in found[name]]
    stop, floor = median(found['stop']['ours']), median(found['floor'])
    return [*figures, Figure(f'{names["stop"]}, beside a Python that starts', f'{stop:.3f} s',
                             f"`python3 -c 'import socket'` {_spread(found['floor'])}",
                             stop / floor, 1.5)]


def _spread(samples: list[float]) -> str:
    return f'{median(samples):.3f} ({min(samples):.3f}–{max(samples):.3f}) s'


def hung_hand_figures(found: dict[str, Any]) -> list[Figure]:
    """Stop where one of two bridges is suspended."""
    named = f'named {found["named"]} times of {len(found["done"])}'
    return [
        Figure('`drive_can stop`, one of two bridges suspended: stop frame of the other',
               _spread(found['stop']), '', median(found['stop']), 0.1),
        Figure('the same, to its end: who hangs is named', _spread(found['done']), named,
               median(found['done']), 1.2)]


def busy_hand_figures(found: dict[str, Any]) -> list[Figure]:
    """Stop at low priority on a busy computer."""
    return [Figure(f'`nice drive_can stop` beside {found["loops"]} busy loops, to its end',
                   _spread(found['done']),
                   f'{found["failed"]} of {len(found["done"])} were not answered well',
                   max(found['done']) if not found['failed'] else math.inf, 1.0)]


def attacked_hand_figures(found: dict[str, Any]) -> list[Figure]:
    """Tell what others who do harm by the local way cost the exchange, and a hand."""
    calm = found['calm']
    figures = []
    for kind, what in (('talk', 'nonsense by the local way, half of it of another user'),
                       ('call', '200 callers at once for a stop, and 200 of another user')):
        each = found[kind]
        failed = f', {each["failed"]} failed' if each['failed'] else ''
        figures += [
            Figure(f'period error under {what}, p99', f'{1e3 * p99(each["period_errors"]):.3f} ms',
                   f'the same processes compute: {1e3 * p99(calm["period_errors"]):.3f} ms',
                   p99(each['period_errors']) / p99(calm['period_errors']), 1.25),
            Figure('the same: exchanges missed', f'{each["missed"]} of {each["exchanges"]}',
                   f'{calm["missed"]} of {calm["exchanges"]}; {each["said"]} things were said',
                   each['missed'] / each['exchanges'] - calm['missed'] / calm['exchanges'], 0.001),
            Figure('the same: `drive_can stop` to its end', f'{_spread(each["stops"])}{failed}',
                   _spread(calm['stops']), math.inf if failed else (
                       median(each['stops']) / median(calm['stops'])), 1.5)]
    return figures


def backup_figures(found: dict[str, Any]) -> list[Figure]:
    """How long a backup takes, and what a bridge misses while one is made through it."""
    runs = sorted(found['backups'], key=lambda each: each['elapsed'] / each['spent'])
    middle = runs[len(runs) // 2]
    during, quiet, through = found['during'], found['quiet'], found['through']
    failed = sum(each['failed'] for each in (*runs, *through))
    periods = [p99(each['period_errors']) for each in (during, quiet)]
    return [
        Figure(f'backup of {middle["settings"]} parameters at 125 kbit/s',
               f'{middle["elapsed"]:.3f} s', f'frames and answers {middle["spent"]:.3f} s',
               middle['elapsed'] / middle['spent'] if not failed else math.inf, 1.3),
        Figure('exchanges missed while backups are made through a bridge',
               f'{during["missed"]} of {during["exchanges"]}, {len(through)} backups of '
               f'{median([each["elapsed"] for each in through]):.3f} s, period error p99 '
               f'{1e3 * periods[0]:.3f} ms',
               f'in quiet {quiet["missed"]} of {quiet["exchanges"]}, {1e3 * periods[1]:.3f} ms',
               during['missed'], 0.0),
    ]


def drives_figures(found: dict[str, dict[str, Any]]) -> list[Figure]:
    """Cost by number of drives."""
    costs = {int(number): _per_exchange(each['bridge'], 'process_cpu')
             for number, each in found.items()}
    services = {int(number): each['bridge']['cpu']['services'] / each['bridge']['elapsed']
                for number, each in found.items()}
    least, most = min(costs), max(costs)
    idle = (services[most] - services[least]) / (most - least)
    return [
        Figure('CPU per exchange by drives',
               ', '.join(f'{number}: {1e6 * cost:.0f} µs' for number, cost in costs.items()),
               'linear: no more than with few', ratio(costs[most], costs[sorted(costs)[1]]), 1.1),
        Figure('service executor per drive',
               f'{1e3 * idle:.2f} ms/s', 'nothing', 1e2 * idle, 0.1),
    ]


def most_figures(found: dict[str, Any]) -> list[Figure]:
    """How many drives one core holds."""
    tried = '; '.join(f'{number}: ' + ', '.join(
        each.get('why') or f'{each["missed"]} missed, {100 * each["cpu"]:.0f} %' for each in runs)
        for number, runs in sorted(found['tried'].items()))
    return [Figure('drives every 10 ms on one core, every topic subscribed, none missed',
                   str(found['most']), f'tried {tried}', found['most'], 30.0, at_least=True)]


def decode_figures(found: dict[str, dict[str, float]]) -> list[Figure]:
    """Rate at which a long trace is decoded, and memory."""
    figures = []
    for what in ('lines', '--summary'):
        long, short = found[f'long {what}'], found[f'short {what}']
        elapsed = long['elapsed'] - short['elapsed']    # without the start of the program
        rate = (long['frames'] - short['frames']) / elapsed
        figures += [
            Figure(f'frames/s decoded, {what}', f'{rate:.0f}',
                   f'{1e6 * long["cpu"] / long["frames"]:.1f} µs of CPU each', rate, 50_000.0,
                   at_least=True),
            Figure(f'memory of decode, {what}', f'{long["resident_mb"]:.1f} MB',
                   f'{short["resident_mb"]:.1f} MB for a twentieth of the trace',
                   long['resident_mb'] / short['resident_mb'], 1.05)]
    return figures


def flight_figures(found: dict[str, Any]) -> list[Figure]:
    """Cost of the flight recorder, and what it disturbs."""
    recording, writing, trace = found['recording'], found['writing'], found['trace']
    periods = [p99(each['period_errors']) for each in (writing, recording)]
    return [
        _beside_figure('CPU with the flight recorder', found['share'], 1.03),
        Figure('exchanges missed while a trace is written',
               f'{writing["missed"]} of {writing["exchanges"]}, {trace["frames"]} frames in '
               f'{trace["elapsed"]:.1f} s, period error p99 {1e3 * periods[0]:.3f} ms',
               f'{recording["missed"]} of {recording["exchanges"]}, '
               f'{1e3 * periods[1]:.3f} ms', writing['missed'], 0.0),
    ]


def joints_figures(found: dict[str, Any]) -> list[Figure]:
    """Compare a bridge with and one without the messages of all joints, by pairs."""
    return [_beside_figure(f'CPU with all joints in one message, 100 Hz, {name}', found[name],
                           goal)
            for name, goal in (('states', 1.05), ('states and commands', 1.3))]


def joint_take_figures(found: dict[str, Any]) -> list[Figure]:
    """Judge the way of a message for all joints, beside that of rclpy alone and another build."""
    ours = found['ours']
    figures = [Figure(
        'a joint command, taken, its age judged, and read', _microseconds(ours['bridge']),
        f'taken by rclpy as bytes {_microseconds(ours["rclpy"])}',
        _by_pairs(ours['bridge'], ours['rclpy']), 5.0)]
    if 'other' in found:
        figures += [Figure(
            f'{name}, beside the other build', _microseconds(ours[key]),
            _microseconds(found['other'][key]), _by_pairs(ours[key], found['other'][key]), 0.2)
            for key, name in (('read', 'a joint command, read'), ('bridge', 'the same, taken and '
                                                                  'its age judged, too'))]
    return figures


def _microseconds(samples: list[float]) -> str:
    return f'{median(samples):.1f} ({min(samples):.1f}–{max(samples):.1f}) µs'


def _by_pairs(ours: list[float], others: list[float]) -> float:
    """Return the median of the ratios of what was measured one right after the other."""
    return median([one / other for one, other in zip(ours, others) if other])


def _beside_figure(name: str, pairs: list[tuple[float, float]], goal: float) -> Figure:
    """Compare two bridges that ran at the same time."""
    with_it, without = (median([pair[place] for pair in pairs]) for place in (0, 1))
    return Figure(name, f'{100 * with_it:.1f} %', f'without {100 * without:.1f} %',
                  median([one / other for one, other in pairs if other]), goal)


def builds_figures(found: dict[str, list[tuple[float, float]]]) -> list[Figure]:
    """Compare this build and another that ran at the same time."""
    goals = {'nobody subscribed': 0.82, 'subscribed': 0.91, 'subscribed, commands': 0.94,
             'one drive': math.inf}
    figures = []
    for name, pairs in found.items():
        ratios = sorted(one / other for one, other in pairs if other)
        ours, theirs = (median([pair[place] for pair in pairs]) for place in (0, 1))
        low, high = (ratios[round(share * (len(ratios) - 1))] for share in (0.25, 0.75))
        figures.append(Figure(
            f'CPU of two builds at the same time, {name}', f'{100 * ours:.1f} % (half of '
            f'{len(ratios)} ratios: {low:.2f} to {high:.2f})',
            f'the other build {100 * theirs:.1f} %', median(ratios), goals[name]))
    return figures


def builds_flood_figures(found: list[list[dict[str, Any]]]) -> list[Figure]:
    """Compare the periods of this build and of another, in quiet and in a flood."""
    return _two_builds(found, 'period_errors', 'period error p99', ('quiet', 'flood'))


def builds_stop_figures(found: list[list[dict[str, Any]]]) -> list[Figure]:
    """Compare stops of this build and of another, in quiet and under load."""
    return _two_builds(found, 'latencies', 'call of a stop to its frame, p99', ('quiet', 'load'))


def _two_builds(found: list[list[dict[str, Any]]], samples: str, what: str,
                whens: tuple[str, ...]) -> list[Figure]:
    figures = []
    for when in whens:
        runs = [[run[when] for run in build] for build in found]
        each = [p99([sample for run in build for sample in run[samples]]) for build in runs]
        missed = [sum(run['missed'] for run in build) for build in runs]
        texts = []
        for build, worst, number in zip(runs, each, missed):
            middle = median([sample for run in build for sample in run[samples]])
            apart = ', '.join(f'{1e3 * p99(run[samples]):.2f}' for run in build)
            failed = ''.join(f', {count} failed ({why})' for why, count in Counter(
                why for run in build for why in run.get('failures', ())).items())
            texts.append(f'{1e3 * worst:.2f} ms (each time {apart}; median {1e3 * middle:.2f}; '
                         f'{number} of {sum(run["exchanges"] for run in build)} exchanges missed'
                         f'{failed})')
        figures.append(Figure(f'{what}, {when}, two builds in turn', texts[0],
                              f'the other build {texts[1]}', ratio(*each), 1.0))
    return figures


def start_figures(found: dict[str, Any]) -> list[Figure]:
    """Start and memory."""
    memory = found['resident_mb']
    further = ((found['resident_mb_twice'] - found['resident_mb_one'])
               / (2 * found['drives'] - 1))
    return [
        Figure('begin of the bridge to the first exchange of all',
               f'{found["first_exchange_s"]:.2f} s', f'bare nodes {found["bare_nodes_s"]:.2f} s',
               found['first_exchange_s'], 1.0),
        Figure('resident memory', f'{memory[-1]:.0f} MB', f'bare nodes '
               f'{found["bare_nodes_mb"]:.0f} MB', memory[-1], 105.0),
        Figure('memory of each further drive', f'{further:.2f} MB',
               f'one drive {found["resident_mb_one"]:.0f} MB, '
               f'{2 * found["drives"]} drives {found["resident_mb_twice"]:.0f} MB', further, 0.7),
        Figure('its growth', f'{memory[-1] - memory[1]:+.1f} MB', f'from {memory[1]:.1f} MB',
               memory[-1] - memory[1], 1.0),
    ]


FIGURES: dict[str, Callable[[Any], list[Figure]]] = {
    'full': lambda found: exchange_figures(found, 'subscribed, commands', 1.4),
    'subscribed': lambda found: exchange_figures(found, 'subscribed', 1.3, 2.3),
    'unsubscribed': lambda found: exchange_figures(found, 'nobody subscribed', 1.2),
    'ordinary': lambda found: exchange_figures(found, 'all of it at ordinary priority', 1.5),
    'axes': axes_figures, 'diy': diy_figures, 'sweep': sweep_figures, 'buses': buses_figures,
    'latency': latency_figures, 'service': service_figures,
    'flood': flood_figures, 'stop': stop_figures, 'gateway': gateway_figures,
    'hand': hand_figures, 'hand hung': hung_hand_figures, 'hand busy': busy_hand_figures,
    'hand attacked': attacked_hand_figures,
    'monitor': monitor_figures,
    'alone': lambda found: exchange_figures(found, 'one drive, nobody subscribed', 1.5),
    'most': most_figures, 'panel': panel_figures, 'backup': backup_figures,
    'drives': drives_figures, 'builds': builds_figures,
    'builds flood': builds_flood_figures, 'builds stop': builds_stop_figures,
    'decode': decode_figures,
    'flight': flight_figures, 'joints': joints_figures,
    'joint take': joint_take_figures, 'start': start_figures,
}


def figures(results: dict[str, list[Any]],
            stolen: dict[str, list[float]]) -> list[Figure]:
    """Return the figures of each scenario; of several runs the one with the median ratio."""
    lines = []
    for name, runs in results.items():
        for same in zip(*([replace(figure, stolen=share) for figure in FIGURES[name](run)]
                          for run, share in zip(runs, stolen[name]))):
            ordered = sorted(same, key=lambda figure: (
                math.isnan(figure.judged), figure.judged))
            lines.append(ordered[len(ordered) // 2])
    return lines


HEAD = ('| figure | measured | beside it | ratio or value | goal | met | stolen |\n'
        + '|' + '---|' * 7)


def row(line: Figure) -> str:
    """Return a row of a table in Markdown."""
    return (f'| {line.name} | {line.value} | {line.floor} | {line.judged:.3g} '
            + (f'| {"≥" if line.at_least else "≤"} {line.goal:g} | {"yes" if line.met else "no"} '
               if math.isfinite(line.goal) else '| | ') +
            f'| {100 * line.stolen:.1f} % |')


def as_json(lines: list[Figure]) -> list[dict[str, Any]]:
    """Return the figures as plain data."""
    return [{**asdict(line), 'met': line.met} for line in lines]
