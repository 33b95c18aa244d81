# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Requests by the middleware itself, and exceptions of C++."""

import subprocess
import sys

from bridges import StartBridge
from clients import Client
import pytest
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, GetParameterTypes, SetParameters,
)

from drive_can_bridge.ros.parameter_services import NAMES_MAX

_THROWS = """
import ctypes, sys, threading, time
from rclpy.impl.implementation_singleton import rclpy_implementation
from drive_can_bridge.ros.rcl import escaped
library = ctypes.CDLL(rclpy_implementation.__file__)
throw = library._ZSt17__throw_bad_allocv
if sys.argv[1] != 'bare':
    escaped.install(library)
told = []
def run():
    if sys.argv[1] == 'guarded':
        with escaped.guarded(told.append):
            throw()
    else:
        throw()
threading.Thread(target=run, daemon=True).start()
deadline = time.monotonic() + 60.0
while not told and time.monotonic() < deadline:
    time.sleep(0.01)
print(told, flush=True)
import os
os._exit(0)
"""


@pytest.mark.real
@pytest.mark.parametrize('how', ['bare', 'another', 'guarded'])
def test_what_a_cpp_exception_does(how: str) -> None:
    """Without the handler ctypes would have the process ended, and so it is for all others."""
    ended = subprocess.run([sys.executable, '-c', _THROWS, how], capture_output=True, text=True,
                           timeout=120.0, check=False)
    if how == 'guarded':
        assert (ended.returncode, ended.stdout) == (0, "['std::bad_alloc']\n")
    else:
        assert ended.returncode == -6 and 'std::bad_alloc' in ended.stderr


@pytest.mark.real
def test_a_hundred_thousand_names_are_refused(bridge: StartBridge, client: Client) -> None:
    bridge().online()
    count = 100_000
    names = ['x'] * count
    values = client.call('/conveyor/get_parameters', GetParameters,
                         GetParameters.Request(names=names)).values
    assert len(values) == count and all(value.type == 0 for value in values[::1000])
    types = client.call('/conveyor/get_parameter_types', GetParameterTypes,
                        GetParameterTypes.Request(names=names)).types
    assert list(types) == [0] * count
    found = client.call('/conveyor/describe_parameters', DescribeParameters,
                        DescribeParameters.Request(names=names)).descriptors
    assert [each.name for each in found[::count - 1]] == ['x', 'x']
    results = client.call('/conveyor/set_parameters', SetParameters, SetParameters.Request(
        parameters=[Parameter(name='x')] * count)).results
    reason = f'{count} names in one call, at most {NAMES_MAX} are allowed'
    assert {(each.successful, each.reason) for each in results[::1000]} == {(False, reason)}
    assert len(results) == count
