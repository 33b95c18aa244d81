# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What to do about a drive, as a command line that can be pasted."""

from rclpy.node import Node

from drive_can_bridge.core.session import Session


def _by_hand(command: str, drive: str, node: Node) -> str:
    """
    Return the command line that does something to a drive.

    :param node: of a drive of the same bridge.
    """
    place = node.get_namespace().rstrip('/')
    return f'drive_can {command} {place}/{drive}' if place else f'drive_can {command} {drive}'


def how_to_enable(session: Session, node: Node) -> str:
    """Say what to do about a drive that is disabled."""
    lead = session.enabled_by
    whom = ('' if lead == session.configuration.name
            else f' of {lead}, which leads the broadcast group')
    return f'call ~/enable{whom} ({_by_hand("enable", lead, node)})'


def how_to_reset(session: Session, node: Node) -> str:
    """Say what to do about a drive in fault, when its cause is gone."""
    if session.control is None:
        return 'reset it at the drive'
    lead, own = session.enabled_by, session.configuration.name
    return (f'call ~/reset_fault ({_by_hand("reset", own, node)}) and ~/enable '
            f'({_by_hand("enable", lead, node)})')
