# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Whatever happens to drives, no motor runs on by our word: stories by the thousand, judged there.

A *story* is what happens to a drive that runs, one thing after the other: users, a bus, a drive
that is deaf, mute, late or without power, a process that stands still. Real sessions go through
it in virtual time, against drives that are registers and literal bytes. What is right is judged
from their motors, by these rules:

1. What runs and is not wanted any more has stopped, 3 s after the drive can be talked to again.
2. A stop that has ended without the word that the drive may still be running has stopped it.
3. A stop that was answered with success has stopped it; but for 11 bits without a control word
   where a write is lost and no round with it: nobody can see that until it is written again.
4. Nothing begins to run, or is given a setpoint, without an enable and a command of a user who
   meant it: later than the last loss, stall, stop, restart or end.
5. A drive that runs when its bus is lost is said to run, perhaps.
6. What can be talked to at the end has stopped then, in whatever state NMT has put its node; but
   for PKW, where nothing is sent by NMT at the end: such a node hears nothing, and is named.
7. Nobody cuts off the braking of a quick stop: 0000h comes when the axis stands.

Nothing in here asks a session what it owes, and no codec of the package is used.

.. code-block:: console

    $ python test/bench/stop_checker.py       # all stories of three things, then longer ones
    $ python test/bench/stop_checker.py --seed 5 --kind 'CANnord'
"""

import argparse
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, count, islice, product
import math
import random
import sys
import time
from typing import Any

from builders import frame
from coming import Coming
from drives import Motor, PkwNode, ServoDrive, StandardDrive
from kinds import KINDS, PERIOD

from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.events import Noted, StationFound, StationLost
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.requests import ReadRequest, WriteRequest
from drive_can_bridge.core.sentences import bridge_inactive
from drive_can_bridge.protocols.families import make_sessions

#: s until a frame is answered, and by a drive that is late
PROMPT, LATE, LATER, SLOW, SLOWER = 0.002, 1.4 * PERIOD, 0.16, 0.27, 0.4
#: s that a drive is talked to until it has to stand
STOPPED_AFTER = 3.0
#: stories that are told of each kind before the next has its turn
AT_ONCE = 100
#: s that a drive is left alone after an internal error, and for which its stop is waited for
LEFT_ALONE, STOP_MARGIN = 1.0, 0.5
#: s until the bridge has looked at maps that somebody has changed
MAPS_LOOKED_AT = 1.2
#: s by which a setpoint may be older than ``command_timeout`` when it reaches the drive
SLACK = 0.12
#: s between two heartbeats of a drive
BEATS_EVERY = 0.1
COMMAND_TIMEOUT = 0.5
#: raw and physical value of the setpoint that users want, and how often they say so (s)
RAW, VALUE, COMMANDED_EVERY = 50, 5.0, 0.1

#: what may happen, and how many s pass then
THINGS = ('run', 'enable', 'zero', 'quiet', 'disable', 'quick_stop', 'silent', 'mute', 'late',
          'twice', 'well', 'power', 'stall', 'late process', 'bus down', 'bus up', 'refuses',
          'maps', 'response map', 'maps right', 'nmt stop', 'end', 'begin', 'slow', 'lossy',
          'cycles lost', 'requests lost', 'trips', 'reset', 'nmt start', 'later', 'slower',
          'half refused', 'impatient', 'patient', 'asks', 'defect', 'cut end',
          'forgets')
PAUSES = (0.013, 0.9)
Story = tuple[tuple[str, float], ...]


class Violation(AssertionError):
    """A rule is broken."""


@dataclass
class Partner:
    """One drive, and what its users may expect of it."""

    index: int
    device: Any
    motor: Motor
    wanted: bool = False            # an enable that nothing has ended
    armed: bool = False             # a command that means it, and nothing has ended it
    unwanted_since: float = math.inf
    said: bool = False              # that it may still be running, since it was found
    unseen_until: float = -math.inf     # a restart
    boot_up_lost: bool = False
    left_over: bool = False         # it runs since an activation before, which ended with a word
    events: list[Any] = field(default_factory=list)


@dataclass
class Unheard:
    """
    Writes with 11 bits, which nobody acknowledges, that a drive did not hear.

    :ivar forever: it has answered a round since as if it had heard them.
    """

    write: bool = False
    read: bool = False
    forever: bool = False

    def goes(self, sent: Frame, *, lost: bool) -> None:
        """Take a frame."""
        writes = sent.data[0] == 6
        if lost:
            self.write, self.read = self.write or writes, self.read or not writes
        elif writes:
            self.write = self.forever = False
        else:
            self.forever = self.forever or self.write and not self.read
            self.write = self.read = False


class World:
    """
    Sessions of a kind, their drives, their users and their bus.

    :param lenient: what nobody can see is forgiven: short restarts, maps that somebody has
        rewritten since they were looked at last, and an RPDO whose SYNC was lost, as all RPDOs
        behind it were. It is to be stopped again, as whatever runs.
    """

    def __init__(self, kind: str, *, lenient: bool = True) -> None:
        self.kind = KINDS[kind]
        self.lenient = lenient
        self.unseen = self.kind.unseen if lenient else 0.0
        self.now = 10.0
        self.sessions = make_sessions(self.kind.configure())
        self.partners: list[Partner] = []
        for index in range(len(self.sessions)):
            device = self.kind.make(
                lambda begins, moves, index=index: self.moved(index, moves), index)
            self.partners.append(Partner(index, device, device.registers))
        self.leader = self.sessions[0]
        self.control = self.leader.control is not None
        self.deaf = self.mute = self.twice = self.refusing = False
        self.lossy = self.cycles_lost = self.requests_lost = self.half_refusing = False
        self.frames = 0     # both ways, while some are lost
        self.handed_out = 0     # while some are refused
        self.failed_at = math.inf
        self.sync_lost = False      # none was heard since
        self.bus = self.active = True
        self.delay = PROMPT
        self.coming = Coming()
        self.last_arrival = -math.inf
        self.looked_at = -math.inf
        self.unheard = Unheard()
        self.enabling = False   # a call that nobody has answered yet
        self.commanded_at = self.zero_at = -math.inf
        self.publish_at = math.inf
        self.beat_at = self.now if 'heartbeats' in kind else math.inf
        for session in self.sessions:
            session.bus_up(self.now)
            session.activate(self.now)
        self.took()
        self.live(0.6)
        if not all(session.online for session in self.sessions):
            raise Violation('a drive that is there is not found')

    # -- the bus ----------------------------------------------------------------------------------

    def took(self) -> None:
        """Have the drives hear what the sessions send, and listen to these."""
        for session, partner in zip(self.sessions, self.partners):
            while frames := session.take_frames():
                refused = [place for place in range(len(frames)) if self.refuses()]
                for place, each in enumerate(frames):
                    if place not in refused:
                        self.hear(each)
                    elif self.half_refusing and each.identifier == 0x80:
                        self.sync_lost = True
                session.frames_left(self.now, refused)
            for event in session.take_events():
                self.told(partner, event)

    def refuses(self) -> bool:
        """Return whether the bus does not take a frame."""
        self.handed_out += self.half_refusing
        return self.refusing or not self.bus or self.half_refusing and self.handed_out % 2 == 0

    def hear(self, sent: Frame) -> None:
        lost = self.deaf or self.drops(2)
        sync = sent.identifier == 0x80 and isinstance(self.partners[0].device, ServoDrive)
        self.sync_lost = self.sync_lost or sync and (lost or self.cycles_lost)
        if isinstance(self.partners[0].device, StandardDrive) and not self.control:
            self.unheard.goes(sent, lost=lost or self.cycles_lost)
        if lost:
            return
        self.hears(sent)
        rpdo = 0x200 <= sent.identifier < 0x580    # one that is heard takes effect instead
        self.sync_lost = self.sync_lost and not ((sync or rpdo) and not self.cycles_lost)

    def hears(self, sent: Frame) -> None:
        """Have the drives answer."""
        for partner in self.partners:
            if self.cycles_lost if partner.device.in_cycle(sent) else self.requests_lost:
                continue
            partner.device.now = self.now
            answers = partner.device.takes(sent)
            partner.motor.look()
            for answer in () if self.mute else answers * (1 + self.twice):
                if not self.drops(3):
                    self.comes(self.now + self.delay, partner.index, answer)

    def drops(self, share: int) -> bool:
        """Return whether a frame is one of those that a bad line loses."""
        self.frames += self.lossy
        return self.lossy and self.frames % share == 0

    def comes(self, at: float, index: int, answer: Frame) -> None:
        """Have something arrive then, if the bus is there."""
        def arrives() -> None:
            if self.bus:
                self.sessions[index].receive_frame(answer, self.now)
        self.last_arrival = max(self.last_arrival, at)
        self.coming.plan(at, arrives)

    def told(self, partner: Partner, event: Any) -> None:
        if isinstance(event, Noted):
            partner.said = partner.said or event.danger
        elif isinstance(event, StationFound):
            partner.said = False
        elif isinstance(event, StationLost):
            self.ends()
        elif isinstance(event, ControlCompleted) and (
                event.request.action is ControlAction.ENABLE):
            self.enabling = False
            if not event.success:
                self.ends()
        elif isinstance(event, ControlCompleted) and event.success and (
                self.now >= self.looked_at
                and event.request.action is not ControlAction.RESET_FAULT):
            for each in self.partners:
                if self.driven(each) and not (
                        each.wanted or each.left_over or self.now <= each.unseen_until
                        or self.unheard.forever):
                    raise Violation(f'drive {each.index + 1} runs, and was said to stand')

    def live(self, seconds: float) -> None:
        """Let time pass."""
        end = self.now + seconds
        self.coming.live(self, end, due=lambda: min(
            self.publish_at, self.recover_at, self.beat_at,
            *(session.next_timer() for session in self.sessions)),
            timers=self.timers, then=self.judged)
        self.now = end
        self.judged()   # also where nothing has happened, as on a bus that is down

    @property
    def recover_at(self) -> float:
        """When those that were left alone are looked for again; infinity: they are not."""
        if not self.active or self.failed_at == math.inf:
            return math.inf
        done = all(session.stopped for session in self.sessions)
        return self.failed_at + (LEFT_ALONE if done else max(LEFT_ALONE, STOP_MARGIN + max(
            session.longest_stop for session in self.sessions)))

    def timers(self) -> None:
        self.publish()
        if self.now >= self.beat_at:
            self.beat_at = self.now + BEATS_EVERY
            for partner in self.partners:
                if partner.device.number(0x1017) and not (self.mute or self.drops(3)):
                    self.comes(self.now + self.delay, partner.index, partner.device.beats())
        if self.now >= self.recover_at:
            for session in self.sessions:
                if not session.stopped:
                    session.give_up(self.now)
            self.failed_at = math.inf
            for session in self.sessions:
                session.recover(self.now)
        for session in self.sessions:
            if session.next_timer() <= self.now:
                session.handle_timer(self.now)

    def judged(self) -> None:
        self.took()
        self.judge()

    def publish(self) -> None:
        """Command what users have wanted, again and again, whatever became of the drive."""
        if self.now >= self.publish_at:
            self.publish_at = self.now + COMMANDED_EVERY
            self.command(VALUE)

    def command(self, value: float) -> None:
        self.commanded_at = self.now
        if not value:
            self.zero_at = self.now
        self.leader.services.command(0, value, self.now)

    # -- the judge --------------------------------------------------------------------------------

    def ends(self) -> None:
        """Record something after which nothing may be resumed."""
        for partner in self.partners:
            partner.armed = False
            if partner.wanted:
                partner.wanted = False
                partner.unwanted_since = self.now

    def moved(self, index: int, moves: bool) -> None:
        """Judge a motor that begins to run, or gets a setpoint (``moves``)."""
        partner = self.partners[index]
        if self.now < self.looked_at or self.now <= partner.unseen_until:
            partner.wanted = partner.armed = True   # as far as anybody but the drive can know
            return
        if self.lenient and self.sync_lost:     # and nothing that was sent since was heard
            return
        if self.control and not partner.wanted:
            raise Violation(f'drive {index + 1} starts by itself')
        if moves and not partner.armed:
            raise Violation(f'drive {index + 1} gets a setpoint that nobody has armed')
        if moves and self.now - self.commanded_at > COMMAND_TIMEOUT + SLACK:
            raise Violation(f'drive {index + 1} gets a setpoint that is '
                            f'{self.now - self.commanded_at:.3f} s old')

    def driven(self, partner: Partner) -> bool:
        """Tell whether something moves it."""
        return partner.motor.runs and (self.control or not partner.armed)

    def reachable(self) -> bool:
        return self.bus and not (self.deaf or self.mute or self.refusing or self.lossy
                                 or self.cycles_lost or self.requests_lost or self.half_refusing)

    def judge(self) -> None:
        """Judge motors that run although they shall not, and those that do not brake."""
        for partner in self.partners:
            if getattr(partner.device, 'cut_short', 0):
                raise Violation(f'drive {partner.index + 1} is not let brake')
            runs = partner.motor.runs
            partner.left_over = partner.left_over and runs and not partner.wanted
            wanted = partner.wanted if self.control else (
                partner.armed and self.now - self.commanded_at <= COMMAND_TIMEOUT)
            if partner.left_over or not runs or wanted:
                partner.unwanted_since = math.inf
            elif partner.unwanted_since == math.inf or not self.reachable() or not self.active:
                partner.unwanted_since = self.now
            elif self.now - partner.unwanted_since > STOPPED_AFTER:
                raise Violation(f'drive {partner.index + 1} runs on')

    def settle(self) -> None:
        """Let time pass until nothing runs that shall not; the judge says how long that takes."""
        self.live(0.6)
        while self.active and any(
                partner.unwanted_since < math.inf for partner in self.partners):
            self.live(0.2)

    def stop_is_honest(self, when: str) -> None:
        for partner in self.partners:
            if partner.motor.runs and not (partner.said or partner.left_over):
                raise Violation(f'{when}: drive {partner.index + 1} runs, and nobody says so')

    # -- what happens -----------------------------------------------------------------------------

    def happens(self, thing: str) -> None:
        looking = self.now < self.looked_at
        getattr(self, '_' + thing.replace(' ', '_'))()
        if looking and thing not in ('end', 'cut end'):      # which may keep the bridge from it
            self.looked_at = self.now + MAPS_LOOKED_AT
        self.took()

    def _ask(self, action: ControlAction) -> None:
        session = self.leader
        if session.services.control_refusal(action):
            return
        if session.control is None:
            for partner in self.partners:
                partner.armed = False
        elif action is ControlAction.ENABLE:
            self.enabling = True
            for partner in self.partners:
                partner.wanted = True
        elif action is ControlAction.DISABLE or action is ControlAction.QUICK_STOP and (
                session.control.table.quick_stop is not None):
            self.ends()
        session.services.submit(ControlRequest(action), self.now)

    def _enable(self) -> None:
        self._ask(ControlAction.ENABLE)

    def _zero(self) -> None:
        """Command neutral, which arms, and go on with what is wanted."""
        for partner in self.partners:
            partner.armed = True
        self.command(0.0)
        self.publish_at = self.now + 0.03

    def _run(self) -> None:
        self._enable()
        self.took()
        self.live(0.3)
        self._zero()
        self.live(0.15)

    def _quiet(self) -> None:
        self.publish_at = math.inf

    def _disable(self) -> None:
        self._ask(ControlAction.DISABLE)
        if not self.control:
            self._quiet()

    def _quick_stop(self) -> None:
        self._ask(ControlAction.QUICK_STOP)

    def _silent(self) -> None:
        self.deaf = True

    def _mute(self) -> None:
        self.mute = True

    def _late(self) -> None:
        self.delay = LATE

    def _twice(self) -> None:
        # answers that say nothing cannot be told apart where late ones never end
        self.twice = self.delay in (PROMPT, LATE) or not isinstance(
            self.partners[0].device, StandardDrive)

    def _later(self) -> None:
        self.delays(LATER)

    def _slow(self) -> None:
        self.delays(SLOW)

    def _slower(self) -> None:
        self.delays(SLOWER)

    def delays(self, seconds: float) -> None:
        self.delay = seconds
        if isinstance(self.partners[0].device, StandardDrive):
            self.twice = False      # as above

    def _lossy(self) -> None:
        self.lossy = self.now >= self.looked_at     # else nobody has looked at the maps by then

    def _cycles_lost(self) -> None:
        self.cycles_lost = True

    def _requests_lost(self) -> None:
        self.requests_lost = self.now >= self.looked_at     # as above

    def _trips(self) -> None:
        """Stop by a fault of their own; of one without a word nobody can tell when it ended."""
        if self.control:
            for partner in self.partners:
                partner.motor.stops(faulty=True)
            if not self.enabling:
                self.ends()

    def _reset(self) -> None:
        self._ask(ControlAction.RESET_FAULT)

    def _well(self) -> None:
        self.deaf = self.mute = self.twice = self.refusing = False
        self.lossy = self.cycles_lost = self.requests_lost = self.half_refusing = False
        self.delay = PROMPT

    def _power(self) -> None:
        """Lose power for a moment, unseen."""
        for partner in self.partners:
            partner.motor.restarts()
            if self.unseen:     # what was answered before arrives later
                partner.unseen_until = self.unseen + max(self.now + self.delay, self.last_arrival)
        if self.unseen == 0.0 or self.control:
            self.ends_unless_unseen()
        for partner in self.partners:
            if isinstance(partner.device, (PkwNode, ServoDrive)):
                partner.device.restarts()
                partner.boot_up_lost = self.mute or self.deaf or not self.bus
                if not partner.boot_up_lost:
                    self.comes(self.now + 0.001, partner.index,
                               frame(f'{0x700 + partner.device.node:03X}#00'))

    def _forgets(self) -> None:
        """Lose power, and be mapped as delivered then."""
        self._maps()
        for partner in self.partners:
            if isinstance(partner.device, ServoDrive) and (
                    self.leader.configuration.options.mapping != 'assume'):
                partner.device.initial[0x1600, 2] = bytes.fromhex('20007A60')
        self._power()

    def ends_unless_unseen(self) -> None:
        """Record a restart; a call that waits for its answer goes on."""
        if self.enabling:
            return
        if self.unseen == 0.0 or isinstance(self.partners[0].device, (PkwNode, StandardDrive)):
            self.ends()

    def _stall(self) -> None:
        self.now += 1.3
        self.ends()
        for session in self.sessions:
            session.handle_stall(self.now)

    def _late_process(self) -> None:
        """Stand still for less than a second; what arrived meanwhile comes first."""
        self.now += 0.4

    def _bus_down(self) -> None:
        if self.bus:
            forgiven = self.misrouted_unseen()
            for session in self.sessions:
                session.bus_down(self.now, 'unplugged')
            self.took()
            self.bus = False
            self.coming.clear()
            self.ends()
            if self.active and not forgiven:
                self.stop_is_honest('the bus is lost')

    def misrouted_unseen(self) -> bool:
        """
        Tell whether a stop was answered that has reached something else: docs/safety.md names it.

        A control word by number is not misrouted, and what is still told to run is said to.
        """
        told_to_run = (
            self.now - self.commanded_at <= COMMAND_TIMEOUT and self.now - self.zero_at > SLACK
            and any(partner.armed for partner in self.partners))
        return self.lenient and not self.control and self.now < self.looked_at and not told_to_run

    def _bus_up(self) -> None:
        if not self.bus:
            self.bus = True
            for session in self.sessions:
                session.bus_up(self.now)

    def _refuses(self) -> None:
        self.refusing = True

    def _half_refused(self) -> None:
        self.half_refusing = self.now >= self.looked_at     # as above

    def _impatient(self) -> None:
        self.reconfigures(0.2, 0.02)

    def _patient(self) -> None:
        self.reconfigures(COMMAND_TIMEOUT, 0.2)

    def reconfigures(self, command_timeout: float, parameter_timeout: float) -> None:
        """Have a user change what may change while drives run."""
        for session in self.sessions:
            session.reconfigure(
                command_timeout=command_timeout, parameter_timeout=parameter_timeout)

    def _asks(self) -> None:
        """Have users read and write all that they may, several times over."""
        for session in self.sessions:
            table = session.configuration.profile.parameters.values()
            readable = tuple(each for each in table if each.readable)
            for each in readable * 2:
                session.services.submit(ReadRequest((each,)), self.now)
                if not session.services.write_refusal(each):
                    session.services.submit(WriteRequest(((each, 1),)), self.now)

    def _defect(self) -> None:
        """Have the program fail, in what belongs to all of them."""
        if self.active and self.failed_at == math.inf:
            self.failed_at = self.now
            self.ends()
            for session in self.sessions:
                session.fail(bridge_inactive(), self.now)

    def _nmt_stop(self) -> None:
        """Have another master stop the nodes by NMT: they hear no PDO and no SDO, and run on."""
        self.commanded_by_nmt(2)

    def _nmt_start(self) -> None:
        """Have it start them, but for those of whose restart nobody can know then."""
        self.commanded_by_nmt(1)

    def commanded_by_nmt(self, command: int) -> None:
        for partner in self.partners:
            if isinstance(partner.device, (PkwNode, ServoDrive)) and not (
                    command == 1 and partner.boot_up_lost):
                partner.device.takes(Frame(0, bytes((command, partner.device.node)), False))

    def _maps(self) -> None:
        """Have somebody change the request map: what was the setpoint is nothing any more."""
        if self.kind.maps and not (self.lossy or self.requests_lost):
            self.looked_at = self.now + MAPS_LOOKED_AT
            for partner in self.partners:
                partner.motor[122] = 209

    def _response_map(self) -> None:
        """Have somebody change the response map: cycles still reach what they are meant for."""
        if self.kind.maps:
            for partner in self.partners:
                partner.motor[127] = 209

    def _maps_right(self) -> None:
        """Have somebody put back the maps."""
        if self.kind.maps:
            if any(partner.motor[122] != partner.motor.initial[122] for partner in self.partners):
                self.looked_at = self.now + MAPS_LOOKED_AT
            for partner in self.partners:
                for number in range(122, 130):
                    partner.motor[number] = partner.motor.initial[number]

    def _cut_end(self) -> None:
        """End, and lose the bus meanwhile."""
        self.coming.plan(max(self.now, self.looked_at) + 0.07, self._bus_down)
        self._end()

    def _end(self) -> None:
        """End, as the exchange does: wait for the stop, give up at last."""
        if not self.active:
            return
        if self.now < self.looked_at:   # until then nobody knows of other maps
            self.live(self.looked_at - self.now)
        self.active, self.failed_at = False, math.inf
        self.ends()
        for partner in self.partners:
            partner.said = False
        for session in self.sessions:
            session.deactivate(self.now)
        self.took()
        end = self.now + 0.5 + max(session.longest_stop for session in self.sessions)
        while not all(session.stopped for session in self.sessions) and self.now < end:
            self.live(0.02)
        for session in self.sessions:
            if not session.stopped:
                session.give_up(self.now)
        self.took()
        self.stop_is_honest('the end')
        for partner in self.partners:
            if partner.motor.runs and not partner.left_over and (
                    self.reachable() and not self.twice and self.delay == PROMPT
                    and getattr(partner.device, 'operational', True) | isinstance(
                        partner.device, ServoDrive)):
                raise Violation(f'the end: drive {partner.index + 1} runs, and would have heard')

    def _begin(self) -> None:
        if not self.active:
            self.active = True
            for partner in self.partners:
                partner.unwanted_since = math.inf
                partner.left_over = partner.motor.runs
            for session in self.sessions:
                session.activate(self.now)


def tell(kind: str, story: Story, *, lenient: bool = True) -> None:
    """
    Live through a story, and what follows: everything is well again, and ends.

    :raises Violation: a rule is broken.
    """
    world = World(kind, lenient=lenient)
    world.happens('run')
    if not all(partner.motor.runs for partner in world.partners):
        raise Violation('a drive does not run that was told to')
    for thing, seconds in story:
        world.happens(thing)
        world.live(seconds)
    world.happens('bus up')
    world.happens('well')
    world.settle()
    world.happens('end')


# -- stories --------------------------------------------------------------------------------------


def broken(kind: str, story: Story, *, lenient: bool = True) -> str:
    """Return which rule a story breaks; '' if none."""
    try:
        tell(kind, story, lenient=lenient)
    except AssertionError as violation:
        return str(violation)
    return ''


def shortest(kind: str, story: Story) -> tuple[Story, str]:
    """Leave away whatever a story does not need in order to break a rule."""
    changed = True
    while changed:
        changed = False
        for place in range(len(story)):
            shorter = story[:place] + story[place + 1:]
            if broken(kind, shorter):
                story, changed = shorter, True
                break
    return story, broken(kind, story)


def all_stories(depth: int) -> Iterator[Story]:
    """Return every story of so many things."""
    for things in product(product(THINGS, PAUSES), repeat=depth):
        yield tuple(things)


def some_stories(seed: int, depths: Sequence[int] = (3, 4, 5, 6)) -> Iterator[Story]:
    """Return stories by chance, without end."""
    chance = random.Random(seed)
    while True:
        yield tuple((chance.choice(THINGS), chance.choice((0.0, 0.003, *PAUSES, 0.11)))
                    for _ in range(chance.choice(depths)))


def check(kind: str, stories: Iterable[Story]) -> int:
    """
    Live through stories; return how many.

    :raises Violation: the shortest story that breaks a rule.
    """
    told = 0
    for story in stories:
        told += 1
        if broken(kind, story):
            least, why = shortest(kind, story)
            raise Violation(f'{kind}: {why}, after {list(least)}')
    return told


def main() -> int:
    """Check without end, and say how many stories were told."""
    parser = argparse.ArgumentParser(
        description='tell stories of drives that run, and look at their motors')
    parser.add_argument('--seed', type=int, default=int(time.time()))
    parser.add_argument('--kind', choices=KINDS, action='append', default=[])
    parser.add_argument('--depth', type=int, default=3, help='of the stories that are all told')
    parser.add_argument('--seconds', type=float, default=math.inf,
                        help='of the processor for stories by chance, then; without it they go '
                             'on without end')
    options = parser.parse_args()
    begun, number = time.monotonic(), 0
    print(f'seed {options.seed}', flush=True)
    rounds = chain((all_stories(depth) for depth in range(1, options.depth + 1)),
                   (islice(some_stories(seed), AT_ONCE) for seed in count(options.seed)))
    by_chance_at = math.inf
    try:
        for place, stories in enumerate(rounds):
            if place == options.depth:
                by_chance_at = time.process_time()
            while part := list(islice(stories, AT_ONCE)):
                for kind in options.kind or KINDS:
                    if time.process_time() >= by_chance_at + options.seconds:
                        return 0
                    number += check(kind, part)
                    print(f'{number} stories in {time.monotonic() - begun:.0f} s: nothing wrong '
                          f'with {kind}', flush=True)
    except Violation as violation:
        print(f'after {number} stories: {violation}')
        return 1
    except KeyboardInterrupt:
        pass
    return 0


if __name__ == '__main__':
    sys.exit(main())
