# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can security``: what it writes, and that a running bridge has what the policy names."""

from collections.abc import Callable, Iterator
import os
from pathlib import Path
import resource
import shutil
import socket
import subprocess
import time
from typing import Any
from xml.etree import ElementTree

import plant
import pytest
from running import Running, starting
import waiting
from waiting import wait_for
from world import world

from drive_can_bridge.cli.main import main
from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.snapshot import StopAction
from drive_can_bridge.resources import config_file

FILE = plant.text({
    'conveyor': {**plant.CONVEYOR, 'cyclic_request': ['speed_setpoint'],
                 'cyclic_response': ['actual_speed', 'status_word'],
                 'joint': {'name': 'conveyor_joint', 'velocity': 'actual_speed',
                           'velocity_command': 'speed_setpoint'}},
    'lift': plant.LIFT}, buses={'main': plant.SLCAN})
Run = Callable[..., Running]


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Run]:
    """Return what starts commands of the package, each with a directory of its own."""
    with starting(tmp_path) as start:
        yield start


def written(tmp_path: Path, *arguments: str) -> ElementTree.Element:
    """Write the files for a bridge with two drives; return the policy."""
    file = tmp_path / 'drives.yaml'
    file.write_text(FILE, encoding='utf-8')
    assert main(['security', str(file), '-o', str(tmp_path / 'out'), *arguments]) == 0
    return ElementTree.parse(tmp_path / 'out' / 'policy.xml').getroot()


def allowed(policy: ElementTree.Element, enclave: str, kind: str, verb: str) -> set[str]:
    """Return the full names that an enclave may use in one way."""
    found = set()
    for profile in policy.iterfind(f".//enclave[@path='{enclave}']/profiles/profile"):
        assert set(profile.attrib) == {'ns', 'node'}
        place = f'{profile.attrib["ns"].rstrip("/")}/{profile.attrib["node"]}'
        for name in profile.iterfind(f"{kind}[@{verb}='ALLOW']/*"):
            assert name.text is not None
            found.add(name.text.replace('~', place, 1))
    return found


def test_an_axis_that_homes_is_asked_by_the_operator_only(tmp_path: Path) -> None:
    file = config_file('cia402.yaml')
    assert main(['security', str(file), '-o', str(tmp_path / 'out')]) == 0
    policy = ElementTree.parse(tmp_path / 'out' / 'policy.xml').getroot()
    assert '/slide/home' in allowed(policy, '/bridge', 'services', 'reply')
    assert '/slide/home' in allowed(policy, '/operator', 'services', 'request')
    assert '/slide/home' not in allowed(policy, '/viewer', 'services', 'request')
    for enclave in ('/bridge', '/operator'):    # spindle has no homing: true
        assert '/spindle/home' not in allowed(policy, enclave, 'services', 'reply') | allowed(
            policy, enclave, 'services', 'request')


def test_enclaves_and_what_each_may(tmp_path: Path) -> None:
    policy = written(tmp_path)
    assert (policy.tag, policy.attrib) == ('policy', {'version': '0.2.0'})
    assert [enclave.attrib['path'] for enclave in policy.iter('enclave')] == [
        '/bridge', '/operator', '/viewer']
    moves = {'/conveyor/command/speed_setpoint', '/conveyor/joint_command',
             '/lift/command/speed_setpoint', '/drive_can_bridge/joint_commands'}
    assert moves <= allowed(policy, '/operator', 'topics', 'publish')
    assert moves <= allowed(policy, '/bridge', 'topics', 'subscribe')
    changes = {'/lift/enable', '/lift/quick_stop', '/lift/reset_fault', '/lift/set_parameters',
               '/conveyor/quick_stop', '/conveyor/set_parameters_atomically',
               '/drive_can_bridge/change_state'}
    assert changes <= allowed(policy, '/operator', 'services', 'request')
    assert changes <= allowed(policy, '/bridge', 'services', 'reply')
    # a drive without control has no such services, and nobody has a topic for a control word
    text = ElementTree.tostring(policy, encoding='unicode')
    assert '/conveyor/enable' not in text
    assert 'command/control_word' not in text
    # nobody but the bridge may say what a drive does
    for enclave in ('/operator', '/viewer'):
        assert not {'/conveyor/actual_speed', '/lift/online', '/diagnostics'} & (
            allowed(policy, enclave, 'topics', 'publish'))


def test_a_viewer_may_look_and_nothing_else(tmp_path: Path) -> None:
    policy = written(tmp_path)
    assert allowed(policy, '/viewer', 'topics', 'publish') == {'/parameter_events', '/rosout'}
    assert {'/lift/response', '/lift/status_word/fault', '/conveyor/joint_state', '/diagnostics',
            '/rosout'} <= allowed(policy, '/viewer', 'topics', 'subscribe')
    asked = allowed(policy, '/viewer', 'services', 'request')
    assert '/lift/get_parameters' in asked
    assert not {name for name in asked if name.rpartition('/')[2].startswith(
        ('set_', 'enable', 'reset', 'quick', 'change', 'save'))}


def test_a_namespace(tmp_path: Path) -> None:
    policy = written(tmp_path, '--namespace', 'cell1')
    assert '/cell1/lift/enable' in allowed(policy, '/operator', 'services', 'request')
    assert '/cell1/lift/enable' in allowed(policy, '/bridge', 'services', 'reply')
    assert '/diagnostics' in allowed(policy, '/bridge', 'topics', 'publish')


@pytest.fixture
def graph(tmp_path: Path) -> Iterator[Any]:
    """Put a bridge with two drives on the bench; return a node that looks."""
    rclpy = pytest.importorskip('rclpy')
    from bridges import Bridge
    from rclpy.context import Context
    from rclpy.signals import SignalHandlerOptions
    with world(int(os.environ['DRIVE_CAN_TEST_SEED']), ros=True):
        bridge = Bridge(tmp_path, FILE)
        context = Context()
        rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node('looks', context=context)
        bridge.begin()
        bridge.online()
        yield node
        node.destroy_node()
        context.try_shutdown()
        bridge.close()
        assert bridge.errors == []


def test_it_fits_what_a_bridge_has(graph: Any, tmp_path: Path) -> None:
    policy = written(tmp_path)
    for kind, verb, look in (
            ('topics', 'publish', graph.get_publisher_names_and_types_by_node),
            ('topics', 'subscribe', graph.get_subscriber_names_and_types_by_node),
            ('services', 'reply', graph.get_service_names_and_types_by_node)):
        there = {name for each in ('drive_can_bridge', 'conveyor', 'lift')
                 for name, _ in look(each, '/')}
        assert there - allowed(policy, '/bridge', kind, verb) == set()
        assert len(there) > 3


class Notes:
    """
    What clients of ours have had in the graph, by way.

    :param node: that looks.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._looks = {('topics', 'publish'): node.get_publisher_names_and_types_by_node,
                       ('topics', 'subscribe'): node.get_subscriber_names_and_types_by_node,
                       ('services', 'reply'): node.get_service_names_and_types_by_node,
                       ('services', 'request'): node.get_client_names_and_types_by_node}
        self.found: dict[tuple[str, str], set[str]] = {way: set() for way in self._looks}
        self._over = False
        waiting.clock().worker(self._run, 'notes').start()

    def end(self) -> dict[tuple[str, str], set[str]]:
        """Look no more."""
        self._over = True
        return self.found

    def _run(self) -> None:
        while not self._over:
            for name, place in self._node.get_node_names_and_namespaces():
                if name.startswith('_drive_can_'):
                    for way, look in self._looks.items():
                        # of its own services each node may have some, by a pattern
                        self.found[way] |= {each.replace(f'/{name}/', '/_drive_can_*/')
                                            for each, _ in look(name, place)}
            waiting.pause(0.0005)


def monitor() -> None:
    """Look for a while, as ``drive_can monitor`` does."""
    from drive_can_bridge.ros.monitor.client import MonitorClient
    source = MonitorClient(Model())
    for _ in range(20):
        source.poll(waiting.clock().now())
        waiting.pause(0.1)
    source.close()


def panel() -> None:
    """Do the same, and keep what stops drives at hand, as ``drive_can panel`` does."""
    from drive_can_bridge.ros.monitor.client import MonitorClient
    from drive_can_bridge.ros.monitor.client import ServiceOperations
    source = MonitorClient(Model())
    operations = ServiceOperations(source.node)
    for _ in range(20):
        source.poll(waiting.clock().now())
        operations.poll({'/lift': StopAction, '/conveyor': [StopAction.QUICK_STOP]},
                        waiting.clock().now())
        waiting.pause(0.1)
    source.close()


@pytest.mark.parametrize(('enclave', 'client', 'has'), [
    ('/viewer', monitor, {'/conveyor/response', '/lift/online', '/rosout', '/diagnostics'}),
    ('/viewer', lambda: main(['read', 'conveyor']), {'/conveyor/get_parameters'}),
    ('/operator', lambda: main(['write', 'conveyor', 'ramp_time=2']),
     {'/conveyor/set_parameters'}),
    ('/operator', panel, {'/lift/enable', '/lift/quick_stop', '/conveyor/quick_stop'}),
], ids=['monitor', 'read', 'write', 'panel'])
def test_it_fits_what_clients_do(graph: Any, tmp_path: Path, enclave: str,
                                 client: Callable[[], object], has: set[str]) -> None:
    policy = written(tmp_path)
    notes = Notes(graph)
    assert not client()
    found = notes.end()
    assert has <= set().union(*found.values())
    for (kind, verb), names in found.items():
        assert names - allowed(policy, enclave, kind, verb) == set(), (kind, verb)


def test_a_policy_of_before_outlives_a_full_disk(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    policy = ElementTree.tostring(written(tmp_path))
    file, folder = tmp_path / 'drives.yaml', tmp_path / 'out'
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        assert main(['security', str(file), '-o', str(folder), '--namespace', 'cell']) == 1
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert str(folder / 'policy.xml') in capsys.readouterr().err
    assert ElementTree.tostring(ElementTree.parse(folder / 'policy.xml').getroot()) == policy


@pytest.mark.parametrize(('arguments', 'code', 'words'), [
    (['-o', 'out', '--port', '0'], 2, 'allowed are 1 to 65535'),
    (['-o', 'out', '--host', 'robot'], 2, 'an IPv4 address'),
    ([], 2, '-o'), (['-o', '/dev/null/out'], 1, '/dev/null')])
def test_what_is_wrong_is_said(arguments: list[str], code: int, words: str,
                               capsys: pytest.CaptureFixture[str]) -> None:
    file = str(config_file('demo.yaml'))
    try:
        assert main(['security', file, *arguments]) == code
    except SystemExit as end:
        assert end.code == code
    errors = capsys.readouterr().err
    assert words in errors
    assert 'Traceback' not in errors


def test_a_file_with_problems(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'wrong.yaml'
    file.write_text(FILE.replace('station: 2', 'station: 1'), encoding='utf-8')
    assert main(['security', str(file), '-o', str(tmp_path / 'out')]) == 1
    assert 'drives.lift' in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


# -- TLS ------------------------------------------------------------------------------------------


def certify(directory: Path, authority: str) -> None:
    """Make a key and a certificate of an authority, as docs/security.md tells it."""
    directory.mkdir()
    above = directory.parent
    new = ('-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:P-256', '-nodes')
    if not (above / f'{authority}.pem').exists():
        openssl('req', '-x509', *new, '-keyout', str(above / f'{authority}.key'), '-out',
                str(above / f'{authority}.pem'), '-days', '2', '-subj', f'/CN={authority}')
    openssl('req', *new, '-keyout', str(directory / 'key.pem'), '-out',
            str(directory / 'request.pem'), '-subj', f'/CN={directory.name}')
    openssl('x509', '-req', '-in', str(directory / 'request.pem'), '-CA',
            str(above / f'{authority}.pem'), '-CAkey', str(above / f'{authority}.key'),
            '-CAcreateserial', '-out', str(directory / 'cert.pem'), '-days', '2')
    shutil.copy(above / f'{authority}.pem', directory / 'ca.pem')


def openssl(*arguments: str) -> None:
    """Run openssl."""
    subprocess.run(['openssl', *arguments], check=True, capture_output=True)


@pytest.mark.skipif(shutil.which('openssl') is None, reason='no openssl')
def test_with_tls_only_those_with_a_certificate_of_ours_meet(run: Run, tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    with socket.create_server(('127.0.0.1', 0)) as server:
        port = server.getsockname()[1]
    profiles = {}
    for name, authority in (('bridge', 'own'), ('client', 'own'), ('stranger', 'foreign')):
        certify(tmp_path / name, authority)
        written(tmp_path, '--port', str(port), '--certificates', str(tmp_path / name))
        side = 'bridge' if name == 'bridge' else 'client'
        profiles[name] = tmp_path / f'{name}.xml'
        shutil.copy(tmp_path / 'out' / f'tls_{side}.xml', profiles[name])

    def environment(name: str) -> dict[str, str]:
        # with LOCALHOST ROS adds transports of its own; these profiles leave none but TCP
        return {'FASTRTPS_DEFAULT_PROFILES_FILE': str(profiles[name]),
                'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}
    links = tmp_path / 'links'
    file = str(tmp_path / 'drives.yaml')
    run('drive_can', 'simulate', '--params-file', file, '--pty-link', str(links))
    wait_for((links / 'main').is_symlink, 'the drives')
    run('drive_can_bridge', '--ros-args', '--params-file', file, '-p',
        f'buses.main.channel:={links / "main"}', environment=environment('bridge'))
    stranger = run('drive_can', 'monitor', environment=environment('stranger'))
    outsider = run('drive_can', 'monitor')
    client = run('drive_can', 'monitor', environment=environment('client'))
    client.line('^conveyor online actual_speed=')
    # Fast DDS tells it, and not amid what others read
    wait_for(lambda: 'certificate verify failed' in stranger.errors, 'the refusal')
    assert 'certificate' not in stranger.out.read_text(encoding='utf-8')
    time.sleep(3.0)  # nothing is to come
    assert not [line for line in stranger.lines + outsider.lines if 'conveyor' in line]
