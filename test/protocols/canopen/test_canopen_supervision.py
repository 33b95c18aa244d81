# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A node beside a session, which is told what it has to do about it; node 5, in hex."""

import math

from builders import drive, frame
import pytest
from saying import says

from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.outbox import Outbox
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.statistics import DriveStatistics
from drive_can_bridge.protocols.canopen.addressing import name_of_object, object_of_name
from drive_can_bridge.protocols.canopen.supervision import Supervision

START = '000#0105'


class Exchange:
    """A session that writes down what it is told, beside the frames that are sent."""

    def __init__(self, **options: float) -> None:
        self.configuration = drive('canopen_pkw', station=5, **options)
        self.outbox = Outbox()
        self.report = Reporter(DriveStatistics(), '')
        self.online = False
        self.users = self
        self.reason = self.failed = ''
        self.told: list[object] = []
        self.supervision = Supervision(self)

    def node_free(self, free_at: float, now: float, *, anew: bool) -> None:
        self._write_down('free', free_at, anew)

    def lose(self, reason: str, now: float) -> None:
        self.reason = reason

    def fail_all(self, reason: str) -> None:
        self.failed = reason

    def node_closed(self, now: float) -> None:
        assert self.failed.endswith(f': {self.reason}')
        self._write_down('closed', self.reason, self.failed.startswith('no answer: '))

    def node_silent(self, now: float) -> None:
        self._write_down('silent', self.reason)

    def _write_down(self, *what: object) -> None:
        self.told += [*map(str, self.outbox.take()), what]

    def hears(self, text: str, now: float) -> list[object]:
        heard = frame(text)
        assert self.supervision.receive(heard.identifier, heard.data, now)
        return self.take()

    def at(self, now: float) -> list[object]:
        self.supervision.handle_timer(now)
        return self.take()

    def take(self) -> list[object]:
        self.told += map(str, self.outbox.take())
        told, self.told = self.told, []
        return told


def begun(**options: float) -> Exchange:
    """Return one whose node was started at 10 s."""
    exchange = Exchange(**options)
    exchange.supervision.begin(10.0)
    assert exchange.take() == [START, ('free', 10.05, True)]
    return exchange


def test_the_exchange_begins_anew_only_while_offline_and_for_a_reason() -> None:
    exchange = begun()
    assert exchange.hears('705#05', 10.01) == [('free', 10.01, True)], 'at last operational'
    assert exchange.hears('705#05', 10.2) == [('free', 10.01, False)], 'nothing new'
    exchange.online = True
    assert exchange.hears('705#05', 10.3) == [('free', 10.01, False)]


def test_a_node_that_stays_closed_moves_what_may_begin() -> None:
    exchange = begun()
    closed = ('closed', 'node is pre-operational', False)
    assert exchange.hears('705#7F', 10.2) == [START, closed, ('free', 11.2, True)]
    assert exchange.hears('705#7F', 10.25) == [('free', 11.25, True)], 'the same, for longer'
    assert exchange.supervision.refusal(11.24) == says(
        'drive_offline_because', reason=says('node_state', state='pre-operational'))
    assert exchange.supervision.refusal(11.25) == ''


def test_a_restart_is_told_and_the_node_started_first() -> None:
    exchange = begun()
    exchange.online = True
    assert exchange.hears('705#00', 12.0) == [
        START, ('closed', says('device_restarted'), True), ('free', 12.05, False)]
    assert exchange.report.take() == [Noted(says('booted'))]
    assert exchange.report.advice == says('restarted_waiting')


def test_heartbeats_that_cease() -> None:
    exchange = begun(heartbeat_timeout=0.5)
    exchange.online = True
    exchange.supervision.node.online()
    exchange.hears('705#05', 10.1)
    assert exchange.supervision.next_timer() == pytest.approx(10.6)
    assert exchange.at(10.59) == []
    assert exchange.at(10.61) == [('silent', says('no_heartbeat', timeout=0.5))]
    assert exchange.at(10.7) == []


def test_a_node_that_is_not_used_is_only_listened_to() -> None:
    exchange = begun(heartbeat_timeout=0.5)
    exchange.supervision.stop()
    for text in ('705#00', '705#7F', '085#1023030000000000'):
        assert exchange.hears(text, 10.1) == []
    assert exchange.at(20.0) == []
    assert exchange.supervision.refusal(10.2) == ''
    assert exchange.supervision.node.facts()['nmt_state'] == 'pre-operational'
    assert exchange.supervision.node.ailing


def test_frames_of_others_and_malformed_ones() -> None:
    supervision = begun().supervision
    assert not supervision.receive(0x706, b'\x05', 10.1)
    assert not supervision.receive(0x485, bytes(8), 10.1)
    with pytest.raises(RemoteProtocolError):
        supervision.receive(0x705, b'', 10.1)
    with pytest.raises(RemoteProtocolError):
        supervision.receive(0x085, b'\x05', 10.1)


@pytest.mark.parametrize(('name', 'place'), [
    ('x2004.10', (0x2004, 0x10)), ('xA.0', (0xA, 0)), ('x20040.1', None), ('x2004.100', None),
    ('X2004.10', None), ('x2004', None), ('p455', None)])
def test_names_of_objects(name: str, place: tuple[int, int] | None) -> None:
    assert object_of_name(name) == place
    if place is not None:
        assert object_of_name(name_of_object(*place)) == place


def test_nothing_is_due_of_a_node_that_is_not_in_use() -> None:
    node = Exchange(heartbeat_timeout=0.3).supervision
    node.begin(10.0)
    node.receive(0x705, b'\x05', 10.1)
    assert node.next_timer() == 10.4
    node.stop()
    assert node.next_timer() == math.inf
    node.receive(0x705, b'\x05', 10.2)
    assert node.next_timer() == math.inf


# -- what people are told -------------------------------------------------------------------------

#: CiA 301: error code 2310h, error register 03h
OVERCURRENT = '085#1023030000000000'
NO_ERROR = '085#0000000000000000'


def test_emergency_and_its_end() -> None:
    exchange = begun()
    node = exchange.supervision.node
    assert (node.ailing, node.facts()['emergency']) == ('', 'none')
    exchange.hears(OVERCURRENT, 10.1)
    text = node.facts()['emergency']
    assert '2310h' in text
    assert node.ailing == f'emergency {text}: remove its cause'
    exchange.hears(OVERCURRENT, 10.2)      # nothing new
    exchange.hears(NO_ERROR, 10.3)
    assert node.ailing == ''
    assert exchange.report.take() == [
        Noted(f'emergency {text}', warning=True),
        Noted(says('emergency_over'))]


def test_state_and_missing_heartbeat() -> None:
    exchange = begun(heartbeat_timeout=0.1)
    node = exchange.supervision.node
    assert node.facts()['nmt_state'] == 'unknown'
    assert node.missing.startswith('no heartbeat although heartbeat_timeout is set')
    exchange.hears('705#05', 10.05)
    assert node.facts()['nmt_state'] == 'operational'
    assert node.missing == ''
    assert begun().supervision.node.missing == '', 'none is wanted'
