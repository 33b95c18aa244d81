# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
No setpoint leaves that is older than ``command_timeout``, whichever thread goes first.

The process stands still for less than a second, and hears then, at once, what arrived meanwhile:
answers that let the session go on, before any timer has run.
"""

from functools import partial

from builders import GAIN, RAMP, read
from extent import some
from partners import Partner, PARTNERS
import pytest
from coming import Coming

TIMEOUT = 0.2
#: s that an answer takes: long enough to be under way when the process stops
DELAY = 0.004


class Bus:
    """Answers that take a while."""

    def __init__(self, partner: Partner) -> None:
        self.partner, self.talk = partner, partner.talk
        self.coming = Coming()
        self.sent: list[tuple[float, str]] = []

    def took(self, sent: list[str]) -> None:
        for text in sent:
            self.sent.append((self.partner.now, text))
            for answer in self.partner.answers(text):
                self.coming.plan(self.partner.now + DELAY, partial(self.arrives, answer))

    def arrives(self, text: str) -> None:
        self.took(self.talk.hears(text, self.partner.now))

    def live(self, end: float) -> None:
        partner, talk = self.partner, self.talk
        self.coming.live(partner, end, due=talk.session.next_timer,
                         timers=lambda: self.took(talk.at(partner.now)))
        partner.now = end

    def stall(self, seconds: float) -> None:
        """Stand still; then the reader goes first, with all that has arrived, and goes on."""
        self.partner.now += seconds
        for _ in range(30):
            if self.coming:
                self.coming.arrives()


@pytest.mark.parametrize('seconds', [0.25, 0.5, 0.9])
@pytest.mark.parametrize('protocol', PARTNERS)
def test_nothing_stale_after_a_stall(protocol: str, seconds: float) -> None:
    for step in some(range(60), 7):
        partner = PARTNERS[protocol](command_timeout=TIMEOUT, refresh_interval=0.3) if (
            protocol in ('canopen_pkw', 'datamodel_standard')) else PARTNERS[protocol](
            command_timeout=TIMEOUT)
        partner.start()
        partner.enable()
        bus = Bus(partner)
        for value in (0.0, 100.0, 110.0, 120.0):
            partner.talk.commands(0, value, partner.now)
            bus.live(partner.now + 0.02)
        bus.live(partner.now + 0.0011 * (step % 20))
        # another one is on its way to the drive, or about to be
        partner.talk.commands(0, 130.0, partner.now)
        commanded_at = partner.now
        bus.live(partner.now + 0.003 * (step // 20))
        if step % 2:
            bus.took(partner.talk.submits(
                read(partner.own(RAMP), partner.own(GAIN)), partner.now))
        before = len(bus.sent)
        bus.stall(seconds)
        bus.live(partner.now + 0.3)
        for at, text in bus.sent[before:]:
            assert at - commanded_at <= TIMEOUT or set(partner.setpoints(text)) <= {0}, (
                f'step {step}: {text} at {at - commanded_at:.3f} s')
