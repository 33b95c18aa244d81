# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Memory of the middleware, and what it needs."""

import os
from pathlib import Path
import subprocess
import sys

import pytest
from rclpy.utilities import get_rmw_implementation_identifier

from drive_can_bridge.core.sentences import profiles_not_read, profiles_not_there
from drive_can_bridge.process.fast_dds import Middleware, RELEASES, running
from drive_can_bridge.resources import config_file
from drive_can_bridge.ros.main import set_up_fast_dds
from drive_can_bridge.ros.middleware import Audience

VARIABLES = [release.variable for release in RELEASES.values()]
#: prints how many bytes services take of the allocator; what is resident says less: memory that
#: was freed before, while modules were imported, is used again
GROWTH = """
import ctypes, os, rclpy
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
FIELDS = ('arena ordblks smblks hblks hblkhd usmblks fsmblks uordblks fordblks keepcost').split()
class Allocated(ctypes.Structure):
    _fields_ = [(name, ctypes.c_size_t) for name in FIELDS]
mallinfo = ctypes.CDLL(None).mallinfo2
mallinfo.restype = Allocated
def allocated():
    now = mallinfo()
    return now.uordblks + now.hblkhd
rclpy.init(args=[])
node = Node('growth', enable_rosout=False, start_parameter_services=False)
services = []
for number in range(41):
    services.append(node.create_service(GetParameters, f'~/s{number}', lambda _, answer: answer))
    before = before if number else allocated()
print(allocated() - before, flush=True)
os._exit(0)
"""
CLIENT = """
from drive_can_bridge.ros.client.client_node import ClientNode
ClientNode('client').leave()
"""


def growth(**environment: str) -> float:
    """Return how many bytes 40 services take; Fast DDS must have nothing to complain about."""
    clean = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    run = subprocess.run([sys.executable, '-c', GROWTH], capture_output=True, text=True,
                         check=True, env={**clean, **environment})
    assert not run.stderr
    return float(run.stdout)


@pytest.fixture(name='middleware')
def _middleware() -> Middleware:
    """Return what runs here, which must be Fast DDS."""
    found = running(get_rmw_implementation_identifier())
    if found.release is None:
        pytest.skip('another middleware')
    return found


@pytest.mark.usefixtures('programs')
def test_small_histories_save_half_of_the_memory(middleware: Middleware) -> None:
    environment: dict[str, str] = {}
    assert set_up_fast_dds(environment) == ('', [])
    assert environment == {
        middleware.variables[0]: str(config_file(middleware.release.shipped))}
    assert growth(**environment) < 0.7 * growth()


@pytest.mark.usefixtures('programs')
@pytest.mark.parametrize('home', [{}, {'HOME': '/proc'}], ids=['none', 'that takes no files'])
def test_clients_need_no_home(home: dict[str, str]) -> None:
    environment = {name: value for name, value in os.environ.items()
                   if name not in ('HOME', 'ROS_HOME', 'ROS_LOG_DIR')}
    run = subprocess.run([sys.executable, '-c', CLIENT], capture_output=True, text=True,
                         check=False, env={**environment, **home})
    assert (run.returncode, run.stderr) == (0, '')


class _Publisher:
    """Counts who subscribes as a middleware does, and how often it was asked."""

    def __init__(self) -> None:
        self.subscribers, self.asked = 0, 0

    def get_subscription_count(self) -> int:
        self.asked += 1
        return self.subscribers


@pytest.mark.parametrize('remembered', [10.0, 20.0], ids=['Cyclone DDS', 'Fast DDS'])
def test_who_was_killed_counts_until_the_middleware_says_otherwise(remembered: float) -> None:
    """Seen with rmw_cyclonedds 2.2.2 and rmw_fastrtps 8.4.3: that many s after a SIGKILL."""
    publisher = _Publisher()
    audience = Audience(publisher)  # type: ignore[arg-type]
    assert not audience.listens(0.0)
    publisher.subscribers = 1
    assert not audience.listens(0.05)           # looked up every 0.1 s
    cycles = round(remembered / 0.005)
    assert all(audience.listens(0.1 + 0.005 * cycle) for cycle in range(cycles))
    publisher.subscribers = 0
    assert not audience.listens(0.2 + remembered)
    assert publisher.asked <= 10.0 * remembered + 4


def test_profiles_of_somebody_else_are_left_alone(middleware: Middleware) -> None:
    for name in middleware.variables:
        environment = {name: '/my/profiles.xml'}
        assert set_up_fast_dds(environment) == (
            '', [profiles_not_there(name, '/my/profiles.xml', middleware.name)])
        assert environment == {name: '/my/profiles.xml'}


def test_a_file_in_the_working_directory_counts_too(
        middleware: Middleware, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    other, = (each for each in RELEASES.values() if each is not middleware.release)
    (tmp_path / other.file).touch()
    environment: dict[str, str] = {}
    assert set_up_fast_dds(environment) == (
        '', [profiles_not_read(other.file, middleware.name, middleware.release.file)])
    assert len(environment) == 1
    (tmp_path / other.file).rename(tmp_path / middleware.release.file)
    environment = {}
    assert set_up_fast_dds(environment) == ('', [])
    assert not environment


def test_a_working_directory_that_is_gone_is_none(
        middleware: Middleware, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As below a terminal that is still in an install folder which was built anew."""
    monkeypatch.chdir(tmp_path)
    tmp_path.rmdir()
    environment: dict[str, str] = {}
    assert set_up_fast_dds(environment) == ('', [])
    assert environment == {
        middleware.variables[0]: str(config_file(middleware.release.shipped))}
