# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What an exchange costs, how regular it is, and how soon a subscriber knows.

Every figure stands beside its floor, measured in the same run on the same machine: compare the
ratios, not the milliseconds. The drives and the subscriber are processes of their own.
"""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import json
from pathlib import Path
import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any

from floor import run_can_floor, run_ros_floor, sleeping_thread
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from unix_bus import INTERFACE, register

HERE = Path(__file__).resolve().parent
TOPICS = 'actual_speed:double,motor_current:double,actual_position:double,digital_inputs:integer'


class Subscriber:
    """The subscribing process."""

    def __init__(self, prefixes: list[str], drives: int) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(HERE / 'subscriber.py'), ','.join(prefixes), str(drives),
             TOPICS], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._read()

    def clear(self) -> None:
        """Begin a measurement."""
        self._write('clear')

    def ask(self) -> dict[str, Any]:
        """Return latencies in s and message counts by prefix."""
        self._write('ask')
        answer: dict[str, Any] = json.loads(self._read())
        return answer

    def close(self) -> None:
        """End the process."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        self._process.wait(timeout=10)

    def _write(self, line: str) -> None:
        if self._process.stdin is None:
            raise RuntimeError('no pipe')
        self._process.stdin.write(line + '\n')
        self._process.stdin.flush()

    def _read(self) -> str:
        if self._process.stdout is None:
            raise RuntimeError('no pipe')
        return self._process.stdout.readline()


@contextmanager
def drives_process(path: str) -> Iterator[None]:
    """Run the answering drives on a Unix socket."""
    process = subprocess.Popen([sys.executable, str(HERE / 'drives.py'), path],
                               stdout=subprocess.PIPE, text=True)
    try:
        if process.stdout is not None:
            process.stdout.readline()
        yield
    finally:
        process.terminate()
        process.wait()


def parameter_file(path: Path, channel: str, drives: int, period: float) -> None:
    """Write the bridge's parameter file."""
    lines = ['/**/drive_can_bridge:', '  ros__parameters:', '    buses:', '      main:',
             f'        interface: {INTERFACE}', f'        channel: {channel}',
             '        bitrate: 1000000', '    drives:']
    for number in range(drives):
        lines += [f'      drive{number}:', '        bus: main',
                  '        protocol: datamodel_extended', f'        station: {number + 1}',
                  f'        profile: {HERE / "profile.yaml"}', f'        period: {period}',
                  '        cyclic_request: [speed_setpoint, torque_limit, position_setpoint, '
                  'digital_outputs]',
                  '        cyclic_response: [actual_speed, motor_current, actual_position, '
                  'digital_inputs]']
    path.write_text('\n'.join(lines) + '\n')


def run_bridge(path: Path, duration: float) -> dict[str, Any]:
    """Run the bridge for a while; return CPU per exchange and period errors in s."""
    from drive_can_bridge.ros.bridge_node import BridgeNode
    from drive_can_bridge.ros.executor_thread import ExecutorThread
    context = Context()
    rclpy.init(args=['bench', '--ros-args', '--params-file', str(path)], context=context)
    spinner = ExecutorThread('services', print, context)
    bridge = BridgeNode(spinner.executor, print, context=context)
    spinner.start()
    if not bridge.start():
        raise SystemExit('the bridge did not start')
    sessions = [drive.session for drive in bridge.drives.values()]
    wait(lambda: all(session.online for session in sessions), 10.0)
    wait_quietly(1.5)  # discovery and first publishes are not what is measured
    exchange = bridge.exchanges['main']
    threads = [exchange._thread, exchange.link._thread, spinner._thread]
    for session in sessions:
        session.statistics.period_error.__init__()  # type: ignore[misc]
    before_cpu = [thread_cpu(thread) for thread in threads]
    before = sum(session.statistics.exchanges for session in sessions)
    missed_before = sum(session.statistics.missed for session in sessions)
    started = time.monotonic()
    wait_quietly(duration)
    elapsed = time.monotonic() - started
    cpu = [thread_cpu(thread) - earlier for thread, earlier in zip(threads, before_cpu)]
    exchanges = sum(session.statistics.exchanges for session in sessions) - before
    result = {
        'exchanges': exchanges, 'exchanges_per_s': exchanges / elapsed,
        'missed': sum(session.statistics.missed for session in sessions) - missed_before,
        'cpu': dict(zip(('timer', 'reader', 'services'), cpu)),
        'cpu_per_exchange': sum(cpu) / max(1, exchanges),
        'period_errors': [error for session in sessions
                          for error in session.statistics.period_error.samples()],
        'resident_mb': resident_mb(),
    }
    bridge.stop()
    spinner.stop()
    bridge.close()
    bridge.destroy_node()
    context.try_shutdown()
    return result


def thread_cpu(thread: Any) -> float:
    """Return the CPU time of a thread in s."""
    return time.clock_gettime(time.pthread_getcpuclockid(thread.ident))


def resident_mb() -> float:
    """Return the resident memory of this process."""
    status = Path('/proc/self/status').read_text()
    return int(status.split('VmRSS:')[1].split()[0]) / 1024


def wait(condition: Any, timeout: float) -> None:
    """Wait for a condition."""
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > end:
            raise SystemExit('the drives did not come online')
        time.sleep(0.01)


def wait_quietly(duration: float) -> None:
    """Let the other threads work."""
    time.sleep(duration)


def p99(samples: list[float]) -> float:
    """Return the 99th percentile."""
    ordered = sorted(samples)
    return ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))] if ordered else float('nan')


def measure(drives: int, period: float, duration: float, *, subscribed: bool) -> dict[str, Any]:
    """Measure floors and bridge, one after the other."""
    with tempfile.TemporaryDirectory() as folder:
        channel = f'{folder}/bus'
        path = Path(folder) / 'bench.yaml'
        parameter_file(path, channel, drives, period)
        with drives_process(channel):
            context = Context()
            rclpy.init(args=[], context=context)
            node = Node('bench_floor', context=context)
            subscriber = Subscriber(['drive', 'floor', 'bare'], drives) if subscribed else None
            floor = run_can_floor(node, 'floor', channel, INTERFACE, drives, period, 1.0,
                                  publish=True)
            if subscriber:
                subscriber.clear()
            floor = run_can_floor(node, 'floor', channel, INTERFACE, drives, period, duration,
                                  publish=True)
            sleeping = sleeping_thread(period, duration)
            if subscriber:
                run_ros_floor(node, 'bare', 0.005, min(duration, 4.0))
            node.destroy_node()
            context.try_shutdown()
            bridge = run_bridge(path, duration)
            answer = subscriber.ask() if subscriber else None
            if subscriber:
                subscriber.close()
    result = {
        'drives': drives, 'period_ms': 1e3 * period, 'subscribed': subscribed,
        'cpu_us': 1e6 * bridge['cpu_per_exchange'],
        'cpu_us_by_thread': {name: 1e6 * cpu / max(1, bridge['exchanges'])
                             for name, cpu in bridge['cpu'].items()},
        'floor_cpu_us': 1e6 * floor.cpu / max(1, floor.exchanges),
        'exchanges_per_s': bridge['exchanges_per_s'], 'missed': bridge['missed'],
        'period_error_p99_ms': 1e3 * p99(bridge['period_errors']),
        'can_loop_period_error_p99_ms': 1e3 * p99(floor.period_errors),
        'sleeping_period_error_p99_ms': 1e3 * p99(sleeping),
        'resident_mb': bridge['resident_mb'],
    }
    result['cpu_ratio'] = result['cpu_us'] / result['floor_cpu_us']
    result['period_ratio'] = (result['period_error_p99_ms']
                              / result['sleeping_period_error_p99_ms'])
    if answer:
        latencies = answer['latencies']
        result['latency_median_ms'] = 1e3 * statistics.median(latencies['drive'])
        result['bare_latency_median_ms'] = 1e3 * statistics.median(latencies['bare'])
        result['latency_ratio'] = (result['latency_median_ms']
                                   / result['bare_latency_median_ms'])
    return result


def table(results: list[dict[str, Any]]) -> str:
    """Return the results as a table, each figure beside its floor."""
    lines = ['| drives | period | subscribed | CPU per exchange (floor) | ratio '
             '| exchanges/s (missed) | period error p99 (sleeping thread) | ratio '
             '| latency median (bare pair) | ratio |', '|' + '---|' * 10]
    for result in results:
        latency = ('– | –' if 'latency_ratio' not in result else
                   f'{result["latency_median_ms"]:.3f} ms '
                   f'({result["bare_latency_median_ms"]:.3f} ms) | '
                   f'{result["latency_ratio"]:.2f}')
        lines.append(
            f'| {result["drives"]} | {result["period_ms"]:g} ms '
            f'| {"yes" if result["subscribed"] else "no"} '
            f'| {result["cpu_us"]:.0f} µs ({result["floor_cpu_us"]:.0f} µs) '
            f'| {result["cpu_ratio"]:.2f} '
            f'| {result["exchanges_per_s"]:.0f} ({result["missed"]}) '
            f'| {result["period_error_p99_ms"]:.3f} ms '
            f'({result["sleeping_period_error_p99_ms"]:.3f} ms) '
            f'| {result["period_ratio"]:.2f} | {latency} |')
    return '\n'.join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--drives', type=int, nargs='+', default=[1, 4, 8])
    parser.add_argument('--period', type=float, default=0.01, help='s (default: 0.01)')
    parser.add_argument('--duration', type=float, default=5.0, help='s of each measurement')
    parser.add_argument('--unsubscribed', action='store_true', help='also without subscribers')
    parser.add_argument('--json', type=Path, help='write all figures to this file')
    options = parser.parse_args(arguments)
    register()
    results = []
    for drives in options.drives:
        for subscribed in (True, False) if options.unsubscribed else (True,):
            results.append(measure(drives, options.period, options.duration,
                                   subscribed=subscribed))
            print(table(results[-1:]).splitlines()[-1] if len(results) > 1
                  else table(results), flush=True)
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))
    return 0


if __name__ == '__main__':
    sys.exit(main())
