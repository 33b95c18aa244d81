# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What rclpy does not promise, taken away: bridges and commands go on, more slowly, or say why."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from bridges import LIFT, parameters, StartBridge
from by_hand import Run
import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation as real

from drive_can_bridge.core.sentences import client_by_rclpy
from drive_can_bridge.ros.rcl.extension import Extension


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
    one = bridge(parameters(lift=LIFT))
    one.online()
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
