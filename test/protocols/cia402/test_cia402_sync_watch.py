# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""SYNC beside the rounds: drives that watch it, that are lost; and nodes that start slowly."""

from typing import Any

from drives import ServoDrive
import pytest
from saying import says
from servo_builders import Axis
from stacks import BootsTwice, FewObjects, StartsItself, StartsSlowly, WatchesSync

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import Noted, StationLost
from drive_can_bridge.protocols.canopen.sdo import describe

MUTE = {'heartbeat_producer': 0.0, 'heartbeat_timeout': 0.0}


def times(axis: Axis, text: str) -> list[float]:
    return [at for at, sent in axis.log if sent == text]


def sent(axis: Axis) -> list[str]:
    return [text for _, text in axis.log]


def gaps(axis: Axis) -> set[float]:
    syncs = times(axis, '080#')
    return {round(later - at, 4) for at, later in zip(syncs, syncs[1:])}


class TestWatched:

    @pytest.mark.parametrize('mode', ['csv', 'pv'])
    def test_one_that_is_found_with_the_error_comes_online(self, mode: str) -> None:
        axis = Axis(mode, make=WatchesSync).start()
        assert axis.session.online
        assert gaps(axis) == {0.01}
        assert sent(axis).index('080#') < sent(axis).index('000#0105')
        assert len(times(axis, '000#0105')) == 1
        told = [note.text for note in axis.talk.events(Noted)]
        assert told.count(says('sync_watched', period=10000, late=0.005)) == 1

    @pytest.mark.parametrize('hang', [0.02, 0.05, 0.5])
    @pytest.mark.parametrize('behaviour', [0, 2])
    def test_a_hang_does_not_cost_it_for_ever(self, hang: float, behaviour: int) -> None:
        axis = Axis(make=WatchesSync, objects={(0x1029, 1): bytes((behaviour,))}).enabled()
        axis.now += hang
        axis.live(2.5)
        assert axis.talk.events(StationLost)
        assert axis.session.online
        assert axis.asks(ControlAction.ENABLE) == [('enable', True, 'operation enabled')]

    @pytest.mark.parametrize('behaviour', [0, 2])
    def test_one_that_leaves_operational_by_itself_in_motion_is_told_to_stop(
            self, behaviour: int) -> None:
        """Pre-operational or stopped, as its 1029h says: its motor goes on."""
        axis = Axis(make=WatchesSync, objects={(0x1029, 1): bytes((behaviour,))}).enabled()
        axis.commands(0.0, 100.0)
        axis.now += 0.05
        axis.live(0.12)     # a heartbeat
        assert axis.drive.state in (axis.drive.ON, axis.drive.READY)
        assert not [note for note in axis.talk.events(Noted) if note.danger]

    def test_a_stall_does_not_either(self) -> None:
        axis = Axis(make=WatchesSync).enabled()
        axis.now += 1.5
        axis.deliver(axis.talk.handle_stall(axis.now))
        axis.live(2.0)
        assert axis.session.online

    def test_it_is_told_once(self) -> None:
        axis = Axis(make=WatchesSync, objects={(0x1006, 0): bytes((1, 0, 0, 0))}).start()
        axis.now += 0.05
        axis.live(2.5)
        assert axis.session.online
        told = [note.text.code for note in axis.talk.events(Noted)]
        assert told.count('sync_watched') == 1

    def test_a_drive_that_does_not_watch_is_not_said_to(self) -> None:
        axis = Axis().online()
        axis.live(0.1)
        assert 'sync_watched' not in [note.text.code for note in axis.talk.events(Noted)]

    @pytest.mark.parametrize('make', [FewObjects, StartsItself, BootsTwice])
    def test_other_stacks(self, make: Any) -> None:
        axis = Axis('pv', make=make).enabled()
        for each in axis.drive.restarts():
            axis.says(str(each))
        axis.live(0.6)
        assert axis.session.online


class TestBetweenRounds:

    def test_one_a_period_from_the_first_answer_to_the_last_stop_frame(self) -> None:
        axis = Axis('pv', period=0.02).start()
        axis.asks(ControlAction.ENABLE)
        axis.drive.operational = False      # so that it is lost, and found
        axis.says('705#7F')
        axis.live(2.0)
        assert axis.session.online
        assert gaps(axis) == {0.02}
        axis.ends(1.0)
        last = max(at for at, text in axis.log if text.startswith('205#'))
        assert times(axis, '080#')[-1] == last

    def test_it_goes_on_while_a_drive_differs(self) -> None:
        axis = Axis(objects={(0x6502, 0): bytes(4)}).start().live(2.0)
        assert len(times(axis, '080#')) > 200

    def test_and_ends_a_second_after_the_last_was_heard(self) -> None:
        axis = Axis('pv').online()
        at = axis.now
        axis.mute = axis.deaf = True
        axis.live(4.0)
        last = times(axis, '080#')[-1]
        assert last - at == pytest.approx(1.0, abs=0.02)
        axis.mute = axis.deaf = False
        axis.live(1.5)
        assert axis.session.online

    def test_what_a_drive_sends_by_it_counts_for_nobody(self) -> None:
        axis = Axis('pv')
        axis.drive.operational = True
        axis.start()
        axis.live(1.0)
        statistics = axis.session.statistics
        assert (statistics.missed, statistics.rejected, statistics.late) == (0, 0, 0)
        axis.mute = True
        axis.live(0.1)
        axis.mute = False
        missed = statistics.missed
        axis.live(2.0)
        assert axis.session.online
        assert (statistics.missed - missed, statistics.rejected, statistics.late) == (0, 0, 0)

    def test_none_by_event(self) -> None:
        axis = Axis('pv', transmission='event', objects={
            (0x1800, 3): bytes(2), (0x1800, 5): bytes(2)}).start().live(2.0)
        assert '080#' not in axis.take()

    def test_around_an_nmt_start_while_nobody_is_heard(self) -> None:
        """It has waited for an encoder, without a heartbeat, for longer than a second."""
        axis = Axis('pv', **MUTE).start()
        assert sent(axis).index('080#') < sent(axis).index('000#0105')


class TestBeforeTheFirst:
    """What an operational drive has in its buffers is put into effect by SYNC."""

    @staticmethod
    def first(axis: Axis, seconds: float = 3.0) -> float:
        began = axis.now
        axis.activate()
        axis.live(seconds)
        syncs = times(axis, '080#')
        return syncs[0] - began if syncs else -1.0

    def test_one_that_is_not_enabled(self) -> None:
        assert 0.0 < self.first(Axis('pv')) < 0.02

    def test_one_that_is_enabled_and_takes_its_time(self) -> None:
        axis = Axis('pv')
        axis.drive.becomes(axis.drive.ENABLED)
        axis.drive.ramp = 10_000
        assert self.first(axis) == pytest.approx(0.5, abs=0.03)

    def test_one_that_is_enabled_and_stops(self) -> None:
        axis = Axis('pv')
        axis.drive.becomes(axis.drive.ENABLED)
        assert 0.0 < self.first(axis) < 0.05

    def test_one_that_is_silent(self) -> None:
        """Nobody hears it, and so there is none."""
        axis = Axis('pv')
        axis.deaf = axis.mute = True
        assert self.first(axis) == -1.0

    @staticmethod
    def died(state: int, mapping: str) -> tuple[Axis, list[int]]:
        """
        Return an axis, and the states that its drive takes.

        The RPDO came, and its SYNC did not: 000Fh, by which many go on from ready as well.
        """
        before = Axis('pv').enabled().commands(0.0, 100.0)
        before.live(0.05)
        drive = before.drive
        before.deliver([text for text in sent(before) if text.startswith('205#0F00')][-1:])
        drive.becomes(state)
        after = Axis('pv', mapping=mapping)
        after.drive = drive
        became: list[int] = []
        becomes = drive.becomes

        def records(to: int) -> None:
            became.append(to)
            becomes(to)
        drive.becomes = records     # type: ignore[method-assign]
        return after, became

    @pytest.mark.parametrize('mapping', ['configure', 'verify', 'assume'])
    @pytest.mark.parametrize('state', [
        ServoDrive.ENABLED, ServoDrive.ON, ServoDrive.READY, ServoDrive.OFF])
    def test_one_that_has_yet_to_obey_a_bridge_that_died(self, state: int, mapping: str) -> None:
        after, became = self.died(state, mapping)
        self.first(after)
        assert after.session.online
        assert ServoDrive.ENABLED not in became

    @pytest.mark.parametrize('answer', ['8040600022000008', '0000000000000000'])
    @pytest.mark.parametrize('state', [ServoDrive.ON, ServoDrive.READY])
    def test_and_does_not_take_its_power_off_yet(self, state: int, answer: str) -> None:
        after, became = self.died(state, 'verify')
        after.drive.instead = {'2b4060000000': answer}
        assert self.first(after, 0.4) == -1.0
        after.drive.instead = {}
        after.live(2.0)
        assert after.session.online
        assert ServoDrive.ENABLED not in became
        assert not [note for note in after.talk.events(Noted) if 'SYNC may start' in note.text]

    def test_or_acknowledges_that_and_stays(self) -> None:
        after, _ = self.died(ServoDrive.READY, 'verify')
        after.drive.instead = {'2b406000': '6040600000000000'}
        assert self.first(after) == pytest.approx(0.5, abs=0.03)
        assert after.talk.events(Noted)[0].text == says('sync_may_start', refusal=says(
            'still_in_state', state='ready to switch on'))

    def test_or_is_enabled_meanwhile(self) -> None:
        after, _ = self.died(ServoDrive.READY, 'verify')
        drive, control, words = after.drive, after.drive._control, []

        def obeys(word: int) -> None:
            words.append(word)
            control(word)
            if len(words) == 1:
                drive.becomes(drive.ENABLED)
        drive._control = obeys      # type: ignore[method-assign]
        self.first(after)
        assert words[:3] == [0x0000, 0x0007, 0x0000]
        assert after.session.online

    def test_or_never(self) -> None:
        after, _ = self.died(ServoDrive.READY, 'verify')
        after.drive.fixed = {(0x6040, 0): 0x08000022}
        assert self.first(after) == pytest.approx(0.5, abs=0.03)
        assert after.talk.events(Noted)[0].text == says('sync_may_start', refusal=says(
            'object_refused', what='6040h.00h', why=describe(0x08000022)))

    @pytest.mark.parametrize('instead', [{'404160': '8041600022000008'}, {}])
    def test_one_that_beats_and_does_not_say_it(self, instead: dict[str, str]) -> None:
        axis = Axis('pv', objects={(0x1017, 0): b'\x64\0'}, nmt_start=False)
        axis.drive.instead = instead
        if not instead:
            takes = axis.drive.takes
            axis.drive.takes = (        # type: ignore[method-assign]
                lambda sent: [] if sent.identifier == 0x605 else takes(sent))
        at = self.first(axis)
        told = [text for text in axis.take() if text.startswith('605#2B4060')]
        assert told
        assert 0.5 <= at < 1.0


class TestStartsSlowly:

    @pytest.mark.parametrize('beats', [True, False])
    @pytest.mark.parametrize('mode', ['csv', 'pv'])
    def test_it_comes_online(self, mode: str, beats: bool) -> None:
        axis = Axis(mode, make=StartsSlowly, **({} if beats else MUTE)).start().live(0.5)
        assert axis.session.online
        assert len(times(axis, '000#0105')) == len(times(axis, '000#8005')) == 1
        if beats:
            assert axis.session.statistics.missed == 0

    def test_by_event(self) -> None:
        axis = Axis('pv', make=StartsSlowly, transmission='event', objects={
            (0x1800, 3): bytes(2), (0x1800, 5): bytes(2)})
        takes = axis.drive.takes
        axis.drive.takes = lambda sent: [   # type: ignore[method-assign]
            *takes(sent), *(axis.drive.responses(255) if sent.identifier == 0x205 and (
                axis.drive.operational) else ())]
        axis.start()
        axis.live(0.5)
        assert axis.session.online
        assert len(times(axis, '000#0105')) == 1

    def test_one_that_takes_longer_than_control_timeout(self) -> None:
        axis = Axis('pv', make=StartsSlowly, control_timeout=0.5)
        axis.drive.takes_to_start = 0.7     # type: ignore[attr-defined]
        axis.start()
        axis.live(3.0)
        assert not axis.session.online
        starts = times(axis, '000#0105')
        assert min(later - at for at, later in zip(starts, starts[1:])) >= 1.0
        assert axis.session.offline_advice == says('node_state', state='pre-operational')

    def test_started_again_behind_a_boot_up(self) -> None:
        axis = Axis('pv', make=StartsSlowly).start()
        for each in axis.drive.restarts():
            axis.says(str(each))
        axis.live(1.0)
        assert axis.session.online
        assert len(times(axis, '000#0105')) == 2

    def test_heartbeats_that_are_rare_are_not_waited_for(self) -> None:
        axis = Axis('pv', heartbeat_producer=0.0, heartbeat_timeout=0.0)
        axis.deliver(axis.talk.bus_up(axis.now))
        axis.says('705#7F')
        axis.now += 5.0
        axis.says('705#7F')
        axis.deliver(axis.talk.activate(axis.now))
        axis.live(1.0)
        assert axis.session.online
