# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The page of the live view, printed on consoles of fixed size."""

import io
import re
import time

from demo_builders import drive, snapshot
import pytest

pytest.importorskip('rich')

from drive_can_bridge.core.session import DriveState
from drive_can_bridge.ros.demo.hints import Hint
from drive_can_bridge.ros.demo.log_lines import LogLine
from drive_can_bridge.ros.demo.snapshot import Snapshot
from drive_can_bridge.ros.demo.view import page

HINTS = [Hint('export ROS_DOMAIN_ID=7', 'once'),
         Hint('ros2 topic echo /conveyor/response', 'every sample'),
         Hint("ros2 topic pub -r 10 /conveyor/command/speed_setpoint std_msgs/msg/Float64 "
              "'{data: 300.0}'", 'moves')]
LOG = [LogLine(0.0, 'INFO', 'drive_can_bridge', 'conveyor: online'),
       LogLine(1.0, 'WARN', 'drive_can_bridge', 'lift: offline: 3 responses missed'),
       LogLine(2.0, 'INFO', 'simulation', 'lift: fault silent')]
THREE = snapshot(drive('conveyor'), drive('lift', state=DriveState.NOT_ARMED),
                 drive('turntable', state=DriveState.OFFLINE, advice='no answer: check the cable'))


def printed(shown: Snapshot, width: int, height: int) -> list[str]:
    """Print a page as a terminal would get it, without colours."""
    lines = page(shown, hints=HINTS, log=LOG, place='ROS domain 7, on this machine only',
                 width=width, height=height)
    assert len(lines) <= height
    assert all(line.cell_len <= width for line in lines)
    output = io.StringIO()
    # imported late: without rich this file skips itself
    from rich.console import Console
    terminal = Console(width=width, height=height, file=output, color_system=None)
    for line in lines:
        terminal.print(line, no_wrap=True, overflow='crop')
    result = output.getvalue().split('\n')[:-1]
    # nothing was wrapped
    assert len(result) == len(lines)
    return result


def test_a_wide_terminal_shows_everything_in_columns() -> None:
    lines = printed(THREE, 120, 40)
    text = '\n'.join(lines)
    assert lines[0].startswith(' drive_can demo   ROS domain 7, on this machine only')
    assert 'up 1:02:05   cpu   7 %' in lines[0]
    for pattern in [r' conveyor +speed_setpoint +12\.3 rpm +actual_speed +12\.3 rpm +rate +50\.0',
                    r' ● online +motor_current +1\.25 A +missed +3',
                    r' ● not armed', r' ○ offline', r'no answer: check',
                    r'period error +0\.12 +1\.90 ms', r'latency +0\.40 +2\.10 ms',
                    r'● ready  ○ fault', r' bus bus_0  up +load  36\.4 % ████░',
                    r'1234 sent +1230 received +0 rejected',
                    r'── from a second terminal ─+',
                    r' ros2 topic echo /conveyor/response +# every sample',
                    r'── log ─+ Ctrl-C ends ──', r'WARN lift: offline',
                    r'simulation: lift: fault']:
        assert re.search(pattern, text), pattern


def test_a_small_terminal_shows_as_much_on_fewer_columns() -> None:
    text = '\n'.join(printed(THREE, 80, 24))
    for pattern in [r'conveyor +online +50\.0 +3 +0\.12 / 1\.90 +0\.40 / 2\.10',
                    r'speed_setpoint +12\.3 rpm',
                    r'actual_speed +12\.3 rpm  motor_current +1\.25 A',
                    r'● ready  ○ fault', r'lift +not armed', r'turntable +offline',
                    r'no answer: check the cable', r'bus bus_0  up +load  36\.4 %', r'── log ─+',
                    r'on this machine only']:
        assert re.search(pattern, text), pattern


@pytest.mark.parametrize('width', [20, 40, 79, 80, 107, 120, 200, 300])
@pytest.mark.parametrize('height', [3, 5, 10, 16, 24, 33, 34, 50, 90])
@pytest.mark.parametrize('count', [0, 1, 3, 24])
def test_it_fits_everywhere(width: int, height: int, count: int) -> None:
    drives = tuple(drive(f'drive_{number}', values=2 + number % 3) for number in range(count))
    shown = Snapshot(drives, snapshot(buses=1 + count // 4).buses, 1.0, 0.0)
    printed(shown, width, height)


def test_more_drives_than_lines_are_said_to_be_more() -> None:
    lines = printed(snapshot(*(drive(f'drive_{number}') for number in range(24))), 80, 12)
    assert any(re.search(r'… and \d+ more', line) for line in lines)


def test_columns_stay_where_they_are_whatever_the_values() -> None:
    for width in (80, 120, 200):
        places = set()
        for speed in (0.0, -3276.8, 3.14):
            lines = printed(snapshot(drive(speed=speed)), width, 40)
            [line] = [line for line in lines if 'actual_speed ' in line and 'rpm' in line]
            places.add((line.index('actual_speed '), line.index('rpm', line.index('actual_sp')),
                        len(line) if width == 80 else 0))
        assert len(places) == 1


def test_a_command_that_is_too_long_goes_on_behind_a_backslash() -> None:
    lines = printed(snapshot(), 80, 40)
    [first] = [number for number, line in enumerate(lines) if 'ros2 topic pub' in line]
    assert lines[first].endswith(' \\')
    assert lines[first + 1].strip() == "'{data: 300.0}'"
    joined = lines[first][:-1] + lines[first + 1].strip()
    assert joined.split() == HINTS[2].command.split()


def test_the_newest_lines_of_the_log_are_kept() -> None:
    log = [LogLine(float(number), 'INFO', '', f'line {number}') for number in range(100)]
    lines = page(snapshot(), hints=[], log=log, place='', width=80, height=24)
    assert lines[-1].plain.endswith('line 99')
    stamp = time.strftime('%H:%M:%S', time.localtime(99.0))
    assert lines[-1].plain == f' {stamp} line 99'


def test_a_long_line_of_the_log_is_wrapped_below_its_text() -> None:
    log = [LogLine(0.0, 'ERROR', 'drive_can_bridge', 'word ' * 40)]
    lines = page(snapshot(), hints=[], log=log, place='', width=60, height=40)
    *_, second, third, last = [line.plain for line in lines]
    assert 'ERROR' not in second + third + last
    assert last.startswith(' ' * 16 + 'word')
    shown = [line.plain for line in lines if 'word' in line.plain]
    assert shown[0].startswith(f' {time.strftime("%H:%M:%S", time.localtime(0.0))} ERROR word')
    assert '…' not in ''.join(shown)
    assert sum(line.count('word') for line in shown) == 40
