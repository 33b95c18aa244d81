# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What to do about a drive, as a command line, for diagnostics."""

from rclpy.node import Node

from drive_can_bridge.core import sentences
from drive_can_bridge.core.session import Session


def _by_hand(command: str, drive: str, node: Node) -> str:
    """
    Return the command line that acts on a drive.

    :param node: of a drive of the same bridge.
    """
    place = node.get_namespace().rstrip('/')
    return f'drive_can {command} {place}/{drive}' if place else f'drive_can {command} {drive}'


def how_to_enable(session: Session, node: Node) -> str:
    """Return what to do about a drive that is disabled."""
    lead, whom = _leader(session)
    return sentences.call_enable(whom=whom, command=_by_hand('enable', lead, node))


def how_to_reset(session: Session, node: Node) -> str:
    """Return what to do about a drive in fault, when its cause is gone."""
    if session.control is None:
        return sentences.reset_at_drive()
    lead, whom = _leader(session)
    return sentences.call_reset(
        whom=whom, reset=_by_hand('reset', lead, node), enable=_by_hand('enable', lead, node))


def _leader(session: Session) -> tuple[str, str]:
    """Return the drive that handles the commands of this one, and a remark that names it."""
    lead = session.enabled_by
    return lead, ('' if lead == session.configuration.name
                  else f' of {lead}, which leads the broadcast group')
