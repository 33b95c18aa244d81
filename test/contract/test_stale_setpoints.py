# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
No setpoint leaves that is older than ``command_timeout``, whichever thread goes first.

The process stands still for less than a second, and hears then, at once, what arrived meanwhile:
answers that let the session go on, before any timer has run.
"""

from builders import GAIN, RAMP, read
from extent import some
from partners import PARTNERS
import pytest
from timeline import Timeline

TIMEOUT = 0.2
#: s that an answer takes: long enough to be under way when the process stops
DELAY = 0.004


@pytest.mark.parametrize('seconds', [0.25, 0.5, 0.9])
@pytest.mark.parametrize('protocol', PARTNERS)
def test_nothing_stale_after_a_stall(protocol: str, seconds: float) -> None:
    for step in some(range(60), 7):
        partner = PARTNERS[protocol](command_timeout=TIMEOUT, **(
            {'refresh_interval': 0.3} if protocol in ('canopen_pkw', 'datamodel_standard') else {}
        )).start()
        partner.enable()
        talk = partner.talk
        talk.now = partner.now
        line = Timeline(talk, lambda text, partner=partner: next(
            ((DELAY, answer) for answer in partner.answers(text)), None))
        for value in (0.0, 100.0, 110.0, 120.0):
            talk.commands(0, value, talk.now)
            line.live(talk.now + 0.02)
        line.live(talk.now + 0.0011 * (step % 20))
        # another one is on its way to the drive, or about to be
        talk.commands(0, 130.0, talk.now)
        commanded_at = talk.now
        line.live(talk.now + 0.003 * (step // 20))
        if step % 2:
            line.took(talk.submits(
                read(partner.own(RAMP), partner.own(GAIN)), talk.now))
        before = len(line.log)
        line.stall(seconds)
        line.live(talk.now + 0.3)
        for at, text in line.log[before:]:
            assert at - commanded_at <= TIMEOUT or set(partner.setpoints(text)) <= {0}, (
                f'step {step}: {text} at {at - commanded_at:.3f} s')
