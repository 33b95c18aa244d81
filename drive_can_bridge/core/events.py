# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The events that a session reports, and the state of its drive in one word.

Times are ``now`` of the call that caused the event.
"""

from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple, Union

from drive_can_bridge.core.control import ControlCompleted
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.requests import Outcome, Request


class ProcessDataReceived(NamedTuple):
    """
    One sample of the mapped response parameters.

    A named tuple: it is made once per exchange.

    :param raws: raw integers in the order of ``Session.sample_parameters``; fewer when the
        response was too short.
    :param received_at: receive time of the frame (steady clock, s).
    """

    raws: tuple[int, ...]
    received_at: float


@dataclass(frozen=True)
class StationFound:
    """The drive exchanges process data: it is online."""


@dataclass(frozen=True)
class StationLost:
    """
    The drive is offline; ``reason`` says in words what was missing.

    :param ordered: nothing was: the drive was deactivated, and its stop is complete.
    """

    reason: Sentence
    ordered: bool = False


@dataclass(frozen=True)
class DriveFailed:
    """The drive is stopped and offline after an internal error; ``reason`` has the words."""

    reason: Sentence


@dataclass(frozen=True)
class MappingDiffered:
    """The drive's maps are not the configured ones: no cyclic frame is sent."""

    text: Sentence


@dataclass(frozen=True)
class MappingWritten:
    """The drive's maps were rewritten (``mapping: configure``)."""

    text: Sentence


@dataclass(frozen=True)
class SetpointsExpired:
    """
    No fresh command: these setpoints went neutral and must be armed again.

    :param orderly: each of them was at neutral already: their publisher has ended.
    """

    names: tuple[str, ...]
    orderly: bool = field(default=False, compare=False)


@dataclass(frozen=True)
class RequestCompleted:
    """A request ended; one outcome per parameter, in the order asked."""

    request: Request
    outcomes: tuple[Outcome, ...]


@dataclass(frozen=True)
class FrameRejected:
    """A frame on the drive's own response identifiers was malformed or unasked."""

    text: Sentence


@dataclass(frozen=True)
class AnswerLate:
    """
    Answers come after their time-out.

    :param seconds: by how much the last one did.
    :param would_hold: what to set instead; '': that is not known, or was reported before.
    :param taken: all since the event before count for their exchanges: nothing is lost.
    """

    seconds: float
    would_hold: Sentence = NOTHING
    taken: bool = False


@dataclass(frozen=True)
class ForeignMasterSeen:
    """Another master sends requests to this drive."""

    text: Sentence


@dataclass(frozen=True)
class Noted:
    """
    Any other line for the log.

    :param warning: something should be done about it.
    :param danger: at once: a drive may be running that should not.
    :param error: it is more than a warning.
    :param new: it differs from the one before: a drive may have any number.
    """

    text: Sentence
    warning: bool = False
    danger: bool = False
    error: bool = False
    new: bool = False


Event = Union[ProcessDataReceived, StationFound, StationLost, DriveFailed, MappingDiffered,
              MappingWritten, SetpointsExpired, RequestCompleted, ControlCompleted, FrameRejected,
              AnswerLate, ForeignMasterSeen, Noted]


class DriveState(Enum):
    """The state of a drive in one word, as diagnostics shows it."""

    OFFLINE = 'offline'
    MAPPING_DIFFERS = 'mapping differs'
    DISABLED = 'disabled'
    NOT_ARMED = 'not armed'
    ONLINE = 'online'
    FAULT = 'fault'
