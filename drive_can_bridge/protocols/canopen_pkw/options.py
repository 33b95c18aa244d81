# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The keys that only devices with a PKW mailbox have."""

from dataclasses import dataclass
from typing import Literal

from drive_can_bridge.core.frame import STANDARD_IDENTIFIER_MAX
from drive_can_bridge.protocols.canopen.addressing import NodeOptions
from drive_can_bridge.protocols.family import option

#: those that a prober settles
PROBED = ('layout', 'word_order', 'abort_code_order')


@dataclass(frozen=True, slots=True)
class PkwOptions(NodeOptions):
    """Where the mailbox is, and how its bytes are laid out."""

    layout: Literal['word_le', 'dword_swapped', 'word_be'] = option(
        'word_le', 'Place of the bytes in the PDO: word_le (every word low byte first), '
        'dword_swapped (words of each pair change places), word_be (every word high byte first).')
    word_order: Literal['high_first', 'low_first'] = option(
        'high_first', 'Which word of a 32-bit value comes first (lower register); a parameter of '
        'the profile may override it.')
    abort_code_order: Literal['auto', 'low_first', 'high_first'] = option(
        'auto', 'Which half of an abort code word 3 holds; auto finds out.')
    addressing: Literal['register', 'canopen'] = option(
        'register', 'register: parameters are reached by number; canopen: by index and subindex.')
    request_cob_id: int = option(
        None, 'Identifier of requests to the device (receive PDO4); by default 500h + node.',
        minimum=1, maximum=STANDARD_IDENTIFIER_MAX)
    response_cob_id: int = option(
        None, 'Identifier of responses (transmit PDO4); by default 480h + node.',
        minimum=1, maximum=STANDARD_IDENTIFIER_MAX)
    refresh_interval: float = option(
        1.0, 's: unchanged values of cyclic_request are written again this often; 0: only on '
        'change.', minimum=0, maximum=3600)
