# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What rclpy does not promise, taken away: bridges and commands go on, more slowly, or say why."""

import ast
from collections.abc import Iterator
from contextlib import contextmanager
import importlib
import inspect
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from bridges import CONVEYOR, LIFT, parameters, StartBridge
from by_hand import Run
from clients import Client, wait_until
from graph import Responses
import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation as real
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter_service import ParameterService
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

from drive_can_bridge import ros
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.sentences import (
    client_by_rclpy, commands_by_executor, rclpy_lacks, requests_by_executor, requests_hold_up)
from drive_can_bridge.ros import bridge_node
from drive_can_bridge.ros.rcl import end, incoming, waiting
from drive_can_bridge.ros.rcl.extension import Extension
from drive_can_bridge.ros.rcl.unfit import Unfit


def other(kind: type) -> type:
    """Return a class whose objects are made in another way."""
    return type(kind.__name__, (kind,), {'__init__': otherwise})


@contextmanager
def instead(monkeypatch: pytest.MonkeyPatch, **members: Any) -> Iterator[None]:
    """Have other members in the extension, as far as this package sees it; None: they are gone."""
    def found(_: Extension, name: str) -> Any:
        if name not in members:
            return getattr(real, name)
        if members[name] is None:
            raise AttributeError(name)
        return other(getattr(real, name)) if members[name] is other else members[name]
    with monkeypatch.context() as patch:
        patch.setattr(Extension, '__getattr__', found)
        yield


def otherwise(*_: Any) -> Any:
    """Be made, or called, in another way."""
    raise TypeError('__init__(): incompatible constructor arguments. The following argument types '
                    'are supported:\n    1. something else')


def said(reason: str) -> str:
    """Return what a command says that asks more slowly."""
    return f'drive_can: {client_by_rclpy(reason)}\n'


WRONG = ('__init__(): incompatible constructor arguments. The following argument types are '
         'supported:')


@pytest.mark.parametrize(('members', 'reason'), [
    ({'Node': None}, 'rclpy has no Node any more'),
    ({'Client': None}, 'rclpy has no Client any more'),
    ({'rclpy_get_service_names_and_types': None},
     'rclpy has no rclpy_get_service_names_and_types any more'),
    ({'Node': other}, WRONG), ({'Client': other}, WRONG), ({'Subscription': other}, WRONG),
    ({'rclpy_get_topic_names_and_types': otherwise}, WRONG)], ids=str)
def test_commands_without_a_part_of_the_client_node(
        bridge: StartBridge, run: Run, monkeypatch: pytest.MonkeyPatch,
        members: dict[str, Any], reason: str) -> None:
    one = bridge(parameters(lift=LIFT)).online()
    control = one.node.drives['lift'].session.control
    assert control is not None
    with instead(monkeypatch, **members):
        code, lines, errors = run('enable', 'lift')
        assert (code, lines) == (0, ['lift: enabled'])
        assert errors in ('', said(reason))
        assert not control.off
        assert run('stop') == (0, ['lift: ready'], said(reason))
        assert control.off
        code, lines, _ = run('read', 'lift', 'ramp_time')
        assert code == 0 and lines[1].startswith('ramp_time ')


def test_a_node_that_wants_the_quality_of_its_log(
        bridge: StartBridge, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    class Node(real.Node):
        def __init__(self, name: str, namespace: str, context: Any, arguments: Any,
                     use_global: bool, rosout: bool, quality: Any) -> None:
            assert type(quality).__name__ == 'rmw_qos_profile_t'     # as in rclpy 9.1.2
            super().__init__(name, namespace, context, arguments, use_global, rosout)
    bridge(parameters(lift=LIFT)).online()
    with instead(monkeypatch, Node=Node):
        assert run('stop') == (0, ['lift: ready'], '')


class Unfitting(Responses):
    """In place of the way past rclpy, where ctypes does not find something."""

    def __init__(self) -> None:
        raise Unfit('undefined symbol: rcl_take_request_with_info')


def without(*names: str) -> SimpleNamespace:
    """Return a class of the extension that has these members only."""
    return SimpleNamespace(**dict.fromkeys(names))


NO_TAKE = requests_hold_up('undefined symbol: rcl_take_request_with_info')
NO_WAIT = requests_by_executor('rclpy has no WaitSet any more')


@pytest.mark.parametrize(('members', 'rcl', 'warnings'), [
    ({}, Unfitting, [NO_TAKE]),
    ({'WaitSet': None}, Responses, [NO_WAIT]),
    ({'WaitSet': None}, Unfitting, [NO_WAIT]),
    ({'GuardCondition': other}, Responses, [requests_by_executor(WRONG)]),
    ({'Service': without('pointer')}, Unfitting, [requests_by_executor(
        'rclpy has no Service.service_take_request any more')]),
    ({'Service': without('service_take_request')}, Responses, [requests_by_executor(
        'rclpy has no Service.pointer any more')]),
    ({'EventHandle': without('take_event')}, Responses, [commands_by_executor(
        'rclpy has no EventHandle.destroy_when_not_in_use any more')]),
    ({'EventHandle': None}, Responses, [commands_by_executor(
        'rclpy has no EventHandle any more')]),
    ({'Subscription': without('get_publisher_count')}, Responses, [commands_by_executor(
        'rclpy has no Subscription.take_message any more')]),
    ({'Publisher': without('publish')}, Responses, [commands_by_executor(
        'rclpy has no Publisher.publish_raw any more')]),
    ({'WaitSet': None, 'Subscription': None, 'Publisher': None, 'Client': None}, Unfitting,
     [commands_by_executor('rclpy has no Subscription.take_message any more'),
      commands_by_executor('rclpy has no Publisher.publish_raw any more'), NO_WAIT])],
    ids=['take, answers', 'wait set', 'wait set and take', 'wait set of another kind',
         'take at all', 'where services are', 'letting go of events', 'events',
         'messages', 'bytes', 'all of them'])
def test_a_bridge_without(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch,
        members: dict[str, Any], rcl: type, warnings: list[Sentence]) -> None:
    monkeypatch.setattr(bridge_node, 'RclServices', rcl)
    with instead(monkeypatch, **members):
        one = bridge(parameters(lift=LIFT, conveyor=CONVEYOR)).online()
        client.listen()
        for said in warnings:
            client.wait_logged(said)
        told = client.logged(node='drive_can_bridge')
        assert [line for line in told if 'rclpy' in line] == warnings
        assert client.call('/lift/enable', SetBool, SetBool.Request(data=True)).success
        with one.record() as recorder:
            client.publish('/conveyor/command/speed_setpoint', Float64(data=0.0))
            client.publish('/conveyor/command/speed_setpoint', Float64(data=12.0))
            wait_until(lambda: recorder.words()[:1] == (120,), what='the command')
        assert client.set('/lift', ramp_time=1.5) == [(True, '')]
        assert client.get('/lift', 'ramp_time') == [1.5]
        assert client.set('/drive_can_bridge', diagnostics_period=2.0) == [(True, '')]
        assert client.call('/drive_can_bridge/save_trace', Trigger).message
        assert client.call('/lift/quick_stop', Trigger).success
        lift = one.node.drives['lift'].session.control
        assert lift is not None and lift.off
        for label in 'deactivate', 'cleanup', 'configure', 'activate':
            assert client.transition(label=label)
        assert not client.transition(label='activate')
        one.close()


def gone(name: str) -> dict[str, Any]:
    """Return what there is instead, where one member is gone."""
    owner, _, member = name.partition('.')
    kind = getattr(real, owner)
    return {owner: without(*{*dir(kind)} - {member, *dir(SimpleNamespace)}) if member else None}


@pytest.mark.parametrize('name', sorted({
    *waiting.MEMBERS, *incoming.MEMBERS, 'Publisher.publish_raw'}))
def test_each_member_that_a_bridge_does_without_is_named(
        client: Client, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    told: list[str] = []
    monkeypatch.setattr(bridge_node, 'RclServices', Responses)
    with instead(monkeypatch, **gone(name)):
        bridge_node._rcl_services([], client.node.context, told.append)
    line, = told
    assert f'rclpy has no {name} any more' in line


@pytest.mark.parametrize('name', end.MEMBERS)
def test_each_member_that_a_command_does_without_is_named(
        client: Client, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    told: list[str] = []
    with instead(monkeypatch, **gone(name)):
        end.TopicEnd(client.node.context, 'end', told.append).close()
    assert told == [f'rclpy has no {name} any more']


def test_what_is_used_is_looked_for() -> None:
    """Each member of the extension's things that is used stands in a text, too: its name."""
    things = [kind for kind in vars(real).values() if inspect.isclass(kind) and (
        issubclass(kind, real.Destroyable) or kind.__name__ in (
            'rmw_service_info_t', 'rmw_request_id_t'))]
    members = {name for kind in things for name in dir(kind) if not name.startswith('__')} - {
        'name'}     # of messages, which have one, too
    assert {'pointer', 'take_message', 'request_id'} <= members
    used, named = set(), set()
    for path in [*(ROS / 'rcl').glob('*.py'), ROS / 'bridge_node.py']:
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Attribute) and path.parent.name == 'rcl':
                used.add(node.attr)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                named.update(node.value.split('.'))
    assert used & members <= named


@pytest.mark.parametrize(('owner', 'name'), [
    (Node, '_set_parameters_atomically_common'), (ParameterService, '_get_parameters_callback'),
    (ParameterService, '_set_parameters_callback'),
    (ParameterService, '_set_parameters_atomically_callback'), (ParameterService, '_get_node')])
def test_what_there_is_no_other_way_to_is_told_at_the_start(
        bridge: StartBridge, monkeypatch: pytest.MonkeyPatch, owner: type, name: str) -> None:
    with monkeypatch.context() as patch:
        patch.delattr(owner, name)
        with pytest.raises(DriveCanError) as told:
            bridge()
    assert str(told.value) == rclpy_lacks(f'{owner.__name__}.{name}')


@pytest.mark.parametrize('name', [
    '_parameter_overrides', '_service_change_state', '_state_machine'])
def test_what_nodes_are_to_have_is_told_at_the_start(
        bridge: StartBridge, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    begin = LifecycleNode.__init__

    def begun(node: LifecycleNode, *arguments: Any, **options: Any) -> None:
        begin(node, *arguments, **options)
        setattr(node, f'{name}_of_another_version', vars(node).pop(name))
    monkeypatch.setattr(LifecycleNode, '__init__', begun)
    with pytest.raises(DriveCanError) as told:
        bridge()
    assert str(told.value) == rclpy_lacks(f'LifecycleNode.{name}')


@pytest.mark.parametrize('name', ['available_transitions', 'current_state'])
def test_what_their_states_are_to_have_is_told_at_the_start(
        bridge: StartBridge, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    begin = LifecycleNode.__init__

    def begun(node: LifecycleNode, *arguments: Any, **options: Any) -> None:
        begin(node, *arguments, **options)
        machine: Any = node._state_machine
        node._state_machine = without(*{*dir(machine)} - {name, *dir(SimpleNamespace)})
    monkeypatch.setattr(LifecycleNode, '__init__', begun)
    with pytest.raises(DriveCanError) as told:
        bridge()
    assert str(told.value) == rclpy_lacks(f'LifecycleNode._state_machine.{name}')


#: where rclpy may be used, and where beyond what it promises
ROS = Path(inspect.getfile(ros)).parent
SOURCES = [path for folder in ('ros', 'client', 'cli', 'process')
           for path in sorted((ROS.parent / folder).rglob('*.py'))
           if ROS / 'rcl' not in path.parents]
#: ctypes for other reasons than rclpy's
OTHER_LIBRARIES = {'process/beginning.py', 'process/scheduling.py'}
#: of objects of rclpy: what is behind them in the extension
BEHIND = {'handle', 'impl', 'get_c_qos_profile', 'publish_raw', 'take_message', 'take_event',
          'service_take_request', 'service_send_response', 'destroy_when_not_in_use', 'pointer'}


def beyond_promises(path: Path) -> Iterator[str]:
    """Go through what a module uses that rclpy does not promise."""
    tree = ast.parse(path.read_text(encoding='utf-8'))
    nodes = list(ast.walk(tree))
    own = {node.name for node in nodes
           if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef))} | {
        node.attr if isinstance(node, ast.Attribute) else node.id for node in nodes
        if isinstance(node, (ast.Attribute, ast.Name)) and isinstance(node.ctx, ast.Store)}
    for node in nodes:
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            names = [each.name for each in node.names]
            module = getattr(node, 'module', '') or ''
            for name in (module, *names, *(f'{module}.{each}' for each in names)):
                if name.startswith('rclpy.impl') or name.startswith('rclpy._'):
                    yield f'{path}:{node.lineno}: import {name}'
                if name == 'ctypes' and str(path.relative_to(ROS.parent)) not in OTHER_LIBRARIES:
                    yield f'{path}:{node.lineno}: import ctypes'
        elif isinstance(node, ast.Attribute):
            text = ast.unparse(node)
            private = node.attr.startswith('_') and not node.attr.startswith('__')
            if node.attr in BEHIND and (
                    node.attr not in own or not text.startswith('self.')) or (
                    private and node.attr not in own
                    and (ROS in path.parents or not text.startswith('self.'))
                    and node.attr not in dir(Path) + ['_replace', '_fields', '_asdict', '_exit']):
                yield f'{path}:{node.lineno}: {text}'
    if ROS in path.parents:
        yield from overridden(path)


def overridden(path: Path) -> Iterator[str]:
    """Go through private methods of rclpy's classes that those of a module override."""
    name = '.'.join(('drive_can_bridge', *path.relative_to(ROS.parent).with_suffix('').parts))
    module = importlib.import_module(name)
    for kind in vars(module).values():
        if inspect.isclass(kind) and kind.__module__ == module.__name__:
            for base in kind.__mro__[1:]:
                if base.__module__.startswith('rclpy'):
                    for each in vars(kind).keys() & vars(base).keys():
                        if each.startswith('_') and not each.startswith('__'):
                            yield f'{path}: {kind.__name__}.{each} overrides {base.__name__}'


def test_nobody_else_uses_what_rclpy_does_not_promise() -> None:
    assert not [found for path in SOURCES for found in beyond_promises(path)]


@pytest.mark.parametrize('text', [
    'from rclpy.impl.implementation_singleton import rclpy_implementation', 'import ctypes',
    'import rclpy._rclpy_pybind11', 'node._parameter_overrides', 'self.publisher.handle',
    'quality.get_c_qos_profile()', 'super()._get_parameters_callback(request, response)'])
def test_what_that_test_finds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr(f'{__name__}.ROS', tmp_path / 'package' / 'ros')
    path = tmp_path / 'package' / 'client' / 'module.py'
    path.parent.mkdir(parents=True)
    path.write_text(text)
    assert list(beyond_promises(path))
