# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The session of a bridge and a simulated LTMR; a frame takes a millisecond."""

from typing import Any

from builders import drive, read, write
from cable import Cable
from hypothesis import given, Phase, settings, strategies as st
from ltmr_builders import LTMR, names, NODE
import pytest
from saying import codes, says
from simulation_builders import RULES

from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.events import (
    FrameRejected, ProcessDataReceived, StationFound, StationLost,
)
from drive_can_bridge.core.frame import Frame

FRAME_TIME = 0.001
RATIO, TRIP_CLASS = names('flc1_ratio', 'motor_trip_class')
RESPONSE = names('system_status_1', 'system_status_2', 'thermal_capacity', 'average_current')


class Line(Cable):
    """A bridge and a controller at the two ends of a cable."""

    def __init__(self, **options: Any) -> None:
        super().__init__(drive(
            'canopen_pkw', name='pump', station=NODE, table=LTMR.parameters.values(),
            control=LTMR.control, request=(), response=RESPONSE,
            **{'period': 0.1, 'parameter_timeout': 0.5, **options}), frame_time=FRAME_TIME)
        self.session, = self.sessions
        self.ltmr, = self.drives

    def until(self, until: float) -> None:
        """Let time pass."""
        self.run(until - self.now)

    def fault(self, text: str) -> None:
        self.ltmr.fault(text, self.now)
        self._collect()

    def writes(self, register: str) -> list[str]:
        """Return the words that the bridge has written to a register (bytes 0 and 1 in hex)."""
        return [text[12:16] for _, text in self.sent
                if text.startswith(f'505#{register}00') and text[10:12] in ('2A', 'AA')]


def test_start() -> None:
    line = Line()
    line.until(0.5)
    assert line.session.online
    frames = [text for _, text in line.sent]
    # start twice: at the beginning, and after the boot-up frame; only then a PDO
    first = next(place for place, text in enumerate(frames) if text.startswith('505#'))
    assert set(frames[:first]) == {'000#0105'}
    assert {text[:9] for text in frames[first:] if text[:3] == '505'} >= {
        '505#C7010', '505#D1010', '505#F4010'}
    assert line.found(ProcessDataReceived)[-1].raws == (0x0041, 0, 0, 0)
    assert not line.ltmr.violations
    assert not line.found(FrameRejected)
    # the control word was written once
    assert line.writes('C002') == ['0000']


def test_run_trip_reset() -> None:
    line = Line(control_timeout=5.0)
    line.until(1.0)
    assert line.control(ControlAction.ENABLE) == (True, 'enabled')
    line.until(5.0)
    status, _, thermal, current = line.found(ProcessDataReceived)[-1].raws
    assert status & 0x83 == 0x83
    assert thermal > 0
    assert current == 630
    line.fault('trip')
    line.until(6.0)
    assert line.session.facts()['emergency'].startswith('FF00h')
    assert line.session.warning
    assert not line.control(ControlAction.ENABLE)[0]
    assert line.control(ControlAction.RESET_FAULT)[0]
    line.until(7.0)
    assert line.session.facts()['emergency'] == 'none'
    assert line.control(ControlAction.ENABLE)[0]
    assert line.control(ControlAction.DISABLE)[0]
    # disable; run; disable after the trip; (enable refused;) reset, disable; run; disable
    assert line.writes('C002') == ['0000', '0100', '0000', '0800', '0000', '0100', '0000']
    assert not line.ltmr.violations


def test_a_lost_answer_to_a_write() -> None:
    line = Line()
    line.until(1.0)
    request = write((RATIO, 50))
    line.fault('silent')
    line.submit(request)
    line.until(1.002)
    # only this one answer is lost; whatever is sent again would be answered
    line.fault('ok')
    assert line.wait(request) == [says('no_answer', timeout=0.5, attempts=1)]
    line.until(5.0)
    assert line.session.online
    assert line.writes('8C02') == ['3200']
    assert line.ltmr.value('flc1_ratio') == 50.0
    assert line.outcome(write((RATIO, 60))) == ['written']
    assert line.ltmr.value('flc1_ratio') == 60.0


def test_a_write_is_not_sent_into_the_unknown() -> None:
    line = Line()
    line.until(1.0)
    line.fault('silent')
    # a read of the round has not been answered: the last function byte is unknown
    line.until(1.6)
    answer, = line.outcome(write((RATIO, 50)))
    assert str(answer).startswith('no answer')
    assert line.writes('8C02') == []
    assert line.ltmr.value('flc1_ratio') == 33.0


@pytest.mark.parametrize('late', [0.05, 0.3, 0.6, 0.9])
def test_late_answers_are_never_taken_for_others(late: float) -> None:
    line = Line(missed_limit=10, parameter_retries=5)
    line.until(1.0)
    line.fault(f'late={late}')
    for value in (50, 51, 52):
        answer, = line.outcome(write((RATIO, value)), 60.0)
        assert answer == 'written' or str(answer).startswith('no answer')
        found, = line.outcome(read(RATIO), 60.0)
        assert found == line.ltmr.registers.raw('flc1_ratio') or str(found).startswith('no answer')
        if late < 0.5:
            assert (answer, found) == ('written', value)


@pytest.mark.parametrize('boot', [0.0, 0.02, 0.5, 3.0])
def test_restart_in_the_middle_of_a_write(boot: float) -> None:
    line = Line()
    line.until(1.0)
    assert line.control(ControlAction.ENABLE)[0]
    line.until(2.05)
    request = write((RATIO, 50))
    line.submit(request)
    # the write is on its way
    line.fault(f'restart={boot}')
    before = len(line.sent)
    answer, = line.wait(request)
    assert str(answer).startswith(('no answer', 'drive offline'))
    line.until(line.now + 10.0)
    assert line.session.online
    assert line.found(StationLost)
    assert len(line.writes('8C02')) == 1
    # the boot-up frame was answered at once, and the drive was told to stand still
    after = line.sent[before:]
    assert (round(2.051 + boot, 6), '000#0105') in after
    assert [text for _, text in after if text[:9] == '505#C0020' and text[11] == 'A']
    # the motor is off, and stays so until somebody enables it
    assert line.writes('C002')[-1] == '0000'
    assert not line.ltmr.plant.operation.enabled
    assert line.ltmr.value('flc1_ratio') in (33.0, 50.0)
    assert line.outcome(read(RATIO)) == [line.ltmr.registers.raw('flc1_ratio')]
    assert line.control(ControlAction.ENABLE)[0]


@pytest.mark.parametrize('function', ['00', '80', '25', 'A5', '26', 'A6', '2A', 'AA', '2B', 'AB'])
def test_unknown_last_function_byte(function: str) -> None:
    line = Line()
    line.ltmr.receive_frame(Frame(0x000, b'\x01\x05', False), 0.0)
    line.ltmr.receive_frame(Frame(0x505, bytes.fromhex(f'C80100{function}00000000'), False), 0.0)
    line.ltmr.take_frames()
    line.until(2.0)
    assert line.session.online
    assert line.outcome(write((RATIO, 50))) == ['written']
    assert line.ltmr.value('flc1_ratio') == 50.0


def test_stopped_node_is_started_again() -> None:
    line = Line()
    line.until(1.0)
    sent = len(line.sent)
    line.ltmr.receive_frame(Frame(0x000, b'\x02\x05', False), 1.0)
    line.until(5.0)
    assert '000#0105' in [text for _, text in line.sent[sent:]]
    assert line.session.online
    assert line.session.facts()['nmt_state'] == 'operational'


def test_lost_heartbeats() -> None:
    line = Line(heartbeat_timeout=0.6, missed_limit=1000)
    line.until(1.0)
    line.fault('off')
    line.until(3.0)
    assert not line.session.online
    lost, = (at for at, event in line.events if isinstance(event, StationLost))
    # the last one came at 1.0 at the latest, 0.2 s apart
    assert 1.4 <= lost <= 1.61
    line.fault('ok')
    line.until(6.0)
    assert line.session.online


def test_safe_stop() -> None:
    line = Line()
    line.until(1.0)
    assert line.control(ControlAction.ENABLE)[0]
    line.session.deactivate(line.now)
    line._collect()
    line.until(line.now + 2.0)
    assert line.session.stopped
    assert not line.ltmr.plant.operation.enabled
    assert line.writes('C002')[-1] == '0000'
    # nothing by NMT, and silence
    last = line.sent[-1][0]
    line.until(line.now + 5.0)
    assert line.sent[-1][0] == last


_STEPS = st.lists(st.tuples(
    st.sampled_from([0.0, 0.004, 0.03, 0.1, 0.35, 1.2]),
    st.one_of(
        st.integers(5, 100).map(lambda value: ('write', value)),
        st.integers(0, 40).map(lambda value: ('class', value)),
        st.just(('read', 0)),
        st.sampled_from(['silent', 'late=0.04', 'late=0.6', 'drop=2', 'drop=3', 'length=5',
                         'foreign', 'duplicate', 'restart=0', 'restart=0.3', 'off', 'ok', 'trip',
                         ]).map(lambda text: ('fault', text)),
        st.sampled_from([ControlAction.ENABLE, ControlAction.DISABLE, ControlAction.RESET_FAULT],
                        ).map(lambda action: ('control', action)))), max_size=25)


# without shrinking: an example is readable as it is, and takes a second to find out about
@settings(max_examples=settings().max_examples // 5,
          phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(_STEPS)
def test_whatever_happens_answers_are_true_and_the_drive_comes_back(
        steps: list[tuple[float, tuple[str, Any]]]) -> None:
    line = Line(parameter_retries=1)
    line.until(0.5)
    asked: list[Any] = []
    for wait, (what, value) in steps:
        line.until(line.now + wait)
        if what == 'fault':
            line.fault(value)
        elif what == 'control':
            line.submit(ControlRequest(value))
        else:
            request: Any = read(RATIO)
            if what != 'read':
                request = write((RATIO if what == 'write' else TRIP_CLASS, value))
            asked.append(request)
            line.submit(request)
    line.until(line.now + 40.0)
    for request in asked:
        (answer,), = line.outcomes(request)     # exactly one outcome
        if isinstance(answer, int):
            assert 5 <= answer <= 100
        elif answer != 'written':
            [code] = codes([answer])
            assert code in ('refused_by_drive', 'no_answer', 'no_answer_offline',
                            'no_answer_because', 'drive_offline', 'drive_offline_because')
            if code == 'refused_by_drive':
                assert request.items[0][0] is TRIP_CLASS
                assert request.items[0][1] % 5 or not 5 <= request.items[0][1] <= 30
    # once all is well again, so is the bridge; and what it reads is what is there
    line.fault('ok')
    line.until(line.now + 10.0)
    assert line.session.online
    # settings are taken while the motor is off
    assert line.control(ControlAction.DISABLE)[0]
    assert line.outcome(write((RATIO, 42))) == ['written']
    assert line.ltmr.value('flc1_ratio') == 42.0
    assert line.outcome(read(RATIO)) == [42]
    found = line.found(StationFound)
    assert len(found) - 1 <= len(line.found(StationLost))
    # no PDO before the node was ready for it, but for those that crossed a boot-up frame
    assert set(line.ltmr.violations) <= {RULES['not operational']}
