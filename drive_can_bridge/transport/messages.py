# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Messages of python-can as entries of a trace, and back."""

import can

from drive_can_bridge.core.record import Record, RecordKind


def record_of(message: can.Message, channel: str | int) -> Record:
    """Return a message as an entry of a trace."""
    kind = RecordKind.DATA
    if message.is_error_frame:
        kind = RecordKind.ERROR
    elif message.is_remote_frame:
        kind = RecordKind.REMOTE
    elif message.is_fd:
        kind = RecordKind.FD
    return Record(message.timestamp, channel, message.arbitration_id, bytes(message.data),
                  message.is_extended_id, kind, not message.is_rx)


def message_of(record: Record, channel: int) -> can.Message:
    """Return an entry as a message; formats number the buses."""
    kind = record.kind
    return can.Message(
        timestamp=record.time, arbitration_id=record.identifier, data=record.data,
        is_extended_id=record.extended, is_error_frame=kind is RecordKind.ERROR,
        is_remote_frame=kind is RecordKind.REMOTE, is_fd=kind is RecordKind.FD,
        is_rx=not record.sent, channel=channel)
