# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The rule book of stops, lived through: all sequences of events, against a motor that obeys.

These are the rules of ``core/stop_duty.py`` alone, without a session and without a codec. On the
other side is a drive, literally: a register for each channel, which holds what has *arrived*, and
a motor that runs as long as one of them says so. Frames may be lost, maps may lead them elsewhere,
and the bridge knows of that only what it is told. All that can happen happens in every order, up
to :data:`DEPTH` moves; states that are equal are merged.

What must hold:

1. A motor that runs by our word is owed something.
2. A motor that runs, and whose stop has not left or was not heard, is told to stop whenever the
   bridge turns to anything else, and is named when nothing more is sent.
3. Nobody is told to stop, or named, who was told to run by nothing since a stop was shown.
4. What has not heard cycles is not left to cycles.

The second and the third leave no room between them: what has to be done is compared to what the
rules say, move by move.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

from drive_can_bridge.core.stop_duty import (
    CONTROL_WORD, CYCLE, Debt, Do, Happened, Rule, RULES, StopDuty,
)

#: so many moves are made one after the other
DEPTH = 6
#: a setpoint that is written by number
SETPOINT = 'setpoint'

Table = Mapping[tuple[Debt, Happened], Rule]
Move = tuple[str, str]


class Violation(AssertionError):
    """What must hold does not, after these moves."""


class Kind(NamedTuple):
    """By what a drive is told; ``acknowledged``: it says of each write that it has taken it."""

    channels: tuple[str, ...]
    acknowledged: bool = False


#: the ways in which families tell their drives; first those that take few moves to look at
KINDS = {
    'cycles alone': Kind((CYCLE,)),
    'writes that are acknowledged': Kind((SETPOINT, CONTROL_WORD), acknowledged=True),
    'cycles, and a word by number': Kind((CYCLE, CONTROL_WORD)),
    'writes that nobody acknowledges': Kind((SETPOINT, CONTROL_WORD)),
}


class Channel(NamedTuple):
    """
    One channel as it is, and as the bridge can know it.

    :ivar turns: what has arrived in the drive runs the motor.
    :ivar told: it was told to run since it was last certain to stand.
    :ivar stopped: a stop has left since.
    :ivar silent: the drive has been silent since.
    :ivar strict: a stop is there when it is acknowledged.
    :ivar lost: what left last has not arrived.
    """

    turns: bool = False
    told: bool = False
    stopped: bool = False
    silent: bool = False
    strict: bool = False
    lost: bool = False

    @property
    def runs(self) -> bool:
        """It was told to run, and nothing has stopped it."""
        return self.told and (self.strict or not self.stopped)

    @property
    def stop_pending(self) -> bool:
        """It is to be told once more."""
        return self.runs or self.told and self.silent


#: of which nothing is owed, as far as the bridge knows
AT_REST = Channel()


class State(NamedTuple):
    """All that the future depends on; ``routed``: cycles reach what they are meant for."""

    channels: tuple[Channel, ...]
    debts: tuple[Debt, ...]
    routed: bool = True


def check(table: Table = RULES, depth: int = DEPTH, kinds: Sequence[str] = tuple(KINDS)) -> int:
    """
    Make all sequences of moves; return of how many, states merged.

    :raises Violation: the shortest sequence after which something does not hold.
    """
    made = 0
    for kind in kinds:
        start = State((AT_REST,) * len(KINDS[kind].channels),
                      (Debt.NONE,) * len(KINDS[kind].channels))
        seen, edge = {start}, [(start, ())]
        for _ in range(depth):
            following: list[tuple[State, tuple[Move, ...]]] = []
            for state, story in edge:
                for move in _moves(KINDS[kind], state):
                    made += 1
                    told = (*story, move)
                    try:
                        after = _live(KINDS[kind], table, state, move)
                    except Violation as violation:
                        raise Violation(f'{kind}: {violation}, after {list(told)}') from None
                    if after not in seen:
                        seen.add(after)
                        following.append((after, told))
            edge = following
    return made


def _moves(kind: Kind, state: State) -> Iterator[Move]:
    """Tell what can happen."""
    for name in kind.channels:
        routed = name != CYCLE or state.routed
        if routed:
            yield 'run', name
            yield 'stop', name
        yield 'run in vain', name
        yield 'stop in vain', name
    if state.routed and not any(channel.lost for channel in state.channels):
        yield 'answers', ''
    yield from (('confirms', ''), ('silent', ''), ('lost', ''), ('unanswered', ''),
                ('starts', ''), ('shows up', ''), ('ends', ''), ('given up', ''),
                ('bus lost', ''), ('said', ''), ('begins', ''))
    if CYCLE in kind.channels:
        yield ('maps', '') if state.routed else ('maps right', '')
        yield 'maps differ', ''     # routed: only the response map does


def _live(kind: Kind, table: Table, state: State, move: Move) -> State:
    """Make one move, and judge."""
    what, name = move
    duty = StopDuty(table)
    for channel, debt in zip(kind.channels, state.debts):
        if debt is not Debt.NONE:
            duty._debts[channel] = debt
    channels, routed = list(state.channels), state.routed
    if name:
        place = kind.channels.index(name)
        channels[place] = _frame(kind, duty, name, channels[place], what)
    elif what in ('maps', 'maps right'):
        routed = what == 'maps right'
    else:
        if what == 'maps differ' and not routed:
            _is(duty.channel(CYCLE, Happened.MISROUTED), Do.NOTHING)
            if not channels[0].silent:      # what stopped it by cycles stopped nobody
                channels[0] = channels[0]._replace(stopped=False)
        channels = _event(duty, channels, what)
    duty._look()
    after = State(tuple(channels), tuple(
        duty._debts.get(channel, Debt.NONE) for channel in kind.channels), routed)
    _judge(duty, after.channels)
    return after


def _frame(kind: Kind, duty: StopDuty, name: str, channel: Channel, what: str) -> Channel:
    """Have a frame leave, which arrives or does not."""
    arrives = not what.endswith('in vain')
    if what.startswith('run'):
        _is(duty.channel(name, Happened.RUN_WRITTEN if kind.acknowledged else
                         Happened.RUN_LEFT), Do.NOTHING)
        return channel._replace(
            turns=channel.turns or arrives, told=True, stopped=False, lost=not arrives,
            strict=kind.acknowledged)
    if kind.acknowledged and not arrives:
        return channel
    _is(duty.channel(name, Happened.STOP_LEFT), Do.NOTHING)
    if arrives and channel.strict:
        return AT_REST
    return channel._replace(
        turns=channel.turns and not arrives, stopped=channel.told, lost=not arrives)


def _event(duty: StopDuty, channels: list[Channel], what: str) -> list[Channel]:
    """Have something happen to the drive, and compare what the rules say is to be done."""
    if what == 'confirms':
        _is(duty.happened(Happened.STOPPED), Do.NOTHING)
        return [AT_REST for _ in channels]
    if what == 'answers':
        _is(duty.happened(Happened.ANSWERED), Do.NOTHING)
        return channels if any(channel.runs for channel in channels) else [
            AT_REST for _ in channels]
    told, stop_pending = (any(channel.told for channel in channels),
                  any(channel.stop_pending for channel in channels))
    if what == 'silent':
        _is(duty.happened(Happened.SILENT), Do.NOTHING)
        return _silent(channels)
    if what == 'lost':
        _is(duty.happened(Happened.LOST), Do.STOP if told else Do.NOTHING)
    elif what == 'unanswered':
        return _unanswered(duty, channels)
    elif what in ('starts', 'ends'):
        _is(duty.happened(Happened.STARTED if what == 'starts' else Happened.ENDS),
            Do.STOP if stop_pending else Do.NOTHING)
    elif what == 'shows up':
        _is(duty.happened(Happened.SHOWED_UP), Do.STOP_BY_NUMBER if told else Do.NOTHING)
        return _silent(channels)
    elif what == 'maps differ':
        unheard = any(channel.told and channel.silent for channel in channels)
        _is(duty.happened(Happened.MAPS_DIFFER),
            Do.STOP_BY_NUMBER if unheard else Do.STOP if told else Do.NOTHING)
    elif what == 'given up':        # whoever leaves so has waited for an answer
        _is(duty.happened(Happened.LEFT_ALONE), Do.WARN if stop_pending else Do.NOTHING)
    elif what == 'bus lost':
        return _bus_lost(duty, channels)
    else:       # whoever runs on was named, and is nothing of the next activation
        _is(duty.happened(Happened.SAID if what == 'said' else Happened.ACTIVATED), Do.NOTHING)
        return [AT_REST for _ in channels]
    return channels


def _unanswered(duty: StopDuty, channels: list[Channel]) -> list[Channel]:
    fresh = not any(channel.runs for channel in channels) and any(
        channel.told and not channel.silent for channel in channels)
    stop_pending = any(channel.stop_pending for channel in channels)
    _is(duty.happened(Happened.UNANSWERED),
        Do.STOP_BY_NUMBER if fresh else Do.STOP if stop_pending else Do.NOTHING)
    return _silent(channels) if fresh else channels


def _bus_lost(duty: StopDuty, channels: list[Channel]) -> list[Channel]:
    """Have no answer come any more, and nothing be sent: whoever runs on is named."""
    _is(duty.happened(Happened.SILENT), Do.NOTHING)
    channels = _silent(channels)
    do = duty.happened(Happened.LEFT_ALONE)
    _is(do, Do.WARN if any(channel.stop_pending for channel in channels) else Do.NOTHING)
    if do is not Do.WARN and any(channel.turns for channel in channels):
        raise Violation('a motor that runs on is not named')
    return channels


def _silent(channels: Sequence[Channel]) -> list[Channel]:
    return [channel._replace(silent=channel.silent or channel.told and not channel.strict)
            for channel in channels]


def _is(do: Do, due: Do) -> None:
    if do is not due:
        raise Violation(f'the rules say {do.name}, and {due.name} is due')


def _judge(duty: StopDuty, channels: Sequence[Channel]) -> None:
    if any(channel.turns for channel in channels) and not duty.may_run:
        raise Violation('a motor runs, and nobody knows')
    if duty.may_run and not any(channel.told for channel in channels):
        raise Violation('nothing was told to run, and something is owed')
    if duty.stop_pending is not any(channel.stop_pending for channel in channels):
        raise Violation('a stop is owed' if duty.stop_pending else 'no stop is owed')
    if duty.unacknowledged is not any(channel.told and not channel.strict for channel in channels):
        raise Violation(
            'a stop is to be shown' if duty.unacknowledged else 'no stop is to be shown')


# -- changed tables -------------------------------------------------------------------------------


def changed(table: Table = RULES) -> Iterator[tuple[str, dict[tuple[Debt, Happened], Rule]]]:
    """Return every table in which one rule is another one, or is missing, and its name."""
    for key, rule in table.items():
        without = dict(table)
        del without[key]
        others = chain(
            (Rule(debt, rule.do) for debt in Debt if debt is not rule.becomes),
            (Rule(rule.becomes, do) for do in Do if do is not rule.do))
        name = f'{key[0].name}, {key[1].name}'
        yield f'{name}: no rule', without
        for other in others:
            yield (f'{name}: {other.becomes.name}, {other.do.name}', {**table, key: other})
