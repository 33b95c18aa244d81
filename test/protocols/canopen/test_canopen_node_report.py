# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What people are told of a node."""

from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.statistics import DriveStatistics
from drive_can_bridge.protocols.canopen.network import NmtState
from drive_can_bridge.protocols.canopen.node import Node
from drive_can_bridge.protocols.canopen.node_report import NodeReport

#: CiA 301: error code 2310h, error register 03h
OVERCURRENT = bytes.fromhex('1023030000000000')
NO_ERROR = bytes(8)


def made(heartbeat_timeout: float = 0.0) -> tuple[Node, NodeReport, Reporter]:
    node = Node(5, nmt_start=False, heartbeat_timeout=heartbeat_timeout)
    log = Reporter(DriveStatistics(), '')
    return node, NodeReport(node, log), log


def test_emergency_and_its_end() -> None:
    node, report, log = made()
    assert (report.ailing, report.facts()['emergency']) == ('', 'none')
    report.emergency(OVERCURRENT)
    text = report.facts()['emergency']
    assert '2310h' in text
    assert report.ailing == f'emergency {text}: remove its cause'
    report.emergency(OVERCURRENT)      # nothing new
    report.emergency(NO_ERROR)
    assert report.ailing == ''
    assert log.take() == [
        Noted(f'emergency {text}', warning=True),
        Noted('emergency over: the node reports no error any more')]


def test_state_and_missing_heartbeat() -> None:
    node, report, _ = made(heartbeat_timeout=0.1)
    assert report.facts()['nmt_state'] == 'unknown'
    assert report.missing.startswith('no heartbeat although heartbeat_timeout is set')
    node.receive_heartbeat(NmtState.OPERATIONAL, 1.0, True)
    assert report.facts()['nmt_state'] == 'operational'
    assert report.missing == ''
    assert made()[1].missing == '', 'none is wanted'
