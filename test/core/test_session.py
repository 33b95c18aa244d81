# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What all sessions share, shown with a session that does nothing of its own."""

import math
from typing import Any

from builders import CONTROL, drive, GAIN, parameter, read, SPEED, STATUS, WORD
import pytest
from saying import says

from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.drive_services import DriveServices
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.events import RequestCompleted, StationLost
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.requests import Failure, FailureKind, Request
from drive_can_bridge.core.session import Session


class Idle(Session):
    """Implements what has to be, and keeps what it is given."""

    waiting = 0
    longest_stop = 0.0

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.done: list[tuple[str, ...]] = []
        self.services = DriveServices(self, self.Server(self))

    class Server:
        """Lets everybody wait."""

        def __init__(self, session: 'Idle') -> None:
            self._session = session

        @property
        def waiting(self) -> int:
            return self._session.waiting

        def serve(self, request: Request, done: Any, now: float) -> None:
            self._session.waiting += 1

        def cancel(self) -> None:
            self._session.done.append(('cancel',))

        def known(self, request: Request) -> tuple[Any, ...]:
            return ()

    def prepare_stop(self, now: float) -> bool:
        return False

    def begin_stop(self, now: float) -> bool:
        raise NotImplementedError

    def begin(self, now: float) -> None:
        self.done.append(('begin', f'{now:g}', self.report.advice))
        self.online = True

    def fall_silent(self) -> None:
        self.done.append(('idle', self.report.advice))

    def lost(self, now: float, *, was_online: bool) -> None:
        self.done.append(('lost', self.report.advice))

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        self.outbox.put(frame)


DOWN = says('bus_is_down', bus='main', reason='unplugged')


def session(**options: object) -> Idle:
    configuration = drive(**options)
    table = configuration.profile.control
    control = ControlMachine(table, timeout=2.0) if table is not None else None
    return Idle(configuration, control)


def test_begins_when_bus_and_activity_are_there_in_any_order() -> None:
    for order in ('activate', 'bus_up'), ('bus_up', 'activate'):
        made = session()
        made.ever_online = True
        for now, call in enumerate(order):
            assert made.done == []
            getattr(made, call)(float(now))
        assert made.done == [('begin', '1', says('looked_for'))]
        assert not made.ever_online


def test_loss_of_the_bus() -> None:
    made = session()
    made.bus_up(1.0)
    made.activate(2.0)
    made.receive_frame(Frame(1, b'', False), 3.0)
    made.done.clear()
    made.bus_down(4.0, 'unplugged')
    assert made.done == [('cancel',), ('lost', DOWN), ('idle', DOWN)]
    assert made.take_events() == [StationLost(DOWN)]
    assert made.take_frames() == []
    made.services.submit(read(GAIN), 5.0)
    assert [event.outcomes for event in made.take_events()] == [
        (Failure(FailureKind.UNAVAILABLE, 'bus down'),)]


def test_refusals_in_order() -> None:
    made = session()
    reasons = []
    for change in (lambda: None, lambda: made.activate(1.0), lambda: made.bus_up(2.0)):
        change()
        made.services.submit(read(GAIN), 3.0)
        reasons += [event.outcomes for event in made.take_events()]
    assert reasons == [(Failure(FailureKind.UNAVAILABLE, 'bridge inactive'),),
                       (Failure(FailureKind.UNAVAILABLE, 'bus down'),)]
    assert made.waiting == 1
    made.waiting = 63
    made.services.submit(read(GAIN), 4.0)
    made.services.submit(read(GAIN, SPEED), 4.0)
    assert [event.outcomes for event in made.take_events()] == [
        (Failure(FailureKind.UNAVAILABLE, 'busy'),) * 2]
    assert made.statistics.requests_failed == 4


def test_empty_request_is_answered_at_once() -> None:
    made = session()
    made.activate(1.0)
    made.bus_up(1.0)
    empty = read()
    made.services.submit(empty, 2.0)
    assert made.take_events() == [RequestCompleted(empty, ())]
    assert made.waiting == 0


def test_control_word_that_no_control_uses_is_a_setpoint() -> None:
    plain = session(request=(WORD, SPEED))
    assert [item.parameter for item in plain.setpoints.items] == [WORD, SPEED]
    assert plain.services.write_refusal(WORD) == says('sent_cyclically', name='control_word')
    controlled = session(request=(WORD, SPEED), control=CONTROL)
    assert controlled.services.write_refusal(WORD) == 'use ~/enable'
    assert session(control=CONTROL).services.write_refusal(WORD) == 'use ~/enable'
    assert controlled.services.write_refusal(STATUS) == ''


def test_a_command_of_any_size_is_refused_not_a_defect() -> None:
    made = session(request=(parameter('free', 60, scale=0.01),))
    for value in (1.7e308, -1.7e308):
        with pytest.raises(ValueRefused):
            made.services.command(0, value, 1.0)
    assert made.statistics.commands_refused == 2


def test_reconfigure_changes_what_is_named() -> None:
    made = session()
    made.reconfigure()
    assert (made.configuration.command_timeout, made.configuration.rearm_immediate) == (0.5, False)
    made.reconfigure(command_timeout=0.0, rearm_immediate=True, parameter_timeout=0.3)
    assert (made.setpoints.timeout, made.setpoints.rearm_immediate) == (0.0, True)
    assert made.configuration.parameter_timeout == 0.3


def test_control_requests_need_a_drive() -> None:
    made = session(control=CONTROL)
    made.active = made.bus_available = made.online = True
    made.services.submit(ControlRequest(ControlAction.DISABLE), 1.0)
    assert made.take_events() == [], 'it waits for the drive'
    request = ControlRequest(ControlAction.DISABLE)
    without = session()
    without.services.submit(request, 1.0)
    assert without.take_events() == [
        ControlCompleted(request, False, says('no_control_section'))]


class Acting:
    """A part, or a channel, that notes when it has its turn."""

    def __init__(self, name: str, log: list[str], due: float = math.inf) -> None:
        self.due = due
        self._name = name
        self._log = log

    def handle_timer(self, now: float) -> None:
        self._log.append(self._name)

    advance = handle_timer

    def stop(self) -> None:
        self._log.append(f'{self._name} stops')

    def clear(self) -> None:
        self._log.append(f'{self._name} cleared')

    def handle_stall(self, now: float) -> None:
        self._log.append(f'{self._name} stood')


class Parts(Session):
    """Has nothing but parts; a stop of it takes as long as it takes."""

    longest_stop = 1.0

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.log: list[str] = []
        self.services = DriveServices(self, Idle.Server(Idle(drive(), None)))
        self.first, self.second = Acting('first', self.log), Acting('second', self.log)
        self.channel = Acting('channel', self.log)
        self.set_parts(self.first, self.second, channel=self.channel)

    def begin(self, now: float) -> None:
        self.log.append('begin')

    def begin_stop(self, now: float) -> bool:
        self.log.append('stop')
        return True

    def update_control_word(self, now: float) -> None:
        self.log.append('control word')

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        raise NotImplementedError


def with_parts(**options: object) -> Parts:
    configuration = drive(**options)
    table = configuration.profile.control
    made = Parts(configuration, None if table is None else ControlMachine(table, timeout=2.0))
    made.activate(0.0)
    made.bus_up(0.0)
    made.log.clear()
    return made


def test_parts_act_when_they_are_due_and_in_their_order() -> None:
    made = with_parts(control=CONTROL)
    assert made.next_timer() == math.inf
    made.first.due, made.second.due, made.channel.due = 7.0, 5.0, 6.0
    assert made.next_timer() == 5.0
    made.handle_timer(4.9)
    assert made.log == []
    made.handle_timer(5.0)
    assert made.log == ['second']
    made.log.clear()
    made.online = True
    made.services.submit(ControlRequest(ControlAction.ENABLE), 1.0)
    assert made.next_timer() == 3.0, 'control waits for 2 s'
    made.log.clear()
    made.handle_timer(7.0)
    assert made.log == ['first', 'second', 'control word', 'channel']
    (outcome,) = made.take_events()
    assert isinstance(outcome, ControlCompleted)
    assert not outcome.success


def test_a_stop_forgets_what_is_under_way_and_its_end_everything() -> None:
    made = with_parts()
    assert not made.stopped
    made.deactivate(1.0)
    assert made.log == ['channel cleared', 'stop']
    assert not made.stopped
    made.log.clear()
    made.stop_ended()
    assert made.log == ['channel cleared', 'first stops', 'second stops']
    assert made.stopped
    made.log.clear()
    made.deactivate(2.0)
    assert 'stop' not in made.log, 'there is nothing to be stopped'


def test_only_a_stop_is_ended() -> None:
    made = with_parts()
    made.stop_ended()
    assert made.log == []
    assert not made.stopped


def test_a_stall_begins_anew_but_lets_a_stop_go_on() -> None:
    made = with_parts()
    made.online = True
    made.handle_stall(5.0)
    assert made.log == ['channel stood', 'begin']
    assert made.take_events() == [StationLost(says('bridge_stood_still'))]
    made.deactivate(6.0)
    made.log.clear()
    made.handle_stall(8.0)
    assert made.log == ['channel stood']
    made.give_up(9.0)
    made.log.clear()
    made.handle_stall(10.0)
    assert made.log == ['channel stood']
