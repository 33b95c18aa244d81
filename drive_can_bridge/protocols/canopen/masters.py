# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What other masters send to a node, named as what it is.

NMT commands reach all nodes that they name, so that each session overhears them; requests to the
SDO server of a node are on an identifier that is its own.
"""

from drive_can_bridge.core import sentences
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.events import ForeignMasterSeen
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen.network import NmtCommand
from drive_can_bridge.protocols.telegrams import Direction

#: producer heartbeat time
HEARTBEAT_TIME = (0x1017, 0)
_RESETS = (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)
_COMMANDS = {NmtCommand.START: 'start', NmtCommand.STOP: 'stop',
             NmtCommand.ENTER_PRE_OPERATIONAL: 'enter pre-operational',
             NmtCommand.RESET_NODE: 'reset node',
             NmtCommand.RESET_COMMUNICATION: 'reset communication'}
#: NMT commands; they belong to no drive
NMT_ROUTE = Route.of(network.NMT_IDENTIFIER)


def sdo_route(node: int) -> Route:
    """Return the requests to the SDO server of a node."""
    return Route.of(sdo.REQUEST_BASE + node)


def report_nmt(frame: Frame, node: int, report: Reporter) -> None:
    """Report an NMT command of another master, if it is for this node."""
    try:
        number, addressed = network.decode_nmt(frame.data)
        command = NmtCommand(number)
    except (RemoteProtocolError, ValueError):
        return
    if addressed in (0, node):
        whom = f'node {node}' if addressed else 'all nodes'
        row = sentences.other_master_resets if command in _RESETS else sentences.other_master_nmt
        report.note(ForeignMasterSeen(row(_COMMANDS[command], whom, str(frame))))


def sdo_request(frame: Frame, node: int) -> Sentence:
    """Return what another master asks of the SDO server of a node."""
    try:
        asked = sdo.decode(Direction.REQUEST, frame.data)
    except RemoteProtocolError:
        asked = None
    if asked is not None and asked.kind in (sdo.SdoCommand.UPLOAD, sdo.SdoCommand.SEGMENT_WANTED):
        return sentences.other_master_reads(node, str(frame))
    if asked is not None and asked.kind is sdo.SdoCommand.DOWNLOAD and (
            asked.object == HEARTBEAT_TIME and not any(asked.data)):
        return sentences.heartbeats_ended(node, str(frame))
    return sentences.other_master_asks_node(node, 'SDO requests', str(frame))
