# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Whatever was told to run is told to stop, in every state of the conversation.

The drive was told 100 rpm. Then the bridge stands still, the bus goes, the maps change, or the bus
refuses frames: there is always a frame that stops it, or a warning that it may still be running.
"""

from collections.abc import Callable
from dataclasses import replace

from builders import CONTROL, LIMIT, SPEED, TABLE, WORD
from conversation import Conversation
from extended_builders import (
    ANSWER, ASK_LIMIT, ASK_REQUEST_MAP, ASK_RESPONSE_MAP, ASK_SPEED, checked, DISABLE, ENABLED,
    exchange, LIMIT_IS_ZERO, LIMIT_ZERO, NEUTRAL, online, REQUEST_MAP, RESPONSE_MAP, RUNNING,
    SPEED_IS_ZERO, SPEED_ZERO, TICK,
)
import pytest
from saying import may_run, says
from stops import last_cycles, STOP_CYCLES

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import DriveState, Noted, StationLost

#: what is told of a stop that nobody has answered
UNHEARD = may_run('stop_failed', what=[
    says('write_unanswered', what='speed_setpoint (P50)'),
    says('write_unanswered', what='torque_limit (P51)')])
STOPPED_BY_NUMBER = [SPEED_ZERO, LIMIT_ZERO, ASK_SPEED]


def warnings(talk: Conversation) -> list[str]:
    return [note.text for note in talk.events(Noted) if note.warning]


def running(**options: object) -> Conversation:
    """Return a drive that was told 100 rpm at 10.02 s."""
    talk = online(rearm_immediate=True, **options)
    talk.commands(0, 100.0, 10.003)
    assert exchange(talk, 10.02) == RUNNING
    talk.events()
    return talk


def confirmed(talk: Conversation, now: float) -> list[str]:
    """Let a drive that has just been asked for its speed confirm the stop."""
    assert talk.hears(SPEED_IS_ZERO, now) == [ASK_LIMIT]
    return talk.hears(LIMIT_IS_ZERO, now + 0.001)


def stopped_by_number(talk: Conversation, begun: list[str]) -> list[str]:
    """See that the drive is told to stop, and have it confirm that; return what follows."""
    assert begun + [text for _, text in talk.until(talk.now + 0.003)] == STOPPED_BY_NUMBER
    assert talk.session.may_run
    following = confirmed(talk, talk.now + 0.001)
    assert not talk.session.may_run
    return following


# -- the process stood still ----------------------------------------------------------------------


def test_stop_under_way_is_not_begun_anew() -> None:
    talk = running()
    assert talk.handle_stall(12.0) == [SPEED_ZERO]
    assert talk.events() == [StationLost(says('bridge_stood_still'))]
    assert talk.until(12.004) == [(12.001, LIMIT_ZERO), (12.002, ASK_SPEED)]
    assert talk.handle_stall(12.05) == []
    assert talk.until(12.06) == []
    assert talk.hears(SPEED_IS_ZERO, 12.061) == [ASK_LIMIT]
    assert talk.hears(LIMIT_IS_ZERO, 12.062) == [ASK_REQUEST_MAP]


def test_stall_with_assumed_maps_needs_no_writes() -> None:
    talk = running(mapping='assume')
    assert talk.handle_stall(12.0) == []
    assert talk.at(12.0) == [NEUTRAL]
    assert not talk.session.duty.stop_pending


def test_stop_that_nobody_had_answered_before_a_stall_is_told_again() -> None:
    """A drive that was deaf then runs on: silent as it is, its maps are all that is asked for."""
    talk = running()
    talk.commands(0, 0.0, 10.03)
    assert talk.until(10.04 + TICK) == [(10.04, NEUTRAL)]
    assert talk.handle_stall(11.5) == [SPEED_ZERO]
    talk.until(13.0)
    assert warnings(talk) == [UNHEARD]


# -- the bus went, and came back ------------------------------------------------------------------


def test_bus_that_comes_back_stops_the_drive_before_its_maps_are_read() -> None:
    talk = running()
    assert talk.bus_down(10.03) == []
    assert warnings(talk) == [may_run('bus_lost_before_stop')]
    assert stopped_by_number(talk, talk.bus_up(12.0)) == [ASK_REQUEST_MAP]
    checked(talk, 12.004)
    assert talk.at(12.006) == [NEUTRAL]
    assert warnings(talk) == []


def test_stop_that_a_lost_bus_cut_short_is_begun_anew() -> None:
    talk = running()
    assert talk.handle_stall(12.0) == [SPEED_ZERO]
    assert talk.until(12.004) == [(12.001, LIMIT_ZERO), (12.002, ASK_SPEED)]
    assert talk.bus_down(12.05) == []
    assert talk.bus_up(13.0) == [SPEED_ZERO]
    assert [text for _, text in talk.until(13.002)] == [LIMIT_ZERO, ASK_SPEED]


def test_stop_under_way_is_begun_anew_by_the_end() -> None:
    """Whoever hears it only then gets all attempts, and not what is left of them."""
    talk = running()
    talk.handle_stall(12.0)
    assert [text for _, text in talk.until(12.25)].count(SPEED_ZERO) == 2
    assert talk.deactivate(12.25) == [SPEED_ZERO]
    assert [text for _, text in talk.until(13.0)].count(SPEED_ZERO) == 2
    assert talk.session.stopped
    assert warnings(talk) == [UNHEARD]


# -- the maps differ ------------------------------------------------------------------------------

OTHER_RESPONSE = '102007E4#00D200D100D30000'
OTHER_REQUEST = '102007A4#0033003200000000'


def look(talk: Conversation, speed: float = 100.0, request: str = RUNNING) -> None:
    """Cycle until the maps are looked at, at 11.002 s."""
    for cycle in range(2, 50):
        talk.commands(0, speed, 10.0 + 0.02 * cycle)
        assert exchange(talk, 10.0 + 0.02 * cycle) == request
    talk.commands(0, speed, 11.0)
    talk.until(11.0 + TICK)
    assert talk.hears(ANSWER, 11.002) == [ASK_REQUEST_MAP]
    talk.events()


def response_map_differs() -> Conversation:
    """Return a drive whose response map was found to differ while it ran, at 11.004 s."""
    talk = running()
    look(talk)
    assert talk.hears(REQUEST_MAP, 11.003) == [ASK_RESPONSE_MAP]
    assert talk.hears(OTHER_RESPONSE, 11.004) == []
    return talk


def test_response_map_that_differs_ends_with_neutral_cycles() -> None:
    talk = response_map_differs()
    assert talk.session.state is DriveState.MAPPING_DIFFERS
    assert talk.until(11.9) == last_cycles(NEUTRAL, 11.02)
    assert not talk.session.duty.stop_pending
    # what is answered by another map is not understood
    talk.events()
    assert talk.hears(ANSWER, 11.902) == []
    assert talk.samples() == []
    assert talk.session.state is DriveState.MAPPING_DIFFERS
    # whether the request map was still right then nobody has looked
    assert stopped_by_number(talk, talk.deactivate(12.0)) == []
    assert talk.session.stopped
    assert talk.session.state is DriveState.OFFLINE


def answered_neutral_cycles(request_map: str) -> Conversation:
    """Return a drive whose response map differs, and what it says to the look after, at 12.02."""
    talk = response_map_differs()
    for at, text in last_cycles(NEUTRAL, 11.02):
        assert talk.until(at + TICK) == [(at, text)]
        talk.hears(ANSWER, at + 0.002)
    assert talk.until(12.01) == [(12.004, ASK_REQUEST_MAP)]
    assert talk.hears(request_map, 12.02) == [ASK_RESPONSE_MAP]
    return talk


def test_neutral_cycles_count_when_the_request_map_is_still_right() -> None:
    talk = answered_neutral_cycles(REQUEST_MAP)
    assert talk.hears(OTHER_RESPONSE, 12.03) == []
    assert not talk.session.may_run
    talk.deactivate(12.04)
    assert talk.session.stopped


def test_neutral_cycles_that_went_elsewhere_are_followed_by_writes() -> None:
    talk = answered_neutral_cycles(OTHER_REQUEST)
    assert stopped_by_number(talk, talk.hears(OTHER_RESPONSE, 12.03)) == []


def test_response_map_that_differs_and_neutral_cycles_that_were_lost() -> None:
    talk = response_map_differs()
    assert [text for _, text in talk.until(11.9)] == [NEUTRAL] * STOP_CYCLES
    assert talk.until(12.01) == [(12.004, ASK_REQUEST_MAP)]
    assert talk.hears(REQUEST_MAP, 12.02) == [ASK_RESPONSE_MAP]
    assert stopped_by_number(talk, talk.hears(OTHER_RESPONSE, 12.03)) == []


def test_cycle_that_another_map_would_answer_is_neither_answered_nor_missed() -> None:
    talk = running()
    look(talk)
    talk.hears(REQUEST_MAP, 11.003)
    before = talk.session.statistics.missed, talk.session.statistics.exchanges
    talk.until(11.0209)     # a cycle is under way
    talk.hears(OTHER_RESPONSE, 11.021)
    after = talk.session.statistics.missed, talk.session.statistics.exchanges
    assert after == before
    talk.events()
    talk.hears(ANSWER, 11.022)
    assert talk.events() == []
    assert (talk.session.statistics.missed, talk.session.statistics.exchanges) == before
    assert [text for _, text in talk.until(11.9)] == [NEUTRAL] * STOP_CYCLES


def enabled_at_a_look(talk: Conversation) -> Conversation:
    """Have a drive enabled that was found at 10.002 s; its request map is asked for at 11.002."""
    talk.asks(ControlAction.ENABLE, 10.01)
    for cycle in range(1, 50):
        talk.until(10.0 + 0.02 * cycle + TICK)
        talk.hears(ENABLED if cycle > 2 else ANSWER, 10.002 + 0.02 * cycle)
    talk.until(11.0 + TICK)
    assert talk.hears(ENABLED, 11.002) == [ASK_REQUEST_MAP]
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    assert talk.session.duty.stop_pending
    talk.events()
    return talk


def test_request_map_that_differs_ends_with_writes_by_number() -> None:
    talk = running()
    look(talk)
    assert stopped_by_number(talk, talk.hears(OTHER_REQUEST, 11.003)) == []
    assert talk.session.state is DriveState.MAPPING_DIFFERS
    assert warnings(talk) == []


def test_what_is_kept_in_ram_is_stopped_before_what_may_be_an_eeprom() -> None:
    """Of two without ``storage`` the second waits 20 ms for the first; a RAM value does not."""
    slow_word, slow_speed = replace(WORD, storage=None), replace(SPEED, storage=None)
    table = (*(entry for entry in TABLE if entry not in (WORD, SPEED)), slow_word, slow_speed)
    talk = enabled_at_a_look(online(control=CONTROL, table=table, request=(slow_speed, LIMIT)))
    sent = [(11.003, text) for text in talk.hears(OTHER_REQUEST, 11.003)]
    sent += talk.until(12.0)
    assert [text for _, text in sent if text.startswith('003')] == [
        LIMIT_ZERO, DISABLE, SPEED_ZERO] * 3
    for (before, text), (after, _) in zip(sent, sent[1:]):  # nobody answers while it writes
        assert after - before >= (0.02 if text in (DISABLE, SPEED_ZERO) else 0.0) - TICK


def test_maps_are_rewritten_after_the_stop() -> None:
    talk = running(mapping='configure')
    look(talk)
    assert talk.hears(REQUEST_MAP, 11.003) == [ASK_RESPONSE_MAP]
    # the rewrite begins with map slot 0, and only then
    assert stopped_by_number(talk, talk.hears(OTHER_RESPONSE, 11.004)) == [
        '002007A1#0000000000000000']


@pytest.mark.parametrize('maps', [(OTHER_REQUEST,), (REQUEST_MAP, OTHER_RESPONSE)])
def test_map_that_differs_under_a_drive_at_rest_needs_no_stop(maps: tuple[str, ...]) -> None:
    talk = online()
    for cycle in range(1, 50):
        exchange(talk, 10.0 + 0.02 * cycle)
    talk.until(11.0 + TICK)
    assert talk.hears(ANSWER, 11.002) == [ASK_REQUEST_MAP]
    asked = [text for answer in maps for text in talk.hears(answer, 11.003)]
    assert asked == [ASK_RESPONSE_MAP] * (len(maps) - 1)
    assert talk.session.state is DriveState.MAPPING_DIFFERS
    assert talk.until(11.9) == []


def test_neutral_cycles_that_another_map_has_taken_were_no_stop() -> None:
    talk = running()
    look(talk, 0.0, NEUTRAL)     # with the map of somebody else, for who knows how long
    assert not talk.session.duty.stop_pending
    assert stopped_by_number(talk, talk.hears(OTHER_REQUEST, 11.003)) == []


def test_who_got_neutral_cycles_elsewhere_and_does_not_confirm_a_stop_is_named() -> None:
    talk = running()
    look(talk, 0.0, NEUTRAL)
    talk.hears(OTHER_REQUEST, 11.003)
    talk.until(12.0)
    assert warnings(talk) == [UNHEARD]


def test_who_got_neutral_cycles_elsewhere_is_named_when_the_bus_goes_in_its_stop() -> None:
    talk = running()
    look(talk, 0.0, NEUTRAL)
    assert talk.hears(OTHER_REQUEST, 11.003) == [SPEED_ZERO]
    talk.bus_down(11.0035)
    assert warnings(talk) == [may_run('bus_lost_before_stop')]


def test_neutral_cycles_that_a_look_has_backed_were_a_stop() -> None:
    talk = running()
    look(talk, 0.0, NEUTRAL)
    checked(talk, 11.002)
    for cycle in range(1, 50):
        assert exchange(talk, 11.0 + 0.02 * cycle) == NEUTRAL
    talk.until(12.0 + TICK)
    assert talk.hears(ANSWER, 12.002) == []
    talk.until(12.005)
    assert talk.hears(OTHER_REQUEST, 12.006) == []
    assert talk.session.state is DriveState.MAPPING_DIFFERS


def test_drive_that_was_deaf_comes_back_with_another_map() -> None:
    """It has heard none of the last neutral cycles, and goes on at the speed that it was told."""
    talk = running()
    last = [text for _, text in talk.until(12.0)]
    assert last.count(NEUTRAL) == STOP_CYCLES
    assert last[-1] == ASK_REQUEST_MAP
    assert talk.session.duty.stop_pending
    assert talk.hears(OTHER_REQUEST, 12.001) == [ASK_RESPONSE_MAP]
    assert stopped_by_number(talk, talk.hears(RESPONSE_MAP, 12.002)) == []
    assert talk.session.state is DriveState.MAPPING_DIFFERS


# -- frames that the bus refuses ------------------------------------------------------------------


def everything(text: str) -> bool:
    return True


def test_stop_of_a_lost_drive_counts_frames_that_were_taken() -> None:
    talk = running()
    talk.until(10.06 + TICK)        # two answers are missing
    talk.refusing = everything
    talk.until(10.2)
    talk.refusing = lambda text: False
    found = talk.until(10.4)
    assert [text for _, text in found[:3]] == [NEUTRAL] * 3


def test_maps_are_not_looked_at_again_before_the_last_cycles_have_left() -> None:
    """Who starts over does that; the look that was due meanwhile was in vain."""
    talk = running()
    talk.until(10.04 + TICK)
    talk.refusing = lambda text: text == NEUTRAL
    assert [text for _, text in talk.until(14.0)].count(ASK_REQUEST_MAP) == 1
    talk.refusing = lambda text: False
    assert [text for _, text in talk.until(14.3)][:STOP_CYCLES + 1] == [
        *[NEUTRAL] * STOP_CYCLES, SPEED_ZERO]


def test_word_that_was_refused_confirms_nothing() -> None:
    talk = online(control=CONTROL, request=(WORD, SPEED), mapping='assume')
    talk.asks(ControlAction.ENABLE, 10.003)
    talk.refusing = lambda text: text.startswith('003FFFF0#0001')
    assert talk.until(10.02 + TICK) == []
    talk.hears(ENABLED, 10.022)     # an answer to nothing that we know of
    assert talk.control_outcomes() == []
    assert not talk.session.duty.stop_pending


@pytest.mark.parametrize('refuses', [
    lambda text: text == DISABLE, everything])
def test_written_disable_that_was_refused_is_written_again(
        refuses: Callable[[str], bool]) -> None:
    talk = enabled_by_number(mapping='assume')
    talk.refusing = refuses
    assert talk.asks(ControlAction.DISABLE, 10.183) == []
    talk.refusing = lambda text: False
    assert DISABLE in [text for _, text in talk.until(10.21)]


# -- the drive falls silent -----------------------------------------------------------------------


def test_look_at_the_maps_that_the_stop_has_overtaken_shows_nothing_of_it() -> None:
    talk = running()
    look(talk)
    talk.commands(0, 0.0, 11.003)
    assert talk.hears(REQUEST_MAP, 11.004) == [ASK_RESPONSE_MAP]
    assert talk.until(11.02 + TICK) == [(11.02, NEUTRAL)]
    assert talk.hears(RESPONSE_MAP, 11.021) == []
    assert talk.session.duty.unacknowledged
    sent = [text for _, text in talk.until(13.0)]
    assert [text for text in sent if text.startswith('003003')] == [
        SPEED_ZERO, LIMIT_ZERO] * 3
    assert warnings(talk) == [UNHEARD]


def test_look_at_the_maps_shows_nothing_of_a_word_that_was_written_behind_it() -> None:
    talk = enabled_at_a_look(online(control=CONTROL))
    assert talk.hears(REQUEST_MAP, 11.004) == [ASK_RESPONSE_MAP]
    assert talk.asks(ControlAction.DISABLE, 11.005) == [DISABLE]
    talk.hears(RESPONSE_MAP, 11.006)
    assert talk.session.duty.unacknowledged


def test_nor_does_it_when_a_cycle_behind_that_word_was_answered() -> None:
    """Cycles are heard, and what is told by number is not any more: it reports enabled."""
    talk = enabled_at_a_look(online(control=CONTROL))
    assert talk.hears(REQUEST_MAP, 11.004) == [ASK_RESPONSE_MAP]
    assert talk.asks(ControlAction.DISABLE, 11.005) == [DISABLE]
    assert exchange(talk, 11.02, ENABLED) == NEUTRAL
    talk.hears(RESPONSE_MAP, 11.023)
    talk.until(13.0)
    assert warnings(talk) == [
        may_run('stop_failed', what=[says('write_unanswered', what='control_word (P52)')])]


def test_drive_that_falls_silent_with_its_disable_by_number_is_named() -> None:
    """It was not owed a stop when the one by number began; that fails after the last cycles."""
    talk = enabled_at_a_look(online(control=CONTROL))
    checked(talk, 11.003)
    assert talk.until(11.02 + TICK) == [(11.02, NEUTRAL)]
    assert talk.asks(ControlAction.DISABLE, 11.021) == [DISABLE]
    talk.until(13.0)
    assert warnings(talk) == [
        may_run('stop_failed', what=[says('write_unanswered', what='control_word (P52)')])]


def enabled_by_number(**options: object) -> Conversation:
    """Return a drive with neutral setpoints that was enabled by number; cycled until 10.18 s."""
    talk = online(control=CONTROL, **options)
    talk.asks(ControlAction.ENABLE, 10.003)
    for cycle in range(1, 10):
        talk.until(10.0 + 0.02 * cycle + TICK)
        talk.hears(ENABLED if cycle > 2 else ANSWER, 10.002 + 0.02 * cycle)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    talk.events()
    return talk


def test_answer_to_a_cycle_shows_nothing_of_a_word_that_was_written_behind_it() -> None:
    talk = enabled_by_number(mapping='assume')
    assert talk.until(10.2 + TICK) == [(10.2, NEUTRAL)]
    assert talk.asks(ControlAction.DISABLE, 10.201) == [DISABLE]
    talk.hears(ENABLED, 10.202)
    assert talk.session.duty.unacknowledged
    assert exchange(talk, 10.22) == NEUTRAL
    assert not talk.session.duty.unacknowledged


@pytest.mark.parametrize('mapping', ['verify', 'assume'])
def test_answer_that_finds_a_drive_shows_nothing_of_a_word_that_was_written_before(
        mapping: str) -> None:
    """It was deaf when it was told to disable, and is again when it is told that once more."""
    talk = enabled_by_number(mapping=mapping)
    talk.until(12.0)
    assert not talk.session.online
    if mapping == 'verify':
        checked(talk, talk.now)
    while NEUTRAL not in talk.at(talk.session.next_timer()):
        pass
    talk.events()
    assert talk.hears(ENABLED, talk.now + 0.002) == [DISABLE]
    assert talk.session.online
    talk.until(talk.now + 1.0)
    assert not talk.session.online
    unheard = may_run('stop_failed', what=[says('write_unanswered', what='control_word (P52)')])
    assert unheard in warnings(talk)


def test_disable_that_was_read_back_is_pending_no_more() -> None:
    """By the second reading of the stop by number; the cycles before were not answered."""
    talk = enabled_by_number()
    assert talk.until(10.363 + TICK)[-1] == (10.363, '00200341#0000000000000000')
    assert talk.session.duty.may_run
    talk.hears('10200341#0000000000000000', 10.365)
    assert not talk.session.duty.may_run
    assert talk.until(10.6)
    assert [note for note in talk.events(Noted) if note.danger] == []


def test_drive_whose_cycles_alone_are_dead_is_stopped_by_number() -> None:
    talk = running()
    sent = talk.until(10.1621)
    assert [text for _, text in sent[-5:]] == [NEUTRAL, NEUTRAL, *STOPPED_BY_NUMBER]
    assert confirmed(talk, 10.163) == [ASK_REQUEST_MAP]
    assert not talk.session.duty.stop_pending
    checked(talk, 10.164)
    assert {text for _, text in talk.until(10.22)} == {NEUTRAL}, 'and is looked for'
    assert warnings(talk) == []


def test_drive_that_answers_again_was_told_by_its_first_cycle() -> None:
    talk = running()
    talk.until(10.101)
    assert not talk.session.online
    assert talk.hears(ANSWER, 10.102) == []
    assert talk.until(10.1101) == [(10.11, ASK_REQUEST_MAP)]
    checked(talk, 10.11)
    assert talk.until(10.1201) == [(10.12, NEUTRAL)]
    assert talk.session.duty.unacknowledged
    talk.hears(ANSWER, 10.122)
    assert not talk.session.duty.unacknowledged
    assert warnings(talk) == [says('more_missed_would_hold')]


def test_silent_drive_with_assumed_maps_is_told_by_number_when_neutral_cycles_are_unanswered(
        ) -> None:
    talk = running(mapping='assume')
    sent = [text for _, text in talk.until(10.1621)]
    assert sent[-7:] == [NEUTRAL] * 3 + [SPEED_ZERO, NEUTRAL, LIMIT_ZERO, ASK_SPEED]
    assert {text for _, text in talk.until(12.0)} <= {
        NEUTRAL, *STOPPED_BY_NUMBER}, 'it is looked for by cycles'
    assert warnings(talk) == [UNHEARD]
    assert talk.session.duty.stop_pending
    talk.hears(ANSWER, 12.001)
    assert talk.session.online
    for cycle in range(1, 4):   # three that ran it went unanswered: these may be the answers
        assert talk.session.duty.stop_pending
        talk.hears(ANSWER, talk.until(12.0 + 0.02 * cycle + 0.001)[-1][0] + 0.001)
    assert not talk.session.duty.stop_pending
