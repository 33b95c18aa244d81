# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Late answers: whose fault they are, by what the drives of a bus have in common."""

from saying import says

from drive_can_bridge.core.adapter import AdapterTraits
from drive_can_bridge.core.lateness import AnswerTiming, Lateness

CANABLE = AdapterTraits('CANable 1')
FTDI = AdapterTraits('LAWICEL CANUSB', 0.016, 'echo 1 | sudo tee /sys/latency_timer')


def answers(late: int, late_by: float = 0.004, period: float = 0.01, *,
            online: bool = True) -> AnswerTiming:
    return AnswerTiming(late, late_by, period, online)


def test_all_drives_by_the_same_time_is_the_adapter() -> None:
    lateness = Lateness()
    lateness.look({'lift': answers(3), 'belt': answers(1, 0.0045)})
    assert lateness.shared
    assert lateness.told('main', answers(3), CANABLE) == says(
        'answers_late', seconds=0.004, bus='main', adapter='CANable 1')
    assert lateness.told('main', answers(3), None) == says('answers_late', adapter='adapter')
    # also where their periods differ: it is the delay that counts
    lateness.look({'lift': answers(4, 0.004, 0.01), 'belt': answers(2, 0.009, 0.005)})
    assert lateness.shared
    # one that is not there has no answers
    lateness.look({'lift': answers(5), 'belt': answers(3), 'gone': answers(0, online=False)})
    assert lateness.shared


def test_one_of_several_is_that_drive() -> None:
    lateness = Lateness()
    lateness.look({'lift': answers(3), 'belt': answers(0)})
    assert not lateness.shared
    assert lateness.told('main', answers(3), CANABLE) == says('answer_late', seconds=0.004)
    # which was late before, and is not any more
    lateness.look({'lift': answers(4), 'belt': answers(0)})
    lateness.look({'lift': answers(5), 'belt': answers(0)})
    assert not lateness.shared


def test_delays_of_two_kinds_are_two_drives() -> None:
    lateness = Lateness()
    lateness.look({'lift': answers(3, 0.002), 'belt': answers(1, 0.08)})
    assert not lateness.shared


def test_a_drive_alone_shows_nothing() -> None:
    lateness = Lateness()
    lateness.look({'lift': answers(3)})
    assert not lateness.shared
    lateness.look({})
    assert not lateness.shared


def test_a_timer_that_is_known_is_named_even_so() -> None:
    lateness = Lateness()
    lateness.look({'lift': answers(3)})
    assert lateness.told('main', answers(3), FTDI) == says(
        'answer_kept', seconds=0.004, adapter='LAWICEL CANUSB', latency=0.016,
        remedy='echo 1 | sudo tee /sys/latency_timer')
    # later than that: it is something else
    assert lateness.told('main', answers(3, 0.04), FTDI) == says('answer_late', seconds=0.04)
    assert lateness.told('main', answers(3), AdapterTraits('rfcomm', 0.05)) == (
        'answer 4 ms after its period: the adapter (rfcomm) keeps what it has received for up to '
        '50 ms: choose a longer period')
