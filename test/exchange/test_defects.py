# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A defect in what belongs to one drive stops that drive, and disturbs no other.

Two drives of a family run on one bus, in virtual time, and something raises in a step of the
session of the first, or in what its listener is told.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

from builders import ACTUAL, CONTROL, CURRENT, drive, frame, LIMIT, SPEED, STATUS, WORD
from coming import Coming
from drives import CannordDrive, ExtendedDrive, Motor, PkwNode, StandardDrive
from exchange_builders import Bench
from extent import some
import pytest

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.events import DriveFailed, DriveState, Noted, StationFound
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.exchange.member import Member

#: s: of the drives, and until an answer
PERIOD, DELAY = 0.05, 0.001
#: 100 % is 03E8h
TORQUE = replace(LIMIT, neutral=100.0, limit=True)


def _registers(second: int = 0) -> Motor:
    maps = zip(range(122, 130), (50, second, 0, 0, 209, 210, 211, 0))
    return Motor({**dict(maps), 51: 0, 209: 1000, 210: 250})


def _extended(*second: Parameter) -> tuple[list[DriveConfiguration], list[Any]]:
    return [drive(name=name, station=station, request=(SPEED, *second), period=PERIOD,
                  control=CONTROL if WORD in second else None)
            for name, station in (('first', 1), ('second', 2))], [
        ExtendedDrive(_registers(*(parameter.number or 0 for parameter in second)))
        for _ in range(2)]


def _single(protocol: str, make: Callable[[int, Motor], Any], *,
            control: bool = True, second: tuple[Parameter, ...] = (),
            ) -> tuple[list[DriveConfiguration], list[Any]]:
    return [drive(protocol, name=name, station=station, request=(SPEED, *second), period=PERIOD,
                  response=(ACTUAL, CURRENT, STATUS), control=CONTROL if control else None)
            for name, station in (('first', 1), ('second', 2))], [
        make(station, _registers()) for station in (1, 2)]


def _cannord(broadcast: str) -> tuple[list[DriveConfiguration], list[Any]]:
    return [drive('cannord', name=name, station=station, request=(SPEED,), period=PERIOD,
                  response=(ACTUAL, CURRENT), broadcast=broadcast)
            for name, station in (('first', 1), ('second', 2))], [
        CannordDrive(station, _registers(), *[0x400] * (broadcast != 'none'))
        for station in (1, 2)]


Kind = Callable[[], tuple[list[DriveConfiguration], list[Any]]]
KINDS: dict[str, Kind] = {
    '29 bit': _extended,
    '29 bit, word in its slot': lambda: _extended(WORD),
    '11 bit': lambda: _single('datamodel_standard', lambda _, cells: StandardDrive(cells)),
    '11 bit, without control': lambda: _single(
        'datamodel_standard', lambda _, cells: StandardDrive(cells), control=False),
    'CANnord': lambda: _cannord('none'),
    'CANnord group': lambda: _cannord('group'),
    'PKW': lambda: _single('canopen_pkw', PkwNode),
}
WITH_LIMIT: dict[str, Kind] = {
    '29 bit': lambda: _extended(TORQUE),
    '11 bit': lambda: _single('datamodel_standard', lambda _, cells: StandardDrive(cells),
                              second=(TORQUE,)),
    'PKW': lambda: _single('canopen_pkw', PkwNode, second=(TORQUE,)),
}


class World:
    """A bus with two drives that run."""

    def __init__(self, kind: str, kinds: dict[str, Kind] = KINDS) -> None:
        configurations, self.devices = kinds[kind]()
        self.group = 'group' in kind
        self.bench = Bench(*configurations)
        self.coming = Coming()
        self.frames: list[str] = []
        self.deaf = False
        self.bench.now = 10.0
        self.bench.exchange._last_pass = 10.0
        self.bench.begin()
        self.took()
        self.live(1.0)

    @property
    def exchange(self) -> Any:
        return self.bench.exchange

    def took(self) -> None:
        """Have the drives hear what was sent."""
        for text in self.bench.link.take():
            self.frames.append(text)
            sent = frame(text)
            for index, device in enumerate(self.devices):
                if self.deaf or not self._is_for(sent, index):
                    continue
                for answer in device.takes(sent):
                    self.coming.plan(self.bench.now + DELAY, partial(
                        self.exchange.frame_received, answer, 0.0))

    def _is_for(self, sent: Frame, index: int) -> bool:
        device, station = self.devices[index], index + 1
        if isinstance(device, ExtendedDrive):
            return sent.identifier >> 21 & 0x7F == station
        if isinstance(device, StandardDrive):
            return sent.identifier == 0x3F0 + station
        if isinstance(device, PkwNode):
            return sent.identifier == 0x500 + station or (
                sent.identifier == 0 and sent.data[1] == station)
        return True

    def live(self, seconds: float) -> None:
        bench = self.bench
        end = bench.now + seconds
        self.coming.live(
            bench, end, then=self.took, timers=self.timers,
            due=lambda: min(bench.now + PERIOD, *(
                member.due for member in self.exchange._members)))
        bench.now = end

    def timers(self) -> None:
        with self.exchange.lock:
            self.exchange._pass()

    def ask(self, index: int, action: ControlAction) -> None:
        session = self.bench.sessions[index]
        if session.control is not None:
            self.exchange.submit(session, ControlRequest(action))
            self.took()

    def run(self) -> None:
        """Have both run."""
        for index in (0, 1):
            if not self.group or index == 0:
                self.ask(index, ControlAction.ENABLE)
        self.live(0.5)
        for value in (0.0, 100.0):
            for notes in self.bench.notes[:1 if self.group else 2]:
                notes.commands.append((0, value))
            self.live(0.1)
        assert [device.registers[50] for device in self.devices] == [1000, 1000]

    def keep_commanding(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.1)):
            for notes in self.bench.notes[:1 if self.group else 2]:
                notes.commands.append((0, 100.0))
            self.live(0.1)


LISTENER = ('take_commands', 'process_data', 'request_sent', 'handle_event')
STEPS = ('receive_frame', 'handle_timer', 'take_frames', 'frames_left', 'take_events',
         'next_timer')


def raising(times: float, then: Callable[..., Any]) -> Callable[..., Any]:
    """Return what raises so often, and does then what it should."""
    left = [times]

    def step(*arguments: Any) -> Any:
        if left[0] > 0:
            left[0] -= 1
            raise KeyError('a defect')
        return then(*arguments)
    return step


@pytest.mark.parametrize(('kind', 'place', 'times'), some(product(
    KINDS, [*LISTENER, *STEPS], [1, float('inf')]), 7))
@pytest.mark.interpreted    # replaces methods
def test_a_defect_stops_one_drive_and_disturbs_no_other(
        kind: str, place: str, times: float, monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(kind)
    bench = world.bench
    assert all(session.online for session in bench.sessions)
    world.run()
    missed = bench.sessions[1].statistics.missed
    owner: Any = bench.notes[0] if place in LISTENER else bench.sessions[0]
    with monkeypatch.context() as patch:
        patch.setattr(owner, place, raising(times, getattr(owner, place)))
        bench.sessions[0].report.note(Noted('something to be told'))
        world.keep_commanding(0.6)
        assert bench.sessions[0].state is DriveState.OFFLINE
        assert 'KeyError' in bench.sessions[0].offline_advice
        # what cannot be asked any more what it wants sent, nobody can stop
        if times == 1 or place in (*LISTENER, 'receive_frame', 'take_events'):
            assert world.devices[0].registers[50] == 0
            assert world.devices[0].registers[52] == 0
        if not world.group:
            assert world.devices[1].registers[50] == 1000
            assert bench.sessions[1].state is DriveState.ONLINE
            assert bench.sessions[1].statistics.missed == missed
            assert not bench.sessions[1].defect
        world.keep_commanding(2.0)
        assert not [told for told in bench.bus_notes.told if told[0] == 'fatal']
    world.keep_commanding(4.0)
    # it has begun anew, as after a loss: nothing is resumed
    assert bench.sessions[0].online
    assert not bench.sessions[0].defect
    assert bench.sessions[0].state in (DriveState.NOT_ARMED, DriveState.DISABLED)
    assert world.devices[0].registers[50] == 0
    if place != 'handle_event' or times == 1:
        assert any(isinstance(event, DriveFailed) for event in bench.notes[0].events)
    world.run()


@pytest.mark.parametrize(('kind', 'place', 'mute'), some(product(
    KINDS, LISTENER, [False, True]), 5))
@pytest.mark.interpreted    # replaces methods
def test_a_listener_that_raises_costs_no_stop_frame(
        kind: str, place: str, mute: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stop of the end goes out whole, and to its end, whoever hears it."""
    ends = []
    for broken in (False, True):
        world = World(kind)
        world.run()
        world.deaf = mute
        if mute:
            world.coming.clear()
        if broken:
            monkeypatch.setattr(world.bench.notes[0], place, raising(
                float('inf'), getattr(world.bench.notes[0], place)))
        world.frames.clear()
        monkeypatch.setattr('time.sleep', lambda _, world=world: world.live(0.002))
        # the thread that waits is the only one
        monkeypatch.setattr(world.exchange, '_pass_to_stop', lambda: None)
        world.exchange.deactivate()
        world.took()
        assert all(session.stopped for session in world.bench.sessions)
        ends.append(world.frames)
        if not mute:
            assert [device.registers[50] for device in world.devices] == [0, 0]
    whole, broken_frames = ends
    assert {text for text in whole if whole.count(text) >= 3} <= set(broken_frames)
    for text in set(whole):
        assert broken_frames.count(text) >= min(3, whole.count(text)), text


@pytest.mark.parametrize('place', [0, 1])
@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.interpreted    # replaces methods
def test_a_drive_that_was_deaf_to_the_stop_for_a_defect_is_told_by_the_end(
        kind: str, place: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Within the second for which it is left alone, and whoever of a group it is."""
    world = World(kind)
    world.run()
    device, members = world.devices[place], world.exchange._members
    with monkeypatch.context() as patch:
        patch.setattr(device, 'takes', lambda sent: [])
        world.coming.clear()
        with world.exchange.lock:
            members[place].contain(KeyError('a defect'))
        world.took()
        world.live(0.9)
    session = members[place].session
    assert session.defect
    assert session.stopped
    assert session.stop_pending
    monkeypatch.setattr('time.sleep', lambda _: world.live(0.002))
    monkeypatch.setattr(world.exchange, '_pass_to_stop', lambda: None)
    assert world.exchange.deactivate()
    world.took()
    assert all(session.stopped for session in world.bench.sessions)
    assert [device.registers[50] for device in world.devices] == [0, 0]
    assert not any(session.stop_pending for session in world.bench.sessions)


def test_online_again_is_told() -> None:
    world = World('29 bit')
    world.run()
    world.bench.notes[0].failing = True
    world.live(0.1)
    world.bench.notes[0].failing = False
    world.bench.notes[0].events.clear()
    world.live(3.0)
    assert StationFound() in world.bench.notes[0].events


@pytest.mark.interpreted    # replaces methods
def test_the_same_defect_is_told_again_after_an_activation(
        monkeypatch: pytest.MonkeyPatch) -> None:
    world = World('29 bit')
    monkeypatch.setattr('time.sleep', lambda _: world.live(0.002))
    monkeypatch.setattr(world.exchange, '_pass_to_stop', lambda: None)
    session, notes = world.bench.sessions[0], world.bench.notes[0]
    for _ in range(2):
        notes.events.clear()
        with monkeypatch.context() as patch:
            patch.setattr(session, 'receive_frame', raising(1, session.receive_frame))
            world.live(0.1)
        assert [type(event) for event in notes.events].count(DriveFailed) == 1
        world.exchange.deactivate()     # before it is looked for again
        world.took()
        world.exchange.activate()
        world.took()
        world.live(1.0)
        assert session.online


@pytest.mark.parametrize('pause', [0.1, 0.999])    # s of the second in which it is left alone
@pytest.mark.parametrize('kind', WITH_LIMIT)
def test_a_limit_that_comes_behind_a_defect_is_obeyed(kind: str, pause: float) -> None:
    """It is taken in every state of an active bridge, and a drive that is lost is one."""
    world = World(kind, WITH_LIMIT)
    bench, torque = world.bench, world.devices[0].registers
    assert torque[51] == 0x03E8
    bench.notes[0].failing = True
    world.live(PERIOD)
    bench.notes[0].failing = False
    failed_at = bench.exchange._members[0].anew_at - 1.0
    world.live(failed_at + pause - bench.now)
    assert bench.sessions[0].defect
    bench.notes[0].commands += [(0, 0.0), (1, 30.0)]
    world.live(2.0)
    assert bench.sessions[0].online
    assert torque[51] == 0x012C
    # what else waited is of a drive that was lost: nothing is resumed, nor armed
    assert [item.armed for item in bench.sessions[0].setpoints.items] == [False, True]
    assert not bench.notes[0].commands


@pytest.mark.interpreted    # replaces methods
def test_a_limit_that_comes_at_the_end_behind_a_defect_is_of_no_activation(
        monkeypatch: pytest.MonkeyPatch) -> None:
    world = World('29 bit', WITH_LIMIT)
    bench = world.bench
    monkeypatch.setattr('time.sleep', lambda _: world.live(0.002))
    monkeypatch.setattr(world.exchange, '_pass_to_stop', lambda: None)
    bench.notes[0].failing = True
    world.live(PERIOD)
    bench.notes[0].failing = False
    world.exchange.deactivate()
    bench.notes[0].take_commands(bench.now)
    bench.notes[0].commands.append((1, 30.0))
    bench.notes[0].take_commands(bench.now)
    assert bench.sessions[0].setpoints.items[1].raw == 0x03E8


def test_what_waits_for_others_is_not_thrown_away_when_a_drive_begins_anew() -> None:
    """A message for all joints of a bus waits where any of its drives would take it."""
    world = World('29 bit')
    first = world.bench.notes[0]
    first.failing = True
    world.live(PERIOD)
    first.failing = False
    discarded = first.discarded
    world.live(2.0)
    assert first.session.online
    assert first.discarded == discarded


@pytest.mark.interpreted    # replaces methods
def test_what_comes_just_before_a_drive_begins_anew_is_of_a_drive_that_is_lost(
        monkeypatch: pytest.MonkeyPatch) -> None:
    world = World('29 bit')
    first, recover, waiting = world.bench.notes[0], Member.recover, []

    def command_and_begin(member: Member, now: float) -> None:
        first.commands.append((0, 0.0))
        recover(member, now)
        waiting.extend(first.commands)
    monkeypatch.setattr(Member, 'recover', command_and_begin)
    first.failing = True
    world.live(PERIOD)
    first.failing = False
    world.live(2.0)
    assert first.session.state is DriveState.NOT_ARMED
    assert not waiting
