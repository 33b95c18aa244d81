# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is taken from a command subscription: the bytes of any publisher, and how old they are."""

from collections import deque
from collections.abc import Callable
from functools import partial
import math
from types import SimpleNamespace
from typing import Any, cast

import pytest
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Int64

from drive_can_bridge.core.command_age import Age
from drive_can_bridge.ros import polled_topics
from drive_can_bridge.ros.polled_topics import CommandTopic, COUNT_PERIOD, PolledTopics
from drive_can_bridge.ros.rcl import incoming
from drive_can_bridge.ros.rcl.incoming import by_hand, Incoming, subscribe

MS = 1_000_000


class Subscription:
    """Stands for what rclpy gives: a queue of bytes with their time stamps."""

    def __init__(self, kind: Any, depth: int = 8) -> None:
        self.msg_type = kind
        self.topic_name = '/belt'
        self.qos_profile = QoSProfile(depth=depth)
        self.handle = self
        self.waiting: deque[tuple[bytes, dict[str, Any]]] = deque()
        self.endless = False
        self.publishers = 1

    def get_publisher_count(self) -> int:
        return self.publishers

    def put(self, data: bytes, source: int = 0, received: int = 0) -> None:
        self.waiting.append((data, {'source_timestamp': source, 'received_timestamp': received}))

    def take_message(self, kind: Any, raw: bool) -> Any:
        assert raw
        if self.endless:
            self.put(serialize_message(self.msg_type()))
        return self.waiting.popleft() if self.waiting else None


class Taken:
    """A topic and what became of its messages."""

    def __init__(self, kind: Any, depth: int = 8, comes: Incoming | None = None) -> None:
        self.subscription = Subscription(kind, depth)
        self.used: list[Any] = []
        self.old: list[Any] = []
        self.late: list[float] = []
        self.begun: list[Age] = []
        self.unreadable: list[str] = []
        self.topic = CommandTopic(
            comes or by_hand(self.subscription),
            use=lambda message, _: self.used.append(message),
            old=self.old.append, aged=self._aged, unreadable=self.unreadable.append)

    def _aged(self, age: Age, seconds: float) -> None:
        if age in (Age.LATE, Age.CLOCKS_DIFFER):
            self.late.append(seconds)
        else:
            self.begun.append(age)

    def take(self, now: int = 20_000_000 * MS) -> None:
        """Take what waits; the time of the day shows what the steady clock does."""
        self.topic.take(1e-9 * now, (now, 0))


@pytest.mark.parametrize('message', [
    Float64(data=-12.5), Float64(data=math.inf), Int64(data=-7), Int64(data=2 ** 62),
    Bool(data=True), Bool(data=False)], ids=str)
def test_as_the_middleware_writes_it(message: Any) -> None:
    taken = Taken(type(message))
    taken.subscription.put(serialize_message(message))
    taken.take()
    assert taken.used == [message.data] and type(taken.used[0]) is type(message.data)


@pytest.mark.parametrize('kind, data, value', [
    # OMG DDS-XTypes 1.3, 7.6.3.1.2: CDR_BE 0000h, CDR_LE 0001h, CDR2_BE 0006h, CDR2_LE 0007h; two
    # octets of options, of which the last says how many bytes are padding
    (Float64, '00000000C029000000000000', -12.5), (Float64, '0001000000000000000029C0', -12.5),
    (Int64, '00060000FFFFFFFFFFFFFFF9', -7), (Int64, '00070000F9FFFFFFFFFFFFFF', -7),
    (Bool, '0000000001', True), (Bool, '0001000301000000', True), (Bool, '0001000000', False)])
def test_as_others_write_it(kind: Any, data: str, value: Any) -> None:
    taken = Taken(kind)
    taken.subscription.put(bytes.fromhex(data))
    taken.take()
    assert taken.used == [value] and not taken.unreadable


@pytest.mark.parametrize('kind', [Float64, Int64, Bool, JointState])
@pytest.mark.parametrize('data', [b'', b'\x00', b'\x00\x01\x00\x00', b'\xff' * 40,
                                  b'\x00\x01\x00\x00' + b'\xff' * 200, b'\x00\x01' + bytes(70000)])
def test_rubbish_is_no_exception(kind: Any, data: bytes) -> None:
    taken = Taken(kind)
    taken.subscription.put(data)
    taken.subscription.put(serialize_message(kind()))
    taken.take()
    assert len(taken.used) + len(taken.unreadable) == 2
    assert taken.used


@pytest.mark.parametrize('kind, size', [(Float64, 12), (Int64, 12), (Bool, 5), (JointState, 4)])
def test_what_is_too_short_reaches_no_deserialiser(kind: Any, size: int,
                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    def deserialise(*_: Any, **__: Any) -> None:
        raise AssertionError('some middlewares end the process')
    monkeypatch.setattr(polled_topics, 'deserialize_message', deserialise)
    taken = Taken(kind)
    for length in range(size):
        taken.subscription.put(bytes(length))
        taken.take()
    assert taken.unreadable == [f'{length} bytes, which end too soon' for length in range(size)]


def test_a_joint_state_is_an_object() -> None:
    taken = Taken(JointState)
    message = JointState(name=['belt'], velocity=[1.0])
    taken.subscription.put(serialize_message(message))
    taken.take()
    assert taken.used == [message]


@pytest.mark.parametrize('skew', [0, 3_600_000 * MS, -3_600_000 * MS],
                         ids=['one clock', 'publisher behind', 'publisher ahead'])
def test_age(skew: int) -> None:
    taken = Taken(Bool)
    data = serialize_message(Bool(data=True))

    def came(age: int) -> tuple[int, list[float]]:
        taken.used.clear()
        taken.late.clear()
        taken.subscription.put(data, 10_000_000 * MS, 10_000_000 * MS + skew + age * MS)
        taken.take()
        return len(taken.used), taken.late
    assert came(50) == (1, [])
    assert came(300) == (1, [])
    assert came(301) == (0, [pytest.approx(0.251)])
    assert came(2) == (1, [])           # the quickest so far
    assert came(252) == (1, [])
    assert came(253) == (0, [pytest.approx(0.251)])
    assert came(5000) == (0, [pytest.approx(4.998)])
    taken.topic.forget()                # another publisher, another clock
    assert came(5000) == (1, [])


def test_stamped_when_it_is_taken() -> None:
    """As rmw_cyclonedds 2.2.2 does it: what waits counts as come at the last look."""
    taken = Taken(Float64)
    # padded to four bytes: two octets of options say by how much (OMG DDS-XTypes 1.3, 7.6.3.1.2)
    data = bytes.fromhex('000100000000000000002440')
    start = 20_000_000 * MS

    def comes(at: int, published: int) -> tuple[int, list[float]]:
        taken.used.clear()
        taken.late.clear()
        taken.subscription.put(data, start + published * MS, start + at * MS + 1000)
        taken.take(start + at * MS)
        return len(taken.used), taken.late
    assert comes(0, -2) == (1, [])
    for at in range(20, 2000, 20):      # looked at every 20 ms, published 2 ms before
        assert comes(at, at - 2) == (1, [])
    # it waited here for 0.4 s, in which nobody looked: nothing is known against it
    assert comes(2400, 2020) == (1, [])
    # it was on its way as long: the look before would have found it
    assert comes(2420, 2021) == (0, [pytest.approx(0.377, abs=0.001)])
    assert comes(2440, 2438) == (1, [])


def by_executor(quality: QoSProfile, stamp: Callable[[], int]) -> tuple[Incoming, Any]:
    """Subscribe where an executor takes the messages; return what brings one, too."""
    callbacks: list[Any] = []

    def create(kind: Any, topic: str, callback: Any, quality: QoSProfile, **_: Any) -> Any:
        callbacks.append(callback)
        subscription = Subscription(kind)
        subscription.qos_profile = quality
        return subscription
    node: Any = SimpleNamespace(create_subscription=create, count_publishers=lambda _: 1)
    return subscribe(node, Float64, 'belt', quality, None, lambda _: None, stamp), callbacks[0]


@pytest.mark.parametrize(('quality', 'kept'), [
    (QoSProfile(depth=8), 8), (QoSProfile(history=HistoryPolicy.KEEP_ALL), incoming.KEPT_MAX)])
def test_what_an_executor_brings_waits_in_bounds(
        monkeypatch: pytest.MonkeyPatch, quality: QoSProfile, kept: int) -> None:
    """An inactive bridge takes none."""
    monkeypatch.setattr(incoming, 'why_not_by_hand', lambda: 'rclpy has no EventHandle any more')
    comes, brings = by_executor(quality, lambda: 0)
    for number in range(kept + 10):
        brings(number, {})
    waiting = [taken[0] for taken in iter(comes.take, None)]
    assert waiting == list(range(10, kept + 10))


def test_what_waited_for_an_executor_is_as_old(monkeypatch: pytest.MonkeyPatch) -> None:
    """The middleware had it in time, the exchange was in time; who brings it there was not."""
    monkeypatch.setattr(incoming, 'why_not_by_hand', lambda: 'rclpy has no EventHandle any more')
    clock = SimpleNamespace(now=20_000_000 * MS)
    comes_by, brings = by_executor(QoSProfile(depth=8), lambda: clock.now)
    taken = Taken(Float64, comes=comes_by)

    def comes(value: float, waited: int) -> tuple[list[float], list[float]]:
        """Have a message published at once, and brought so many ms later."""
        taken.used.clear()
        taken.old.clear()
        published, clock.now = clock.now, clock.now + waited * MS
        for now in range(published, clock.now, 20 * MS):
            taken.take(now)
        brings(serialize_message(Float64(data=value)), {
            'source_timestamp': published, 'received_timestamp': published + 100_000})
        clock.now += MS
        taken.take(clock.now)
        return taken.used, taken.old
    assert comes(0.0, 1) == ([0.0], [])
    assert comes(12.0, 200) == ([12.0], [])
    assert comes(15.0, 1000) == ([], [15.0])
    assert taken.late == [pytest.approx(0.999, abs=0.005)]
    assert comes(12.0, 1) == ([12.0], [])


def test_of_two_commanders_the_one_whose_clock_is_behind_can_only_stop() -> None:
    taken = Taken(Float64)
    taken.subscription.publishers = 2
    now = 10_000_000 * MS

    def sends(value: float, behind: int) -> tuple[list[float], list[float]]:
        now_used, now_old = len(taken.used), len(taken.old)
        taken.subscription.put(serialize_message(Float64(data=value)), now - behind * MS, now)
        taken.take()
        return taken.used[now_used:], taken.old[now_old:]
    assert sends(1.0, 0) == ([1.0], [])
    # a laptop whose clock lags moves nothing; what is neutral disarms all the same
    assert sends(2.0, 10_000) == ([], [2.0])
    assert sends(1.0, 0) == ([1.0], [])
    # one whose clock is ahead takes over, and the first can still stop
    assert sends(3.0, -10_000) == ([3.0], [])
    assert sends(1.0, 0) == ([], [1.0])
    assert len(taken.late) == 2     # and it is told
    taken.topic.forget()            # nobody publishes any more
    assert sends(1.0, 0) == ([1.0], [])


def test_what_is_thrown_away_may_still_stop() -> None:
    taken = Taken(Float64)
    taken.subscription.put(serialize_message(Float64(data=1.0)), 10_000 * MS, 10_000 * MS)
    taken.subscription.put(serialize_message(Float64(data=2.0)), 10_000 * MS, 10_300 * MS)
    taken.subscription.put(b'', 10_000 * MS, 10_300 * MS)
    taken.take()
    assert (taken.used, taken.old, len(taken.late), taken.unreadable) == ([1.0], [2.0], 2, [])
    taken.subscription.put(serialize_message(Float64(data=3.0)))
    taken.subscription.put(b'')
    assert taken.topic.discard((20_000_000 * MS, 0)) == 2
    assert (taken.used, taken.old, taken.unreadable) == ([1.0], [2.0, 3.0], [])


def test_a_middleware_without_time_stamps() -> None:
    taken = Taken(Bool)
    for _ in range(3):
        taken.subscription.put(serialize_message(Bool(data=True)), 0, 0)
    taken.take()
    assert taken.used == [True] * 3


def test_where_everything_is_kept_everything_is_thrown_away() -> None:
    """What would be left is stale, and its time stamps do not tell: it came in time."""
    taken = Taken(Float64)
    taken.subscription.qos_profile = QoSProfile(history=HistoryPolicy.KEEP_ALL)
    topic = CommandTopic(
        by_hand(taken.subscription), use=lambda message, _: taken.used.append(message),
        old=taken.old.append, aged=taken._aged, unreadable=taken.unreadable.append)
    for value in range(2500):
        taken.subscription.put(serialize_message(Float64(data=float(value))))
    assert topic.discard((20_000_000 * MS, 0)) == 2500
    topic.take(1.0, (20_000_000 * MS, 0))
    assert not taken.used and len(taken.old) == 2500


def test_a_flood_is_taken_in_bounds() -> None:
    taken = Taken(Float64, depth=5)
    taken.subscription.endless = True
    taken.take()
    assert len(taken.used) == 5
    assert taken.topic.discard((20_000_000 * MS, 0)) == 5
    taken.subscription.endless = False
    assert taken.topic.discard((20_000_000 * MS, 0)) == 0


def test_drives_of_a_turn_count_their_publishers_in_different_cycles() -> None:
    now = 100.0
    clock = SimpleNamespace(now=lambda: now, stamp=lambda: round(1e9 * now))
    counted: dict[int, list[int]] = {}

    def count(station: int) -> None:
        counted.setdefault(cycle, []).append(station)
    drives = []
    for station in range(5):
        polled = PolledTopics(
            cast('Any', None), cast('Any', clock), cast('Any', None), cast('Any', None),
            shift=station * COUNT_PERIOD / 5)
        topic = Taken(Float64).topic
        topic.incoming = cast('Any', SimpleNamespace(
            publishers=partial(count, station), look=lambda: None, take=lambda: None))
        polled._topics.append(topic)
        drives.append(polled)
    for cycle in range(41):
        now = 100.0 + 0.01 * cycle + 0.001
        for polled in drives:
            polled.take(now)
    assert len(counted.pop(0)) == 5     # a command may wait already
    assert all(len(together) == 1 for cycle, together in counted.items() if cycle > 5)
    # and each after COUNT_PERIOD, as ever
    assert all([cycle for cycle, together in counted.items() if cycle > 5 and station in together]
               == list(range(6 + (station + 4) % 5, 41, 5)) for station in range(5))
