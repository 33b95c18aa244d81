# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Messages for joints mean the same, whether their bytes are known or not.

The bytes are those that a publisher sends: what the serialisation of a message gives is up to 12
bytes longer.
"""

from array import array
from collections.abc import Callable, Iterator
from itertools import combinations
import math
import struct
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from waiting import pause

from drive_can_bridge.ros import joint_reader
from drive_can_bridge.ros.joint_reader import ALIKE, JointReader

Arrive = Callable[[JointState], bytes]
NAMES = ['wj', 'nj', 'shoulder_pan_joint']
VALUES = [1.5, math.nan, -math.inf]


@pytest.fixture(scope='module', name='arrive')
def _arrive() -> Iterator[Arrive]:
    """Return what publishes a message, and returns what arrives."""
    context = Context()
    rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
    nodes = [Node(name, context=context, enable_rosout=False, start_parameter_services=False)
             for name in ('commander', 'reader')]
    publisher = nodes[0].create_publisher(JointState, 'joints', 10)
    subscription = nodes[1].create_subscription(JointState, 'joints', lambda _: None, 10)

    def until(found: Callable[[], Any]) -> Any:
        for _ in range(3000):
            if result := found():
                return result
            pause(0.005)
        raise AssertionError('nothing has arrived')

    def arrive(message: JointState) -> bytes:
        publisher.publish(message)
        data, _ = until(lambda: subscription.handle.take_message(JointState, True))
        return bytes(data)
    until(publisher.get_subscription_count)
    until(subscription.handle.get_publisher_count)
    yield arrive
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()


def exact(columns: Any) -> list[tuple[str, bytes]]:
    return [(quantity, array('d', values).tobytes()) for quantity, values in columns]


def knowing(arrive: Arrive, message: JointState) -> JointReader:
    """Return a reader that knows messages of that shape."""
    reader = JointReader()
    first = [reader(arrive(message)) for _ in range(ALIKE)]
    assert len({id(each.names) for each in first}) == ALIKE
    assert reader(arrive(message)).names is first[-1].names, 'it does not know it'
    return reader


KINDS = 'position', 'velocity', 'effort'


@pytest.mark.parametrize('frame_id', ['', 'base'])
@pytest.mark.parametrize('names', [['a', 'b'], NAMES], ids=['even', 'filled up'])
@pytest.mark.parametrize('kinds', [
    kinds for count in (1, 2, 3) for kinds in combinations(KINDS, count)], ids='-'.join)
def test_every_shape_that_arrives_is_known(arrive: Arrive, kinds: tuple[str, ...],
                                           names: list[str], frame_id: str) -> None:
    message = JointState(name=names, **{kind: [float(len(kind))] * len(names) for kind in kinds})
    message.header.frame_id = frame_id
    reader = knowing(arrive, message)
    values = {kind: VALUES[:len(names)] for kind in kinds}
    known = reader(arrive(message)).names
    for again in range(3):
        message = JointState(name=names, **values)
        message.header.frame_id, message.header.stamp.nanosec = frame_id, again
        read = reader(arrive(message))
        assert read.names is known
        assert exact(read.columns) == exact(values.items())
    # who sends bytes of its own may send some more behind
    assert reader(serialize_message(message)).names is known


@pytest.mark.parametrize('kinds', [
    {'velocity': VALUES}, {'position': VALUES, 'effort': [0.0, -0.0, 5e-324]},
    {'position': VALUES, 'velocity': [0.0] * 3, 'effort': [math.nan] * 3}], ids=str)
def test_numbers_of_a_known_shape(arrive: Arrive, kinds: dict[str, list[float]]) -> None:
    reader = knowing(arrive, JointState(name=NAMES, **{kind: [7.0] * 3 for kind in kinds}))
    message = JointState(name=NAMES, **kinds)
    message.header.stamp.sec, message.header.stamp.nanosec = -1, 2**32 - 1
    read = reader(arrive(message))
    assert read.names == NAMES
    assert exact(read.columns) == exact(kinds.items())


@pytest.mark.parametrize('message', [
    JointState(name=['wj', 'nj', 'shoulder_pan_join!'], velocity=VALUES),
    JointState(name=NAMES, position=VALUES),
    JointState(name=NAMES, velocity=VALUES[:2]),
    JointState(name=NAMES, velocity=VALUES, effort=[1.0]),
    JointState(name=NAMES[:1], velocity=[1.0]), JointState(name=NAMES), JointState(),
], ids=['name', 'quantity', 'too few', 'and another', 'less', 'nothing', 'empty'])
def test_another_shape_in_between(arrive: Arrive, message: JointState) -> None:
    known = JointState(name=NAMES, velocity=VALUES)
    reader = knowing(arrive, known)
    for _ in range(ALIKE + 2):
        read = reader(arrive(message))
        assert read.names == list(message.name)
        assert exact(read.columns) == exact(
            (kind, getattr(message, kind)) for kind in ('position', 'velocity', 'effort')
            if len(getattr(message, kind)))
    read = reader(arrive(known))
    assert (read.names, exact(read.columns)) == (NAMES, exact([('velocity', VALUES)]))


def test_commanders_who_take_turns(arrive: Arrive) -> None:
    def turn(number: int) -> list[JointState]:
        return [JointState(name=['a', 'b'], velocity=[1.0, float(number)]),
                JointState(name=['c', 'd'], velocity=[2.0, float(number)]),     # as long
                JointState(name=NAMES, position=VALUES, velocity=[float(number)] * 3)]
    reader = JointReader()
    known = [[reader(arrive(message)).names for message in turn(number)]
             for number in range(ALIKE)][-1]
    for number in range(3):
        for message, names in zip(turn(number), known):
            read = reader(arrive(message))
            assert read.names is names, 'it does not know it'
            assert read.names == list(message.name)
            assert exact(read.columns) == exact(
                (kind, getattr(message, kind)) for kind in KINDS if getattr(message, kind))


def test_a_frame_is_no_part_of_a_joint(arrive: Arrive) -> None:
    reader = knowing(arrive, JointState(name=NAMES, velocity=[0.0] * 3))
    message = JointState(name=NAMES, velocity=VALUES)
    message.header.frame_id = 'base'
    read = reader(arrive(message))
    assert (read.names, exact(read.columns)) == (NAMES, exact([('velocity', VALUES)]))


def test_high_byte_first(arrive: Arrive) -> None:
    """As another machine may write it: OMG DDS-XTypes 1.3, 7.6.3.1.2, CDR_BE."""
    reader = knowing(arrive, JointState(name=['ab'], velocity=[0.0]))
    body = (struct.pack('>iI', 1, 2) + struct.pack('>I4s', 1, b'')      # stamp, frame_id
            + struct.pack('>II4s', 1, 3, b'ab')                         # name
            + struct.pack('>II', 0, 1) + bytes(4) + struct.pack('>d', -2.5)
            + struct.pack('>I', 0))
    read = reader(struct.pack('>HH', 0, 0) + body)
    assert (read.names, exact(read.columns)) == (['ab'], exact([('velocity', [-2.5])]))


def too_many(count: int, order: str, frame_id: bytes) -> bytes:
    """Return a message without an end that says that it has so many names."""
    body = struct.pack(f'{order}iII', 1, 2, len(frame_id)) + frame_id
    body += bytes(-len(body) % 4) + struct.pack(f'{order}I', count)
    return struct.pack('>HH', int(order == '<'), 0) + body


@pytest.mark.parametrize('frame_id', [b'\0', b'a\0', b'ab\0', b'abc\0', b'x' * 60_000])
@pytest.mark.parametrize('order', ['<', '>'])
def test_too_many_names_are_refused_before_anybody_looks_at_them(order: str,
                                                                 frame_id: bytes) -> None:
    """There are none at all in these messages: whoever looked for them would say so."""
    for count in (1001, 8170, 2 ** 32 - 1):
        with pytest.raises(ValueError, match=f'{count} names, at most 1000 are allowed'):
            JointReader()(too_many(count, order, frame_id))
    with pytest.raises(ValueError, match='end too soon'):
        JointReader()(too_many(1000, order, frame_id))


def test_what_ends_too_soon_reaches_no_deserialiser(
        arrive: Arrive, monkeypatch: pytest.MonkeyPatch) -> None:
    def deserialise(*_: Any) -> None:
        raise AssertionError('some middlewares end the process')
    message = arrive(JointState(name=NAMES, velocity=VALUES))
    monkeypatch.setattr(joint_reader, 'deserialize_message', deserialise)
    for size in range(len(message)):
        with pytest.raises(ValueError, match=f'{size} bytes, which end too soon'):
            JointReader()(message[:size])
    for encoding in (b'\0\6', b'\0\7', b'\xff\xff'):
        with pytest.raises(ValueError, match='31 bytes, which end too soon'):
            JointReader()(encoding + bytes(29))


def test_as_many_as_are_allowed(arrive: Arrive) -> None:
    names = [f'joint_{number}' for number in range(1000)]
    read = JointReader()(arrive(JointState(name=names, velocity=[1.0] * 1000)))
    assert read.names == names
    with pytest.raises(ValueError):
        JointReader()(arrive(JointState(name=[*names, 'one more'])))


@pytest.mark.parametrize('data', [b'', b'\x00\x01\x00\x00', b'\xff' * 200])
def test_rubbish(arrive: Arrive, data: bytes) -> None:
    reader = knowing(arrive, JointState(name=NAMES, velocity=VALUES))
    with pytest.raises((RuntimeError, ValueError)):
        reader(data)


def test_bytes_that_say_nothing_may_be_any() -> None:
    # as rmw_fastrtps_cpp of Jazzy serialised it; ?? stands for what was in its memory before
    spelled = (
        '00010000 00000000 00000000 02000000 7800???? 03000000 03000000 776a00?? 03000000 6e6a00??'
        '13000000 73686f756c6465725f70616e5f6a6f696e7400?? 03000000'
        '000000000000f03f 0000000000000040 0000000000000840 00000000'
        '03000000 000000000000f03f 0000000000000040 0000000000000840 ???????????????? '
    ).replace(' ', '')
    clean, other = (bytes.fromhex(spelled.replace('??', each)) for each in ('00', 'a5'))
    reader = JointReader()
    names = [reader(clean if number % 2 else other).names for number in range(ALIKE)][-1]
    for data in (clean, other):
        read = reader(data)
        assert read.names is names, 'it does not know it'
        assert [(kind, list(values)) for kind, values in read.columns] == [
            ('position', [1.0, 2.0, 3.0]), ('effort', [1.0, 2.0, 3.0])]
