# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Two drives on one bus: what one of them does not do costs the other nothing."""

from builders import Conversation, drive, GAIN, read
import pytest
from saying import codes

ZEROS = '0000000000000000'


def test_a_drive_that_never_answers_costs_the_other_nothing() -> None:
    first = Conversation(drive(name='first', station=1))
    second = Conversation(drive(name='second', station=2))
    cycles, latencies = [], []
    asked: list[tuple[float, str]] = []
    now = 10.0
    for talk in (first, second):
        talk.bus_up(9.0)
    sent = [(talk, text) for talk in (first, second) for text in talk.activate(now)]
    second_frames = 0
    while now < 13.0:
        # what a bus does: the frames of both, and the answers of the first 1 ms later
        answers = []
        for talk, text in sent:
            if talk is second:
                second_frames += 1
            elif text.startswith('003FFFF0'):
                cycles.append(now)
                answers.append('103FFFF0#03E800FA00010000')
            elif text.startswith('002007A4'):
                answers.append('102007A4#0032003300000000')
            elif text.startswith('002007E4'):
                answers.append('102007E4#00D100D200D30000')
            elif text.startswith('00200281'):
                answers.append('10200281#0007000000000000')
        sent = []
        if answers:
            now += 0.001
            sent += [(first, text) for answer in answers for text in first.hears(answer, now)]
            continue
        if len(asked) < 200 and len(cycles) > 5:
            # users ask both, the second one in vain
            asked.append((now, 'both'))
            sent += [(first, text) for text in first.submits(read(GAIN), now)]
            sent += [(second, text) for text in second.submits(read(GAIN), now)]
            if sent:
                continue
        now = min(first.session.next_timer(), second.session.next_timer())
        for talk in (first, second):
            if talk.session.next_timer() <= now:
                sent += [(talk, text) for text in talk.at(now)]
    assert len(cycles) == 150
    assert [b - a for a, b in zip(cycles, cycles[1:])] == pytest.approx([0.02] * 149)
    assert first.session.statistics.missed == 0
    assert first.session.statistics.latency.maximum == pytest.approx(0.001)
    assert second_frames > 20
    assert not second.session.ever_online
    done = first.outcomes()
    assert done.count([7]) > 100
    latencies.append(first.session.statistics.period_error.maximum)
    assert latencies[0] < 1e-9
    assert set(codes(outcome for outcome, in second.outcomes())) <= {'no_answer_offline', 'busy'}
