# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The limit of memory, and what goes on when it is reached: each in a process of its own."""

import subprocess
import sys
from typing import Any

import pytest

from drive_can_bridge.configuration.load import configuration_from_overrides
from drive_can_bridge.configuration.schema import check_value, definition

_PREPARE = """
import ctypes, os, resource, threading, time
from drive_can_bridge.clock import SteadyClock
from drive_can_bridge.memory import data_limit, in_use, keep_reserves, MEGABYTE, RESERVE, reserve
libc = ctypes.CDLL(None)
libc.malloc.restype, libc.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
def soft():
    return resource.getrlimit(resource.RLIMIT_DATA)[0]
def fill(keep=()):
    for size in 1 << 20, 1 << 16, 1 << 10, 24:
        while libc.malloc(size):
            pass
"""
_LIMIT = """
given = soft()
before = in_use()
data_limit.set(128 * MEGABYTE)
assert 0 <= soft() - before - 128 * MEGABYTE < 4 * MEGABYTE
limit = soft()
with data_limit.room():
    with data_limit.room():
        pass
    assert soft() == limit + 64 * MEGABYTE
    taken = libc.malloc(150 * MEGABYTE)     # more than all that there was
    assert taken
assert soft() == limit < in_use()
with data_limit.room():
    assert soft() - in_use() - 64 * MEGABYTE < MEGABYTE
libc.free(ctypes.c_void_p(taken))
assert soft() == limit
assert not libc.malloc(256 * MEGABYTE)
data_limit.lift()
assert soft() == given and libc.malloc(256 * MEGABYTE)
"""
_GIVEN = """
data_limit.set(1 << 40)
assert soft() == LIMIT
data_limit.lift()
assert soft() == LIMIT
"""
#: a thread that matters has its reserve while another has everything, and others may begin
_FULL = """
keep_reserves()
ready, full, over = threading.Event(), threading.Event(), threading.Event()
got, began = [], []
def matters():
    reserve()
    ready.set()
    full.wait()
    got.append(all(libc.malloc(1000) for _ in range(RESERVE // 1100)))
    over.set()
def takes_all():
    fill()
    full.set()
    over.wait()
threads = [SteadyClock().worker(run, 'one') for run in (matters, takes_all)]
third = SteadyClock().worker(lambda: began.append(1), 'third')
threads[0].start()
ready.wait()
data_limit.set(128 * MEGABYTE)
threads[1].start()
full.wait()
third.start()
third.join()
for thread in threads:
    thread.join()
assert got == [True] and began == [1], (got, began)
"""


def _runs(*program: str, prepare: Any = None) -> None:
    ended = subprocess.run([sys.executable, '-c', '\n'.join([_PREPARE, *program])],
                           capture_output=True, text=True, timeout=120.0, check=False,
                           preexec_fn=prepare)
    assert ended.returncode == 0, ended.stderr


@pytest.mark.usefixtures('programs')
def test_limit_and_a_moment_above_it() -> None:
    _runs(_LIMIT)


@pytest.mark.usefixtures('programs')
def test_a_limit_that_was_given_is_kept() -> None:
    import resource
    limit = 3 << 30
    _runs(f'LIMIT = {limit}', _GIVEN,
          prepare=lambda: resource.setrlimit(resource.RLIMIT_DATA, (limit, limit)))


@pytest.mark.usefixtures('programs')
@pytest.mark.skipif(sys.platform != 'linux', reason='glibc')
def test_who_matters_goes_on_while_another_has_everything() -> None:
    _runs(_FULL)


@pytest.mark.parametrize(('value', 'allowed'), [
    (0, True), (128, True), (1024, True), (1, False), (127, False), (-1, False), (512.0, False),
    (True, False), ('512', False)])
def test_values_of_the_key(value: object, allowed: bool) -> None:
    assert (check_value(value, definition('bridge')['properties']['memory_limit_mb'])
            is None) == allowed


def test_default() -> None:
    drive = {'bus': 'main', 'protocol': 'datamodel_extended', 'station': 1, 'period': 0.02,
             'profile': 'datamodel_example', 'cyclic_request': ['speed_setpoint'],
             'cyclic_response': ['actual_speed']}
    overrides = {'buses.main.interface': 'virtual', 'buses.main.channel': 'memory',
                 'buses.main.bitrate': 1_000_000,
                 **{f'drives.conveyor.{key}': value for key, value in drive.items()}}
    assert configuration_from_overrides(overrides).memory_limit_mb == 1024
    assert configuration_from_overrides({**overrides, 'memory_limit_mb': 0}).memory_limit_mb == 0
