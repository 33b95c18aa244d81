# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""In which NMT state a node is, and what it may be asked there: a stop above all."""

import math

from builders import frame, read
import pytest
from saying import says
from servo_builders import Axis, FITS, PERIOD, POSITION

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import Noted, StationLost
from drive_can_bridge.core.frame import Frame

PRE_OPERATIONAL, DISABLE = '000#8005', '605#2B40600007000000'
#: a node that says nothing of its state
MUTE = {'heartbeat_producer': 0.0, 'heartbeat_timeout': 0.0}


def running(**options: object) -> Axis:
    axis = Axis(**options).enabled()    # type: ignore[arg-type]
    axis.commands(0.0, 100.0)
    axis.live(0.05)
    assert axis.drive.state == axis.drive.ENABLED
    axis.take()
    axis.talk.events()
    return axis


def stopped(axis: Axis, *, tells: bool) -> float:
    """Have another master stop the node by NMT; return when it did."""
    at = axis.now
    axis.drive.takes(Frame(0, b'\x02\x05', False))
    if tells:
        axis.says('705#04')
    return at


def stops_at(axis: Axis, duration: float) -> float:
    """Let time pass until the drive is not enabled any more; return the time."""
    end = axis.now + duration
    while axis.now < end and axis.drive.state == axis.drive.ENABLED:
        axis.live(0.001)
    return axis.now


def told(axis: Axis) -> list[tuple[float, str]]:
    """Return NMT commands and SDO requests."""
    return [(at, text) for at, text in axis.log if text[:4] in ('000#', '605#')]


def doubts(axis: Axis) -> list[str]:
    return [note.text for note in axis.talk.events(Noted) if note.danger]


class TestStoppedInMotion:

    def test_its_heartbeat_says_so_and_it_is_told_at_once(self) -> None:
        axis = running()
        at = stopped(axis, tells=True)
        assert [text for _, text in told(axis)[:2]] == [PRE_OPERATIONAL, DISABLE]
        assert {time for time, _ in told(axis)[:2]} == {round(at, 6)}
        assert axis.drive.state == axis.drive.ON
        assert doubts(axis) == []
        assert axis.log.count((round(at, 6), PRE_OPERATIONAL)) == 1
        # its next heartbeat may be far away: that it answers shows that it is not stopped
        axis.beat_at = math.inf
        axis.take()
        axis.deliver(axis.talk.submits(read(POSITION), axis.now))
        assert '605#4064600000000000' in axis.take()
        axis.beat_at = axis.now + 0.05
        axis.live(1.5)
        assert axis.session.online

    @pytest.mark.parametrize('cycles', [0, 1, 2])
    def test_its_heartbeat_says_so_behind_cycles_of_its_stop(self, cycles: int) -> None:
        axis = running()
        stopped(axis, tells=False)
        while axis.session.online:
            axis.live(0.001)
        axis.live(0.002 + cycles * PERIOD)
        axis.take()
        at = round(axis.now, 6)
        axis.says('705#04')
        assert told(axis)[:2] == [(at, PRE_OPERATIONAL), (at, DISABLE)]
        assert axis.drive.state == axis.drive.ON

    @pytest.mark.parametrize('since', [0.3, 0.65, 0.9])
    def test_its_heartbeat_says_so_when_it_was_told_in_vain(self, since: float) -> None:
        axis = running()
        axis.deaf = True
        while not doubts(axis):
            axis.live(0.001)
        axis.live(since)
        axis.deaf = False
        axis.take()
        at = stopped(axis, tells=True)
        assert told(axis)[:2] == [(round(at, 6), PRE_OPERATIONAL), (round(at, 6), DISABLE)]
        assert axis.drive.state == axis.drive.ON

    @pytest.mark.parametrize('beat, first', [('705#04', PRE_OPERATIONAL), ('705#7F', DISABLE)])
    def test_it_was_disabled_a_moment_before(self, beat: str, first: str) -> None:
        axis = running()
        axis.drive.takes(Frame(0, b'\x02\x05' if first != DISABLE else b'\x80\x05', False))
        assert axis.asks(ControlAction.DISABLE, wait=PERIOD + 0.001) == []
        axis.take()
        axis.says(beat)
        sent = [text for _, text in told(axis)]
        assert sent[0] == first
        assert DISABLE in sent[:2]
        assert axis.drive.state == axis.drive.ON

    def test_a_user_reads_at_that_moment(self) -> None:
        axis = running()
        axis.deaf = True
        axis.session._channel.run(      # type: ignore[attr-defined]
            axis.session._polls._poll_error(), lambda _: None, axis.now)    # type: ignore[attr-defined]
        axis.deliver(axis.talk.sent())
        axis.deaf = False
        at = stopped(axis, tells=True)
        assert (round(at, 6), DISABLE) in axis.log
        assert axis.drive.state == axis.drive.ON

    def test_it_says_nothing_and_is_told_behind_the_word_and_its_repetition(self) -> None:
        axis = running(**MUTE)
        at = stopped(axis, tells=False)
        axis.live(0.5)
        first, second, third, fourth, *_ = told(axis)
        assert first[1] == second[1] == DISABLE
        assert second[0] - first[0] == pytest.approx(0.1)
        assert third == (pytest.approx(first[0] + 0.2), PRE_OPERATIONAL)
        assert fourth == (third[0], DISABLE)
        assert fourth[0] - at < 0.3
        assert axis.drive.state == axis.drive.READY     # and set up again
        assert doubts(axis) == []

    def test_a_slow_drive_is_given_its_time(self) -> None:
        axis = running(parameter_timeout=0.3, **MUTE)
        stopped(axis, tells=False)
        axis.live(1.5)
        first = next(at for at, text in told(axis) if text == DISABLE)
        nmt = next(at for at, text in told(axis) if text == PRE_OPERATIONAL)
        assert nmt - first == pytest.approx(0.6)

    def test_again_every_50_ms_for_a_second(self) -> None:
        axis = running(**MUTE)
        stopped(axis, tells=False)
        axis.deaf = True
        axis.live(2.0)
        sent = [(at, text) for at, text in told(axis) if text in (PRE_OPERATIONAL, DISABLE)]
        first = next(at for at, text in sent if text == PRE_OPERATIONAL)
        nmt = [at for at, text in sent if text == PRE_OPERATIONAL and at < first + 1.05]
        assert len(nmt) == 20
        assert {round(later - at, 4) for at, later in zip(nmt, nmt[1:])} == {0.05}
        assert [text for at, text in sent if first <= at < first + 1.0] == [
            PRE_OPERATIONAL, DISABLE] * 20
        assert len(doubts(axis)) == 1

    def test_until_it_answers(self) -> None:
        axis = running()
        axis.deaf = True
        stopped(axis, tells=True)
        axis.live(0.12)
        axis.deaf = False
        axis.live(0.04)
        assert axis.drive.state == axis.drive.ON
        axis.take()
        axis.live(0.5)
        assert DISABLE not in axis.take()
        assert doubts(axis) == []

    def test_its_heartbeat_says_so_while_it_is_told(self) -> None:
        axis = running()
        axis.mute = True
        axis.live(0.2)
        assert DISABLE in axis.take()
        axis.mute = False
        at = stopped(axis, tells=True)
        assert told(axis) == [(round(at, 6), PRE_OPERATIONAL), *told(axis)[1:]]

    @pytest.mark.parametrize('beat', ['705#05', '705#7F'])
    def test_one_that_says_that_it_is_not_stopped_is_sent_no_nmt(self, beat: str) -> None:
        axis = running()
        axis.mute = True
        for _ in range(12):
            axis.live(0.05)
            axis.says(beat)
        sent = [text for _, text in told(axis)]
        assert sent.count(DISABLE) >= 3
        assert PRE_OPERATIONAL not in sent[:sent.index(DISABLE) + 4]

    def test_nor_one_that_sends_pdos(self) -> None:
        axis = running(**MUTE)
        axis.deaf = True
        for _ in range(60):
            axis.live(0.01)
            if DISABLE in axis.take():
                break
        for _ in range(25):
            axis.live(0.01)
            axis.says('185#3712E8030000')
        assert PRE_OPERATIONAL not in [text for _, text in told(axis)]

    @pytest.mark.parametrize('tells', [True, False])
    def test_without_nmt_start_it_is_said_that_only_its_master_helps(self, tells: bool) -> None:
        axis = Axis(nmt_start=False, **({} if tells else MUTE))
        axis.drive.operational = True
        axis.drive.objects.update(FITS)
        axis.enabled()
        stopped(axis, tells=tells)
        axis.live(1.2)
        assert not any(text.startswith('000#') for _, text in axis.log)
        said, *_ = doubts(axis)
        assert says('node_may_be_stopped') in said.fields['why'].fields['what']


class TestWhatElseItIsAsked:

    def test_one_that_is_found_stopped_is_made_pre_operational_before_it_is_asked(self) -> None:
        axis = Axis()
        axis.drive.objects[0x1017, 0] = b'\x64\0'
        axis.drive.takes(Frame(0, b'\x02\x05', False))
        axis.deliver(axis.talk.bus_up(axis.now))
        axis.says('705#04')
        axis.deliver(axis.talk.activate(axis.now))
        assert [text for _, text in told(axis)][:2] == [PRE_OPERATIONAL, '605#4041600000000000']
        axis.live(0.3)
        assert axis.session.online

    @pytest.mark.parametrize('serves', [True, False])
    def test_requests_of_users_are_refused_at_once(self, serves: bool) -> None:
        axis = Axis(nmt_start=False)
        axis.deaf = True
        axis.deliver(axis.talk.bus_up(axis.now))
        if serves:
            axis.session.serve()
        else:
            axis.deliver(axis.talk.activate(axis.now))
        axis.says('705#04')
        axis.live(0.32)
        axis.talk.events()
        axis.take()
        axis.deliver(axis.talk.submits(read(POSITION), axis.now))
        because = says('drive_offline_because', reason=says('node_state', state='stopped'))
        assert axis.talk.outcomes() == [[because]]
        assert serves or axis.session.offline_advice == because
        axis.says('705#7F')
        axis.deliver(axis.talk.submits(read(POSITION), axis.now))
        assert '605#4064600000000000' in axis.take()


    @pytest.mark.parametrize('after', [0.5, 3.0])
    def test_another_master_starts_one_that_sends_no_heartbeats(self, after: float) -> None:
        axis = Axis(nmt_start=False, objects=FITS, **MUTE)     # type: ignore[arg-type]
        axis.drive.operational = True
        axis.online()
        for said in axis.drive.restarts():
            axis.says(str(said))
        axis.live(after)
        assert not axis.session.online
        axis.drive.takes(Frame(0, b'\x01\x05', False))
        axis.live(0.2)
        assert axis.session.online


class TestRestarts:
    """Nothing of the conversation before goes out behind the boot-up frame."""

    @staticmethod
    def amidst(**options: object) -> Axis:
        """Be in the middle of the set-up, the answer to 1400h.02h on its way."""
        axis = Axis(**options)      # type: ignore[arg-type]
        takes = axis.drive.takes
        axis.drive.takes = (        # type: ignore[method-assign]
            lambda sent: [] if str(sent).startswith('605#40001402') else takes(sent))
        axis.activate()
        assert axis.take()[-1] == '605#4000140200000000'
        return axis

    def test_where_both_are_taken_before_anything_is_sent(self) -> None:
        axis = self.amidst()
        axis.session.receive_frame(frame('585#4F001402FF000000'), axis.now)
        axis.session.receive_frame(frame('705#00'), axis.now)
        assert [text for text in axis.talk.sent() if text[:4] in ('605#', '000#')] == []
        axis.live(0.3)
        again = [text for _, text in axis.log if text.startswith('605#')]
        assert again[0] == '605#4041600000000000'

    def test_what_all_drives_share_goes_out(self) -> None:
        axis = self.amidst()
        axis.session.outbox.put(frame('080#'))
        axis.session.outbox.put(frame('77F#05'))
        axis.session.outbox.put(frame('000#0106'))
        axis.session.outbox.put(frame('000#0105'))
        axis.session.receive_frame(frame('705#00'), axis.now)
        assert axis.talk.sent() == ['080#', '77F#05', '000#0106']

    def test_a_pending_stop_goes_out(self) -> None:
        axis = running()
        axis.session.receive_frame(frame('705#00'), axis.now)
        assert DISABLE in axis.talk.sent()


    def test_heartbeats_are_due_since_they_are_asked_for(self) -> None:
        """1017h is 0 after a restart: until it is written, a slow set-up misses none."""
        axis = Axis(parameter_timeout=0.05).online()
        axis.beat_at = math.inf
        restarted_at, axis.deaf = axis.now, True
        for answer in axis.drive.restarts():
            axis.says(str(answer))
        axis.live(0.22)
        axis.deaf = False
        while not axis.drive.number(0x1017):
            axis.live(0.001)
        axis.beat_at = axis.now + 0.1
        assert axis.beat_at > restarted_at + axis.session.configuration.options.heartbeat_timeout
        axis.talk.events()
        axis.live(0.5)
        events = axis.talk.events(StationLost, Noted)
        assert axis.session.online
        assert events == []


class TestStoppedAtTheEnd:
    """By NMT in the moment in which the bridge ends."""

    @pytest.mark.parametrize('tells', [True, False])
    @pytest.mark.parametrize('before', [True, False])
    def test_it_is_told_all_the_same(self, tells: bool, before: bool) -> None:
        axis = running(**({} if tells else MUTE))
        at = stopped(axis, tells=False)
        if before and tells:
            axis.says('705#04')
        axis.deliver(axis.talk.deactivate(axis.now))
        if not before and tells:
            axis.live(0.0006)
            axis.says('705#04')
        assert stops_at(axis, 2.0) - at < (0.011 if tells else 0.4)
        axis.live(2.0)
        assert axis.session.stopped
        assert axis.drive.state in (axis.drive.ON, axis.drive.READY)
        assert doubts(axis) == []

    def test_its_heartbeat_says_so_when_it_was_told_in_vain(self) -> None:
        axis = running()
        axis.deaf = True
        axis.deliver(axis.talk.deactivate(axis.now))
        while '605#23FF600000000000' not in axis.take():
            axis.live(0.001)
        axis.deaf = False
        at = stopped(axis, tells=True)
        assert told(axis)[:2] == [(round(at, 6), PRE_OPERATIONAL), (round(at, 6), DISABLE)]
        axis.live(0.1)
        assert axis.session.stopped
        assert doubts(axis) == []

    def test_one_that_is_silent_is_named_and_the_end_comes(self) -> None:
        axis = running(**MUTE)
        axis.mute = axis.deaf = True
        axis.deliver(axis.talk.deactivate(axis.now))
        axis.live(axis.session.longest_stop)
        assert axis.session.stopped
        assert len(doubts(axis)) == 1

    @pytest.mark.parametrize('beat', ['705#7F', '705#00'])
    def test_one_that_takes_no_pdos_is_told_by_sdo(self, beat: str) -> None:
        axis = running()
        axis.deliver(axis.talk.deactivate(axis.now))
        axis.drive.operational = False
        axis.mute = True
        axis.live(0.002)
        axis.mute = False
        axis.says(beat)
        assert DISABLE in [text for _, text in told(axis)]
        axis.live(0.5)
        assert axis.session.stopped
        assert doubts(axis) == []
