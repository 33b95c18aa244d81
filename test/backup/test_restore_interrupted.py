# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A restore that something comes between: at every write, in virtual time."""

from dataclasses import replace
import errno
from itertools import product
import signal
from types import SimpleNamespace

from extent import some
import pytest
from scripted_drive import (
    Fate, FILE, Killed, MODE, OTHER, restored, SAVE, ScriptedDrive, SETTINGS, STORE)

from drive_can_bridge.backup.restore import PATIENCE, RestoreResult
from drive_can_bridge.cli.restore import _identity
from drive_can_bridge.core.profile import RestoreTable
from drive_can_bridge.process.critical_sections import postponed

#: mode, three settings, mode
WRITES = range(1, 6)


def test_an_identity_that_was_looked_for_once_is_looked_for_again() -> None:
    """A process that did not run meanwhile has not waited for it."""
    now, told = [0.0], iter(['', 'servo'])

    def identity() -> str:
        now[0] += 60.0
        return next(told)
    drive = SimpleNamespace(identity=identity, facts=SimpleNamespace(through='bridge'))
    backup = SimpleNamespace(head=SimpleNamespace(identity='servo'))
    clock = SimpleNamespace(now=lambda: now[0], wait=lambda until: None)
    assert _identity(backup, drive, clock) == 'servo'   # type: ignore[arg-type]


def test_as_it_should_be() -> None:
    drive = ScriptedDrive()
    result = restored(drive)
    assert (result.complete, drive.registers) == (True, FILE)
    assert [event for event in drive.events if event[0] == 'write'] == [
        ('write', 'mode', OTHER | MODE), *(('write', *each) for each in SETTINGS.items()),
        ('write', 'mode', OTHER)]


@pytest.mark.parametrize('number', WRITES)
def test_a_drive_that_hears_and_does_not_answer_is_taken_out_of_its_mode(number: int) -> None:
    drive = ScriptedDrive({number: Fate.MUTE})
    result = restored(drive)
    assert not drive.in_mode
    assert result.steps != []       # nobody knows that
    # the rest is not tried: the way out of the mode follows at once, and nobody reads first
    written = [event for event in drive.events if event[0] == 'write']
    assert written[number:] == [('write', 'mode', OTHER)] * len(written[number:])
    assert drive.now < 2 * PATIENCE


@pytest.mark.parametrize('number', WRITES)
def test_the_mode_is_ended_without_a_look(number: int) -> None:
    drive = ScriptedDrive({number: Fate.SIGNAL})
    restored(drive)
    out = drive.events.index(('write', 'mode', OTHER))
    assert drive.events[out - 1] != ('read', 'mode', 0)


@pytest.mark.parametrize('number', range(1, 4))
def test_nothing_is_written_to_a_drive_that_somebody_enables(number: int) -> None:
    drive = ScriptedDrive({number: Fate.ENABLED})
    result = restored(drive)
    assert result.enabled
    # it is not left in its mode
    assert (drive.moving, drive.in_mode) == (['mode'], False)
    assert result.written == list(SETTINGS)[:number - 1]
    assert result.stopped == [name for name in SETTINGS if name not in result.written]
    # asked before each write
    assert [what for what, *_ in drive.events if what != 'read'] == [
        *['asked', 'write'] * number, 'asked', 'write']


@pytest.mark.parametrize('number', range(2, 5))
def test_what_was_under_way_when_the_bus_was_lost_may_have_been_written(number: int) -> None:
    drive = ScriptedDrive({number: Fate.BUS_BEHIND})
    result = restored(drive)
    name = list(SETTINGS)[number - 2]
    assert (result.unconfirmed, drive.registers[name]) == ([name], FILE[name])
    assert result.written == list(SETTINGS)[:number - 2]
    assert str(result.trouble) == 'gone'


def test_a_drive_that_is_enabled_by_now_is_told_nothing() -> None:
    drive = ScriptedDrive()
    drive.is_enabled = True
    result = restored(drive)
    assert (result.enabled, result.stopped, drive.writes) == (True, [*SETTINGS], 0)


FATES = [fate for fate in Fate
         if fate not in (Fate.IGNORED, Fate.KILLED_BEFORE, Fate.KILLED_AFTER)]
STORIES = [{number: fate} for number in WRITES for fate in FATES]
STORIES += [{one: first, two: second} for one in WRITES for two in range(one + 1, 9)
            for first, second in product(FATES, repeat=2)]


def test_whatever_comes_between() -> None:
    for story in some(STORIES, 15):
        drive = ScriptedDrive(story)
        result = restored(drive)
        fates, told = set(story.values()), f'{story}: {result}'
        # left in its mode only where nothing could be done about it, and then it is said
        if drive.in_mode:
            assert fates & {Fate.DEAF, Fate.BUS, Fate.BUS_BEHIND, Fate.REFUSED, Fate.LOST}, told
            assert result.steps, told
        # nothing is said to be written that is not
        for name in result.written:
            assert drive.registers[name] == FILE[name], told
        assert not result.complete or drive.registers == FILE, told
        # and nothing not to be that may be
        assert len(result.unconfirmed) <= (Fate.BUS_BEHIND in fates), told
        assert not set(result.unconfirmed) & set(result.stopped or ()), told
        # nothing but the way out of the mode once somebody has enabled it
        assert set(drive.moving) <= {'mode'}, told
        assert drive.now < 40.0, told
        # and repeating it is safe
        drive.ended()
        assert restored(drive).complete, told
        assert drive.registers == FILE, told


@pytest.mark.parametrize('number', WRITES)
@pytest.mark.parametrize('fate', [Fate.KILLED_BEFORE, Fate.KILLED_AFTER])
def test_what_a_killed_restore_leaves_is_brought_to_its_end_by_the_next(
        number: int, fate: Fate) -> None:
    drive = ScriptedDrive({number: fate})
    with pytest.raises(Killed):
        restored(drive)
    drive.ended()
    result = restored(drive)
    assert (result.complete, drive.registers) == (True, FILE)


def gone(*_: object) -> None:
    raise OSError(errno.EIO, 'Input/output error')


@pytest.mark.parametrize('number', WRITES)
@pytest.mark.parametrize('fate', [Fate.SIGNAL, Fate.AWAY])
def test_a_terminal_that_has_gone_leaves_no_drive_in_its_mode(number: int, fate: Fate) -> None:
    drive = ScriptedDrive({number: fate})
    restored(drive, told=gone, hint=gone)
    assert not drive.in_mode


def test_a_signal_of_a_terminal_that_has_gone_is_noted() -> None:
    with postponed(gone) as interrupted:
        assert not interrupted
        signal.raise_signal(signal.SIGHUP)
        assert interrupted.exit_code == 128 + signal.SIGHUP


class TestNotTaken:
    """What a drive acknowledges and does not take is written again after the others."""

    def restored(self, fate: Fate) -> RestoreResult:
        """Restore a drive that has no mode; ``fate``: of the first write of the second round."""
        drive = ScriptedDrive({1: Fate.IGNORED, 2: Fate.IGNORED, 4: fate}, stores=True)
        drive.facts = replace(drive.facts, restore=RestoreTable((), ()))
        return restored(drive)

    @pytest.mark.parametrize('fate', [Fate.DEAF, Fate.MUTE, Fate.AWAY, Fate.CUT])
    def test_a_drive_that_goes_away_meanwhile_does_not_have_it(self, fate: Fate) -> None:
        result = self.restored(fate)
        assert not result.complete
        assert [each.name for each in result.wrong] == ['first', 'second']
        assert result.written == ['third']

    def test_a_signal_meanwhile_leaves_it_to_be_written(self) -> None:
        result = self.restored(Fate.SIGNAL)
        assert (result.written, result.stopped) == (['third', 'first'], ['second'])


class TestStoring:
    """What stores cannot be read, and wears a memory each time that it is written."""

    def stored(self, drive: ScriptedDrive) -> int:
        """Return how often it was told to store."""
        return drive.events.count(('write', STORE, SAVE))

    def test_it_is_told_once(self) -> None:
        drive = ScriptedDrive(stores=True)
        assert (restored(drive).complete, self.stored(drive)) == (True, 1)

    @pytest.mark.parametrize(('lost', 'told', 'failed'), [(1, 2, 0), (2, 3, 0), (36, 3, 1)])
    def test_an_answer_that_is_lost(self, lost: int, told: int, failed: int) -> None:
        drive = ScriptedDrive(dict.fromkeys(range(4, 4 + lost), Fate.UNANSWERED), stores=True)
        result = restored(drive)
        assert (self.stored(drive), len(result.steps)) == (told, failed)
        assert result.wrong == []

    @pytest.mark.parametrize('fate', FATES)
    def test_whatever_becomes_of_it_it_is_told_three_times_at_most(self, fate: Fate) -> None:
        for number in range(1, 8):
            drive = ScriptedDrive(dict.fromkeys(range(number, 40), fate), stores=True)
            result = restored(drive)
            assert self.stored(drive) <= 3
            assert drive.now < 40.0
            assert not result.complete or self.stored(drive)

    @pytest.mark.parametrize('number', [3, 4])
    def test_of_a_drive_that_was_away_it_is_told_when_it_is_back(self, number: int) -> None:
        drive = ScriptedDrive({number: Fate.AWAY}, stores=True)
        result = restored(drive)
        assert (result.steps, self.stored(drive)) == ([], 1)
