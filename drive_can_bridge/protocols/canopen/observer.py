# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Watching what CANopen nodes say as nodes, whatever their drives speak, and what all are told."""

from collections.abc import Callable

from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.observer import (
    Direction, DriveObserver, Emit, Handler, Kind, Telegram, Verdict,
)

_REQUEST, _RESPONSE, _NETWORK = Direction.REQUEST, Direction.RESPONSE, Kind.NETWORK
_COMMANDS = {command.value: command.name.lower().replace('_', ' ')
             for command in network.NmtCommand}


def node_handlers(observer: DriveObserver, node: int,
                  booted: Callable[[], None]) -> dict[int, Handler]:
    """
    Return who says what the heartbeats and emergency messages of a node mean, by identifier.

    :param booted: called when the node has started.
    """
    def take_heartbeat(data: bytes, now: float) -> None:
        state = observer.decoded(
            network.decode_heartbeat, data, now, _RESPONSE, _NETWORK, 'heartbeat')
        if state is network.NmtState.BOOT_UP:
            booted()
            observer.tell(now, _RESPONSE, _NETWORK, 'boot-up', verdict=Verdict.SUSPICIOUS,
                          remark='the device has started')
        elif state is not None:
            observer.tell(now, _RESPONSE, _NETWORK, 'heartbeat', remark=state.text)

    def take_emergency(data: bytes, now: float) -> None:
        emergency = observer.decoded(
            network.decode_emergency, data, now, _RESPONSE, _NETWORK, 'emergency')
        if emergency is not None:
            over = emergency.code == network.NO_ERROR
            observer.tell(now, _RESPONSE, _NETWORK, 'emergency', remark=emergency.text,
                          verdict=Verdict.NORMAL if over else Verdict.SUSPICIOUS)

    return {network.HEARTBEAT_BASE + node: take_heartbeat,
            network.EMERGENCY_BASE + node: take_emergency}


class NmtObserver(DriveObserver):
    """
    Watches what is said to all nodes of a bus.

    :param nodes: names of the configured drives by node-ID.
    """

    def __init__(self, nodes: dict[int, str], emit: Emit) -> None:
        super().__init__('', emit)
        self._nodes = nodes
        self.handlers[network.NMT_IDENTIFIER] = self._take

    def _take(self, data: bytes, now: float) -> None:
        decoded = self.decoded(network.decode_nmt, data, now, _REQUEST, _NETWORK, 'NMT')
        if decoded is None:
            return
        command, node = decoded
        what = _COMMANDS.get(command)
        self.emit(Telegram(
            now, self._nodes.get(node, ''), _REQUEST, _NETWORK, 'NMT',
            verdict=Verdict.MALFORMED if what is None else Verdict.NORMAL,
            remark=f'{what or f"unknown command {command:02X}h"}'
                   f'{" all nodes" if node == 0 else f" node {node}"}'))
