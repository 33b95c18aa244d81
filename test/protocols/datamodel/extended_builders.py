# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Frames of station 1 with the maps 50, 51 and 209, 210, 211, and the way to its first cycle."""

from typing import Any

from builders import drive
from conversation import Conversation
from saying import says

ZEROS = '0000000000000000'
ASK_REQUEST_MAP = f'002007A4#{ZEROS}'
ASK_RESPONSE_MAP = f'002007E4#{ZEROS}'
REQUEST_MAP = '102007A4#0032003300000000'
RESPONSE_MAP = '102007E4#00D100D200D30000'
NEUTRAL = f'003FFFF0#{ZEROS}'
RUNNING = '003FFFF0#03E8000000000000'
#: 100.0 rpm, 2.50 A, ready; and enabled
ANSWER = '103FFFF0#03E800FA00010000'
ENABLED = '103FFFF0#03E800FA00030000'
#: speed_setpoint (50), torque_limit (51) and control_word (52) by number, and what asks for them
SPEED_ZERO, LIMIT_ZERO, DISABLE = f'00300321#{ZEROS}', f'00300331#{ZEROS}', f'00300341#{ZEROS}'
ASK_SPEED, ASK_LIMIT, ASK_WORD = f'00200321#{ZEROS}', f'00200331#{ZEROS}', f'00200341#{ZEROS}'
SPEED_IS_ZERO, LIMIT_IS_ZERO = f'10200321#{ZEROS}', f'10200331#{ZEROS}'

#: why a drive is lost that three cycles were sent to
SILENT = says('silent_for_cycles', cycles=3, what='no cyclic response')
#: more than what sums of periods are wrong by
TICK = 1e-6


def checked(conversation: Conversation, now: float) -> None:
    """Answer a look at the maps that began at ``now``."""
    assert conversation.hears(REQUEST_MAP, now + 0.001) == [ASK_RESPONSE_MAP]
    assert conversation.hears(RESPONSE_MAP, now + 0.002) == []


def cycling(**options: Any) -> Conversation:
    """Return a conversation whose maps were verified; the first cycle is due at 10 s."""
    talk = Conversation(drive(**options))
    assert talk.bus_up(9.0) == []
    if options.get('mapping') == 'assume':
        assert talk.activate(10.0) == []
    else:
        assert talk.activate(9.998) == [ASK_REQUEST_MAP]
        checked(talk, 9.998)
    assert talk.session.next_timer() == 10.0
    return talk


def online(**options: Any) -> Conversation:
    """Return a conversation with a drive that answered its first cycle at 10.002 s."""
    talk = cycling(**options)
    sent = talk.at(10.0)
    assert len(sent) == 1
    assert sent[0].startswith('003FFFF0#')
    talk.hears(ANSWER, 10.002)
    assert talk.session.online
    talk.events()
    return talk


def exchange(talk: Conversation, now: float, answer: str = ANSWER) -> str:
    """Let one cycle pass at ``now``; return its request. Nothing else may be sent."""
    (_, request), = talk.until(now + TICK)
    assert talk.hears(answer, now + 0.002) == []
    return request
