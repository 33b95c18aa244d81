# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Messages whose bytes are prepared arrive as what they would be otherwise."""

from functools import partial
import math
from typing import Any

from clients import Client, wait_until
import pytest
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterType, ParameterValue
from rclpy.impl.implementation_singleton import rclpy_implementation
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Int64

from drive_can_bridge.ros.prepared import find_layout, PreparedMessage

EXTREMES = [0.0, -0.0, 1.5, -12.3, math.inf, -math.inf, 1.7976931348623157e308, 5e-324]


def received(client: Client, message: Any, numbers: Any, values: list[tuple[Any, ...]],
             ) -> list[Any]:
    """Publish ``message`` with each of the values; return what arrived."""
    # Fast DDS refuses a second type on a topic for as long as the process remembers the first
    name = f'/prepared_{type(message).__name__.lower()}'
    topic = client.topic(name, type(message), publisher=False)
    publisher = client.publisher(name, type(message))
    prepared = PreparedMessage.find(publisher, message, numbers)
    assert prepared is not None
    for value in values:
        prepared.publish(value)
    wait_until(lambda: len(topic.messages) >= len(values))     # they may be there by now
    return list(topic.messages)


def test_doubles(client: Client) -> None:
    message = Float64()
    arrived = received(client, message, [('d', partial(setattr, message, 'data'))],
                       [(value,) for value in EXTREMES])
    assert [repr(each.data) for each in arrived] == [repr(value) for value in EXTREMES]


def test_integers(client: Client) -> None:
    message = Int64()
    values = [0, 1, -1, 65535, -32768, 2**31, -2**63, 2**63 - 1]
    arrived = received(client, message, [('q', partial(setattr, message, 'data'))],
                       [(value,) for value in values])
    assert [each.data for each in arrived] == values


@pytest.mark.parametrize('names', [
    ['a'], ['speed', 'torque_limit', 'x', 'counts'],
    [f'p{index}' * index for index in range(1, 9)],
], ids=['one', 'four', 'eight'])
def test_samples_of_several_values(client: Client, names: list[str]) -> None:
    entries = [Parameter(name=name, value=ParameterValue(
        type=ParameterType.PARAMETER_INTEGER if name == 'counts' else
        ParameterType.PARAMETER_DOUBLE)) for name in names]
    message = ParameterEvent(node='/line/conveyor', changed_parameters=entries)
    numbers = [('i', partial(setattr, message.stamp, 'sec')),
               ('I', partial(setattr, message.stamp, 'nanosec')),
               *(('q', partial(setattr, entry.value, 'integer_value')) if entry.name == 'counts'
                 else ('d', partial(setattr, entry.value, 'double_value')) for entry in entries)]
    values: list[tuple[Any, ...]] = [
        (2**31 - 1, 999_999_999, *(-7 if name == 'counts' else index + 0.25
                                   for index, name in enumerate(names))),
        (0, 0, *(0 if name == 'counts' else -1e300 for name in names))]
    first, second = received(client, message, numbers, values)
    for sample, wanted in zip((first, second), values):
        assert sample.node == '/line/conveyor'
        assert [entry.name for entry in sample.changed_parameters] == names
        assert (sample.stamp.sec, sample.stamp.nanosec) == wanted[:2]
        assert tuple(entry.value.integer_value if entry.name == 'counts'
                     else entry.value.double_value for entry in sample.changed_parameters
                     ) == wanted[2:]
        assert not sample.new_parameters and not sample.deleted_parameters


def test_joint_states(client: Client) -> None:
    message = JointState(name=['joint'], position=[0.0], effort=[0.0])
    numbers = [('i', partial(setattr, message.header.stamp, 'sec')),
               ('I', partial(setattr, message.header.stamp, 'nanosec')),
               ('d', partial(message.position.__setitem__, 0)),
               ('d', partial(message.effort.__setitem__, 0))]
    one, = received(client, message, numbers, [(1, 2, 0.5, -0.25)])
    assert (list(one.name), list(one.position), list(one.velocity), list(one.effort)) == (
        ['joint'], [0.5], [], [-0.25])
    assert (one.header.stamp.sec, one.header.stamp.nanosec) == (1, 2)


def test_rows_of_numbers(client: Client) -> None:
    names = ['a', 'bc', 'def']
    message = JointState(name=names)
    numbers = [('i', partial(setattr, message.header.stamp, 'sec')),
               ('I', partial(setattr, message.header.stamp, 'nanosec')),
               ('3d', partial(setattr, message, 'position')),
               ('3d', partial(setattr, message, 'effort'))]
    values = [(1, 2, *range(6)), (3, 4, *(-0.5 * number for number in range(6)))]
    for one, wanted in zip(received(client, message, numbers, values), values, strict=True):
        assert (list(one.name), len(one.velocity)) == (names, 0)
        assert (one.header.stamp.sec, one.header.stamp.nanosec,
                *one.position, *one.effort) == wanted


@pytest.mark.parametrize(('message', 'length'), [
    (JointState(name=['joint'], position=[0.0]), 60),
    (ParameterEvent(node='/axis', changed_parameters=[Parameter(name=name, value=ParameterValue(
        type=ParameterType.PARAMETER_DOUBLE)) for name in ('speed', 'torque')]), 156),
    (Float64(), 12),
], ids=['joint state', 'sample', 'number'])
def test_no_byte_more_than_a_message_has(message: Any, length: int) -> None:
    """
    As long as what an ordinary publisher sends: some tools refuse what is longer.

    Fast DDS serialises 68 bytes, and 172, of these: it has added up the alignment of empty arrays.
    """
    numbers = [('d', partial(setattr, message, 'data'))] if isinstance(message, Float64) else [
        ('d', partial(message.position.__setitem__, 0))] if isinstance(message, JointState) else [
        ('d', partial(setattr, entry.value, 'double_value'))
        for entry in message.changed_parameters]
    layout = find_layout(message, numbers)
    assert layout is not None
    assert len(b''.join(layout.constants)) + 8 * len(numbers) == length


def test_what_is_not_found_once_and_in_order_is_not_prepared(client: Client) -> None:
    joint, event = JointState(), ParameterEvent(changed_parameters=[
        Parameter(value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE)) for _ in range(2)])

    def put(value: float) -> None:
        for entry in event.changed_parameters:
            entry.value.double_value = value
    cases: list[tuple[Any, list[tuple[str, Any]]]] = [
        (joint, [('I', partial(setattr, joint.header.stamp, 'nanosec')),
                 ('i', partial(setattr, joint.header.stamp, 'sec'))]),
        (Bool(), [('d', lambda _: None)]), (event, [('d', put)])]
    for message, numbers in cases:
        publisher = client.node.create_publisher(
            type(message), f'/nothing_{type(message).__name__.lower()}', 1)
        assert PreparedMessage.find(publisher, message, numbers) is None, numbers
        client.node.destroy_publisher(publisher)


def test_destroyed_publisher_raises_what_everybody_expects(client: Client) -> None:
    message = Float64()
    publisher = client.node.create_publisher(Float64, '/nothing_double', 1)
    prepared = PreparedMessage.find(publisher, message, [('d', partial(setattr, message, 'data'))])
    assert prepared is not None
    prepared.publish((1.0,))
    client.node.destroy_publisher(publisher)
    with pytest.raises(rclpy_implementation.RCLError):
        prepared.publish((2.0,))
