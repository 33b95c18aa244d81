# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What was seen on a bus, and when: an entry of a trace."""

from enum import Enum
from typing import NamedTuple, Union


class RecordKind(Enum):
    """What was seen."""

    DATA = 'data'
    REMOTE = 'remote'
    ERROR = 'error'
    FD = 'fd'


class Record(NamedTuple):
    """
    One entry of a trace.

    Unlike a ``Frame`` it may be anything that adapters report: no protocol here has remote or CAN
    FD frames, but who looks for the reason of a failure wants to see them.

    :param time: s, since 1970 or since the start of the trace.
    :param channel: what the trace calls the bus: a name, a number, or '' where it has none.
    :param identifier: of an error frame: the classes of errors, as in linux/can/error.h.
    :param sent: by the machine that recorded it; None: the trace does not say.
    """

    time: float
    channel: Union[str, int]
    identifier: int
    data: bytes
    extended: bool
    kind: RecordKind = RecordKind.DATA
    sent: bool | None = None


DATA = RecordKind.DATA
