# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Frames of station 1 with 11-bit identifiers, and the way to its first round."""

from typing import Any

from builders import drive
from conversation import Conversation

#: Reg.209 to 211 in one read
ASK = '3F1#03D1000300000000'
#: 100.0 rpm, 2.50 A, ready; the fourth word means nothing
ANSWER = '7F1#E803FA000100ADDE'
SPEED_ZERO = '3F1#0632000000000000'
LIMIT_ZERO = '3F1#0633000000000000'


def polling(**options: Any) -> Conversation:
    """Return a conversation whose first round was begun at 10 s."""
    talk = Conversation(drive('datamodel_standard', **options))
    assert talk.begins() == []
    assert talk.at(10.0) == [ASK]
    return talk


def online(**options: Any) -> Conversation:
    """Return a conversation with a drive that answered at 10.002 s and has both its setpoints."""
    talk = polling(**options)
    assert talk.hears(ANSWER, 10.002) == []
    assert talk.session.online
    assert talk.until(10.01) == [(10.003, SPEED_ZERO), (10.004, LIMIT_ZERO)]
    talk.events()
    return talk


def round_of(talk: Conversation, now: float, answer: str = ANSWER) -> list[str]:
    """Let a round pass that begins at ``now``; return what was sent before its read."""
    sent = [text for _, text in talk.until(now + 0.0025)]
    assert sent[-1] == ASK
    assert talk.hears(answer, now + 0.004) == []
    return sent[:-1]
