# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Nothing starts by itself, whatever happens to a drive: looked at from its motor.

The motors here are the worst that the manuals leave room for: whatever tells them to run starts
them, at once and however often it was said before, with whatever setpoint they hold; and after a
power failure they hold somebody else's preset. What happens is trips that somebody acknowledges at
the drive, hands that stop it, power failures, lost frames, and users who enable and disable.

A motor may start only after an ``~/enable`` that has not failed, and that nothing has ended since,
but for a moment after it was stopped at the drive: that is what nobody can know yet.
"""

import math

from any_order import PATIENCE
from builders import frame
from conversation import Conversation
from drives import Motor, PkwNode, ServoDrive
from hypothesis import example, given, strategies as st
import kinds
import pytest
from timeline import Timeline

from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.events import StationFound, StationLost

#: s until a frame is answered
DELAY = 0.002
#: s without power that a drive may lose its setpoint in between two frames
SHORTEST_FAILURE = 0.005
#: raw value of the setpoint after a power failure
PRESET = 500
#: drives of one session that have a control word
KINDS = [kind for kind in kinds.KINDS if 'no word' not in kind and 'group' not in kind]


class Story:
    """
    A session, a drive, and what happens to both.

    :ivar allowed: whether the motor may start now.
    :ivar enabling: an ``~/enable`` waits for its answer.
    """

    def __init__(self, kind: str) -> None:
        row = kinds.KINDS[kind]
        self.unknown = 0.0 if 'by number' in kind else row.unseen
        self.device = row.make(lambda begins, moves: begins and self.starts(), 0)
        self.motor: Motor = self.device.registers
        self.motor.restarts(PRESET)
        self.powered = True
        self.talk = Conversation(*row.configure())
        self.line = Timeline(self.talk, self.answer)
        self.kind = kind
        self.allowed = self.enabling = False
        self.stopped_at = -math.inf     # by something else than the bridge
        self.deaf_until = self.mute_until = -math.inf
        self.lost_any = False
        self.online = False
        self.line.took(self.talk.begins())
        self.passes(0.5)
        assert self.online, 'a drive that is there is found'

    def starts(self) -> None:
        now = self.talk.now
        self.look()
        known = now - self.stopped_at > self.unknown + 1e-6
        assert self.allowed or not known, f'started by itself at {now}: {self.line.log[-20:]}'
        # where nobody acknowledges a setpoint, nobody knows that it got lost, or forgotten at once
        unheard = '11 bit' in self.kind and (
            self.lost_any or now - self.stopped_at < SHORTEST_FAILURE)
        setpoint = self.motor[self.motor.setpoint]
        assert setpoint == 0 or unheard or not known, (
            f'started with {setpoint} at {now}: {self.line.log[-20:]}')

    def answer(self, text: str) -> tuple[float, str] | None:
        now = self.talk.now
        if not self.powered:
            return None
        if now < self.deaf_until:
            self.lost_any = True
            return None
        answers = self.device.takes(frame(text))
        self.motor.look()
        if not answers or now < self.mute_until:
            return None
        return DELAY, str(answers[0])

    def look(self) -> None:
        """Record what ends an enable."""
        for event in self.talk.events():
            if isinstance(event, StationLost):
                self.allowed = self.online = False
            elif isinstance(event, StationFound):
                self.online = True
        for action, success, _ in self.talk.control_outcomes():
            if action == 'enable':
                self.enabling = False
                self.allowed = self.allowed and success

    # -- what happens -----------------------------------------------------------------------------

    def passes(self, seconds: float) -> None:
        self.line.live(self.talk.now + seconds)
        self.look()

    def asks(self, action: ControlAction) -> None:
        if self.talk.session.services.control_refusal(action):
            return
        if action is ControlAction.ENABLE:
            self.allowed = self.enabling = True
        elif action is ControlAction.DISABLE or action is ControlAction.QUICK_STOP and (
                'PKW' not in self.kind):    # whose profile here has none
            self.allowed = False
        self.talk.session.services.submit(ControlRequest(action), self.talk.now)
        self.line.took(self.talk.sent())
        self.look()

    def runs(self) -> None:
        """Have it run, as a user does."""
        self.asks(ControlAction.ENABLE)
        self.passes(0.4)
        self.talk.commands(0, 0.0, self.talk.now)
        self.talk.commands(0, 5.0, self.talk.now)
        self.passes(0.2)

    def stops_there(self, how: str) -> None:
        """Stop the motor at the drive: a trip, a hand, power."""
        self.stopped_at = self.talk.now
        # a call that nobody has answered yet goes on, unless the session sees what happened
        self.allowed = self.allowed and self.enabling
        if how != 'power':
            self.motor.stops(faulty=how == 'trip' or self.motor.faulty)
        else:
            self.powered = False
            self.motor.restarts(PRESET)
            if isinstance(self.device, (PkwNode, ServoDrive)):
                self.device.restarts()

    def comes_back(self) -> None:
        """Somebody acknowledges, or power is there again."""
        self.motor.faulty = False
        if not self.powered:
            self.powered = True
            self.stopped_at = self.talk.now     # another drive, as it were
            if isinstance(self.device, (PkwNode, ServoDrive)):
                self.line.took(self.talk.hears(f'70{self.device.node}#00', self.talk.now))

    def happens(self, what: str, seconds: float) -> None:
        if what in ('trip', 'hand', 'power'):
            self.stops_there(what)
        elif what == 'back':
            self.comes_back()
        elif what == 'deaf':
            self.deaf_until = self.talk.now + seconds
        elif what == 'mute':
            self.mute_until = self.talk.now + seconds
        elif what == 'run':
            self.runs()
        elif what in ('0', '5'):
            self.talk.commands(0, float(what), self.talk.now)
        else:
            self.asks(ControlAction(what))
        self.passes(seconds)


THINGS = st.lists(st.tuples(
    st.sampled_from(['run', 'run', 'enable', 'enable', 'disable', 'quick_stop', 'reset_fault',
                     '0', '5', 'trip', 'hand', 'power', 'power', 'back', 'back', 'deaf', 'mute']),
    st.sampled_from([0.0, 0.001, 0.003, 0.011, 0.03, 0.07, 0.15, 0.4, 1.3])), max_size=12)


@pytest.mark.timeout(PATIENCE)     # to find the shortest story
@pytest.mark.parametrize('kind', KINDS)
@given(things=THINGS)
@example(things=[('run', 0.0), ('power', 0.03), ('back', 1.3)])
@example(things=[('run', 0.0), ('trip', 0.03), ('back', 1.3)])
@example(things=[('run', 0.0), ('hand', 1.3)])
@example(things=[('run', 0.0), ('power', 1.3), ('back', 0.4), ('run', 0.1)])
# told to run as soon as it is there again, before anybody could notice
@example(things=[('power', 0.011), ('back', 0.0), ('run', 0.0)])
@example(things=[('run', 0.014), ('disable', 0.03), ('power', 0.0), ('back', 0.0), ('run', 0.0)])
# told to run while it is without power, unseen, and when it is there
@example(things=[('power', 0.4), ('enable', 0.001), ('back', 0.0)])
@example(things=[('power', 0.011), ('enable', 0.07), ('enable', 0.15), ('enable', 0.15),
                 ('back', 0.0)])
def test_nothing_starts_by_itself(kind: str, things: list[tuple[str, float]]) -> None:
    story = Story(kind)
    for what, seconds in things:
        story.happens(what, seconds)
    story.passes(3.0)


@pytest.mark.parametrize('kind', KINDS)
def test_users_start_it(kind: str) -> None:
    story = Story(kind)
    story.runs()
    assert story.motor.runs
    assert story.motor[story.motor.setpoint] not in (0, PRESET)
    story.stops_there('trip')
    story.passes(0.5)
    story.comes_back()
    story.passes(3.0)
    assert not story.motor.runs
    story.runs()
    assert story.motor.runs
