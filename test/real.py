# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which tests run against the wall clock, and which of them ``make test`` runs.

A test is *real* when its outcome hangs on how long things take: processes that talk to each other,
what DDS does, signals, buses of the kernel, threads that wait for a time of this machine's clock.
Where that follows from what a test uses, its fixtures (:data:`FIXTURES`) or its mark ``socketcan``
say so; otherwise the test has the mark ``real``. They run one after the other: in ``make test``
those of :data:`CHOSEN`, each executable and each fact about the machine once; in ``.ci/run`` the
others, too, which have the mark ``ci``: there the stories of ``system/`` in one run, and beside it
all others in another one, which takes about as long. As a program it prints the files of all; with
the word ``system`` of those, with ``others`` of the others, with ``executables`` the stories of
those.
"""

from pathlib import Path
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pytest

#: directory -> fixtures that put a test at the mercy of the wall clock
FIXTURES = {
    'test/demo/': {'start', 'demo', 'terminal'},
    'test/monitor/': {'run'},
    'test/panel/': {'site', 'run', 'browser', 'phone', 'somebody'},
    'test/security/': {'run'},
}

#: what make test runs of executables -> what it shows
EXECUTABLES = {
    'test/system/test_system_families.py::test_run_write_and_stop[datamodel_extended]':
        'bridge, simulator and a client over DDS: it runs, is written to, and is stopped',
    'test/demo/test_demo_command.py::test_it_prints_a_line_per_drive_and_stops_them_neutral':
        'drive_can demo, and SIGINT',
    'test/demo/test_demo_terminal.py::test_the_view_comes_and_goes':
        'the live view in a terminal',
    'test/panel/test_panel_stops.py::test_nothing_with_control_runs_on_when_all_are_stopped':
        'drive_can panel reaches drives',
    'test/panel/test_panel_sockets.py::test_a_thousand_connections':
        'drive_can panel under load',
    'test/monitor/test_monitor_attach.py::test_it_attaches_to_whatever_comes_and_says_what_went':
        'drive_can monitor finds bridges',
    'test/system/test_system_backup.py::TestThroughTheBridge::test_as_a_user_starts_them':
        'drive_can backup, restore and compare',
    'test/system/test_system_ros2_control.py::test_trip_on_the_way':
        'a trajectory of ros2_control',
    'test/system/test_system_parameters.py::test_as_a_user_starts_them':
        'drive_can read and write, directly and through a bridge',
}

#: what make test runs of the machine -> what it shows
MACHINE = {
    'test/system/test_system_signals.py::test_while_active':
        'signals end a bridge in order',
    'test/system/test_system_signals.py::test_process_that_stood_still':
        'a process that was suspended',
    'test/system/test_system_signals.py::test_killed':
        'a process that was killed, and locks between processes',
    'test/system/test_system_stall.py::test_adapter_that_takes_nothing':
        'an adapter that takes no more data',
    'test/system/test_system_stuck_output.py::test_a_drive_falls_silent_and_the_bridge_is_stopped':
        'standard error that nobody reads',
    'test/system/test_system_reconnection.py::test_adapter_is_pulled_and_another_plugged_in':
        'an adapter that is unplugged',
    'test/process/test_locks.py':
        'locks between processes',
    'test/simulation/test_simulated_slcan.py::test_client_in_another_process':
        'python-can in another process at a pseudo-terminal',
}
CHOSEN = {**EXECUTABLES, **MACHINE}


def mark(item: 'pytest.Item') -> None:
    """Give a test the marks ``real`` and ``ci``, if they are due."""
    fixtures = getattr(item, 'fixturenames', ())
    for directory, wanted in FIXTURES.items():
        if item.nodeid.startswith(directory) and wanted.intersection(fixtures):
            item.add_marker('real')
    if item.get_closest_marker('socketcan') is not None:    # a bus of the kernel
        item.add_marker('real')
    if item.get_closest_marker('real') is not None and not any(
            item.nodeid == chosen or item.nodeid.startswith((f'{chosen}[', f'{chosen}::'))
            for chosen in CHOSEN):
        item.add_marker('ci')


def files(everything: bool) -> list[str]:
    """Return the files of the real tests of ``make test``, or of all."""
    if not everything:
        return sorted({chosen.partition('::')[0] for chosen in CHOSEN})
    elsewhere = (path for path in Path('test').rglob('test_*.py')
                 if not str(path).startswith(tuple(FIXTURES)))
    marked = {str(path) for path in elsewhere if 'mark.real' in path.read_text(encoding='utf-8')}
    return sorted({*FIXTURES, *marked})


def part(word: str) -> list[str]:
    """Return what the program prints."""
    if word == 'executables':
        return list(EXECUTABLES)
    return [file for file in files(everything=True)
            if word not in ('system', 'others')
            or file.startswith('test/system/') == (word == 'system')]


if __name__ == '__main__':
    print(*part(''.join(sys.argv[1:])), sep='\n')
