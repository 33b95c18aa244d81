# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The session of a bridge and a simulated LTMR; a frame takes a millisecond."""

from typing import Any

from builders import drive, read, write
from cable import Cable
from hypothesis import given, Phase, settings, strategies as st
from ltmr_builders import LTMR, names, NODE
from saying import codes
from simulation_builders import RULES

from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.events import (
    FrameRejected, ProcessDataReceived, StationFound, StationLost,
)

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


def test_a_motor_that_was_stopped_by_hand_does_not_start_when_control_comes_back() -> None:
    """
    Local control, then remote again: the controller obeys the newest command that it holds.

    Its CANopen guide (DOCA0132, Schneider Electric) warns of that: it may restart by itself.
    """
    line = Line(control_timeout=5.0)
    line.until(1.0)
    assert line.control(ControlAction.ENABLE) == (True, 'enabled')
    line.until(3.0)
    assert line.writes('C002')[-1] == '0100'
    line.ltmr.set_value('system_status_1', 0x0041, line.now)    # ready, not on
    line.until(4.0)
    # it holds no command any more before it has control again
    assert line.writes('C002')[-1] == '0000'
    line.ltmr.release('system_status_1')
    line.until(8.0)
    assert line.writes('C002')[-1] == '0000'
    status, *_ = line.found(ProcessDataReceived)[-1].raws
    assert not status & 0x0002
