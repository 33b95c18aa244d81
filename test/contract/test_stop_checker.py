# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Stories of drives that run, judged from their motors; and some that show a broken stop."""

from itertools import islice, product
from typing import Any

from extent import some, times
import pytest
from stop_checker import (
    all_stories, broken, check, KINDS, shortest, some_stories, Story, tell, Violation,
)

from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.setpoints import Setpoint
from drive_can_bridge.core.stop_duty import Do, StopDuty
from drive_can_bridge.protocols.cia402.sdo_stop import SdoStop
from drive_can_bridge.protocols.cia402.standstill import Standstill
from drive_can_bridge.protocols.datamodel.setpoint_writer import SetpointWriter
from drive_can_bridge.protocols.exchange_book import ExchangeBook
from drive_can_bridge.protocols.safe_stop import SafeStop

#: stories by chance of each kind; ``make check-stops`` goes on for as long as somebody lets it
BY_CHANCE = times(3, 20)


@pytest.mark.parametrize('kind', KINDS)
def test_no_motor_runs_on(kind: str) -> None:
    everything = [*all_stories(1)]
    assert len(everything) == 78
    assert check(kind, some(everything, 6)) >= times(7, 78)
    assert check(kind, islice(some_stories(1), BY_CHANCE)) == BY_CHANCE


@pytest.mark.parametrize('kind', [kind for kind, entry in KINDS.items() if 0 < entry.unseen < 9])
def test_short_restarts_are_one_exception(kind: str) -> None:
    """docs/safety.md names them: with a word that is sent all the time, nobody can see them."""
    stories: list[Story] = [(('power', 0.9),), (('late', 0.013), ('power', 0.9)), *[
        (('quiet', 0.01 * place), ('power', 0.9)) for place in some(range(12), 3)]]
    assert not any(broken(kind, story) for story in stories)
    if '11 bit' not in kind and 'PKW' not in kind:      # which have to be very short
        assert any(broken(kind, story, lenient=False) for story in stories)


def test_maps_that_nobody_has_looked_at_since_are_the_other() -> None:
    """docs/safety.md names it: a stop went to something else, was answered, and the bus goes."""
    kind, story = '29 bit, no word', (('quiet', 0.013), ('maps', 0.9), ('bus down', 0.013))
    assert not broken(kind, story)
    assert broken(kind, story, lenient=False)
    told: Story = (('maps', 0.013), ('bus down', 0.013))    # what is still told to run is named
    assert not broken(kind, told, lenient=False)


@pytest.mark.parametrize('seconds', [0.0, 0.2, 1.0])
def test_such_a_drive_is_stopped_when_the_bus_is_back(seconds: float) -> None:
    """Its maps are read before anything else then; and what is told by number reaches it."""
    assert not broken('29 bit, no word', (
        ('quiet', 0.013), ('maps', 0.9), ('bus down', 0.013), ('bus up', seconds)))


@pytest.mark.parametrize('kind', [kind for kind, entry in KINDS.items() if entry.maps])
@pytest.mark.parametrize('end', ['end', 'bus down'])
def test_drive_that_is_silent_when_its_response_map_differs_is_named(kind: str, end: str) -> None:
    for place in some(range(12), 4):
        assert not broken(kind, (
            ('response map', 0.1 * place), ('silent', 0.0), ('quick_stop', 0.9), (end, 0.0)))


@pytest.mark.parametrize('kind', [kind for kind in KINDS if 'CiA 402' in kind])
@pytest.mark.parametrize('seconds', [0.0, 0.013, 0.2])
def test_a_node_that_nmt_has_stopped_is_told_at_the_end(kind: str, seconds: float) -> None:
    assert not broken(kind, (('nmt stop', seconds), ('end', 0.0)))


@pytest.mark.parametrize('kind', [kind for kind in KINDS if 'CiA 402' in kind])
@pytest.mark.parametrize('later', [('stall', 0.013), ('cycles lost', 0.9)])
def test_what_waits_for_sync_in_a_drive_that_was_stopped_starts_nothing(
        kind: str, later: tuple[str, float]) -> None:
    """An RPDO came and its SYNC did not; then the drive was stopped by SDO."""
    assert not broken(kind, (('lossy', 0.013), later), lenient=False)


@pytest.mark.parametrize('kind', [kind for kind in KINDS if '11 bit' in kind])
def test_what_arrives_is_no_answer_to_a_question_that_never_left(kind: str) -> None:
    assert not broken(kind, (('slow', 0.11), ('refuses', 0.013), ('end', 0.0)))


@pytest.mark.parametrize('kind', [kind for kind in KINDS if '29 bit' in kind])
@pytest.mark.parametrize('before', ['stall', 'quick_stop', 'disable'])
@pytest.mark.parametrize('end', ['end', 'bus down'])
def test_a_drive_that_answers_cycles_and_does_not_obey_its_word_is_named(
        kind: str, before: str, end: str) -> None:
    for later in [(), (('silent', 0.9),), (('mute', 0.9),), (('cycles lost', 0.9),),
                  (('refuses', 0.9),)]:     # also if it is lost meanwhile
        assert not broken(kind, (('requests lost', 0.0), (before, 0.9), *later, (end, 0.013)))


@pytest.mark.parametrize('kind', [kind for kind in KINDS if 'maps assumed' in kind])
def test_late_answer_by_which_a_drive_is_found_is_none_to_a_stop(kind: str) -> None:
    """The drive is deaf from the stop on: what it answers is to the cycles before."""
    for seconds, stop in product((0.02, 0.05), ('quick_stop', 'disable', 'zero')):
        assert not broken(kind, (
            ('later', seconds), ('silent', 0.0), (stop, 0.3), ('end', 0.0)))


@pytest.mark.parametrize('kind', [
    kind for kind in KINDS if '29 bit' in kind or 'word by number' in kind])
def test_an_answered_cycle_is_no_word_that_was_heard(kind: str) -> None:
    """What is written by number is lost, and no status is there that could show it."""
    for before, seconds, end in some(product(
            ('disable', 'quick_stop', 'stall'), (0.01, 0.02, 0.05, 0.1), ('end', 'bus down')), 4):
        assert not broken(kind, (
            ('requests lost', 0.02), (before, seconds), (end, 0.0)))


def _nothing(*_: Any, **__: Any) -> None:
    pass


def _heard(self: ExchangeBook, received_at: float) -> None:
    HEARD(self, received_at)
    self.stop_shown = True


HEARD, DONE = ExchangeBook.answer_received, SafeStop._done
#: what is broken, and a story of a kind in which that shows
DEFECTS: list[tuple[type, str, Any, str, Story]] = [
    (StopDuty, 'channel', _nothing, 'CANnord', (('bus down', 0.013),)),
    (StopDuty, 'channel', _nothing, 'PKW, no word', (('bus down', 0.013),)),
    (StopDuty, 'happened', lambda self, happened: Do.NOTHING, '29 bit, no word',
     (('silent', 0.0), ('end', 0.0))),
    (ExchangeBook, 'answer_received', _heard, 'CANnord',
     (('late', 0.4), ('silent', 0.0), ('end', 0.0))),
    (ControlMachine, 'confirmed_off', True, '29 bit, word by number',
     (('requests lost', 0.02), ('disable', 0.02), ('bus down', 0.0))),
    (SafeStop, '_done', lambda self, kind, failed: DONE(self, kind, []), '11 bit, no word',
     (('silent', 0.0), ('end', 0.0))),
    (ControlMachine, 'withdraw', _nothing, 'CANnord', (('silent', 0.9), ('well', 0.9))),
    (SetpointWriter, 'write_again', lambda self, since, now: False, '11 bit, no word',
     (('silent', 0.013), ('quick_stop', 0.11), ('well', 0.9))),
    (SdoStop, '_may_be_stopped', lambda self, since: False, 'CiA 402',
     (('nmt stop', 0.0), ('end', 0.0))),
    (Setpoint, 'disarm', _nothing, '29 bit, no word', (('quiet', 0.9),)),
    (Standstill, 'holds', property(lambda self: self.watching), 'CiA 402, stays in quick stop',
     (('quick_stop', 0.9), ('disable', 0.0))),
]


@pytest.mark.parametrize(('owner', 'name', 'instead', 'kind', 'story'), DEFECTS)
@pytest.mark.interpreted    # replaces methods
def test_what_is_broken_is_seen(owner: type, name: str, instead: Any, kind: str,
                                story: Story, monkeypatch: pytest.MonkeyPatch) -> None:
    assert not broken(kind, story)
    monkeypatch.setattr(owner, name, instead)
    assert broken(kind, story)


@pytest.mark.interpreted    # replaces methods
def test_the_shortest_story_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(StopDuty, 'channel', _nothing)
    story: Story = (('late', 0.1), ('bus down', 0.013), ('stall', 0.1))
    assert shortest('CANnord', story)[0] == (('bus down', 0.013),)
    with pytest.raises(Violation, match=r"CANnord: the bus is lost: .*\('bus down', 0.013\)"):
        check('CANnord', [story])
    with pytest.raises(Violation):
        tell('CANnord', story)
