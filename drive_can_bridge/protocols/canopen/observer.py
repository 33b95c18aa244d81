# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Watching what CANopen nodes say as nodes, whatever their drives speak, and what all are told."""

from collections.abc import Callable

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.messages import around
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.canopen.network import Emergency, NmtState
from drive_can_bridge.protocols.observer import (
    DriveObserver, Emit, Telegram, TelegramKind, Verdict)
from drive_can_bridge.protocols.pairing import AnswerWatch
from drive_can_bridge.protocols.telegrams import Direction

_REQUEST, _RESPONSE, _NETWORK = Direction.REQUEST, Direction.RESPONSE, TelegramKind.NETWORK
_COMMANDS = {command.value: command.name.lower().replace('_', ' ')
             for command in network.NmtCommand}


def listen_to_node(observer: DriveObserver, node: int, booted: Callable[[], None],
              timeout: float) -> None:
    """
    Report heartbeats, answers to node guarding and emergency messages of a node.

    :param booted: called when the node has started.
    :param timeout: s that an answer to node guarding may take.
    """
    def lose(now: float) -> None:
        observer.report(now, _RESPONSE, _NETWORK, 'node guarding', verdict=Verdict.LOST,
                      remark='no answer')
    guarding = AnswerWatch(observer, timeout, lose)

    def take_guarding(_: bytes, now: float) -> None:
        observer.report(now, _REQUEST, _NETWORK, 'node guarding', remark='request')
        guarding.ask(now)

    def take_heartbeat(state: NmtState, now: float) -> None:
        if state is NmtState.BOOT_UP:
            booted()
            observer.report(now, _RESPONSE, _NETWORK, 'boot-up', verdict=Verdict.SUSPICIOUS,
                          remark=frame_sentences.device_started())
        else:
            latency = guarding.answer(now)
            title = 'node guarding' if latency == latency else 'heartbeat'  # NaN: of itself
            observer.report(now, _RESPONSE, _NETWORK, title, remark=state.text, latency=latency)

    def take_emergency(emergency: Emergency, now: float) -> None:
        over = emergency.code == network.NO_ERROR
        observer.report(now, _RESPONSE, _NETWORK, 'emergency', remark=emergency.text,
                      verdict=Verdict.NORMAL if over else Verdict.SUSPICIOUS)

    observer.remote_handlers[network.HEARTBEAT_BASE + node] = take_guarding
    observer.listen(network.HEARTBEAT_BASE + node, _RESPONSE, _NETWORK, 'heartbeat',
                  network.decode_heartbeat, take_heartbeat)
    observer.listen(network.EMERGENCY_BASE + node, _RESPONSE, _NETWORK, 'emergency',
                  network.decode_emergency, take_emergency)


class NmtObserver(DriveObserver):
    """
    Watches NMT commands, which are for all nodes of a bus.

    :param nodes: names of the configured drives by node-ID.
    """

    def __init__(self, nodes: dict[int, str], emit: Emit) -> None:
        super().__init__('', emit)
        self._nodes = nodes
        self.listen(network.NMT_IDENTIFIER, _REQUEST, _NETWORK, 'NMT', network.decode_nmt,
                  self._take)

    def _take(self, told: tuple[int, int], now: float) -> None:
        command, node = told
        what = _COMMANDS.get(command)
        self.emit(Telegram(
            now, self._nodes.get(node, ''), _REQUEST, _NETWORK, 'NMT',
            verdict=Verdict.MALFORMED if what is None else Verdict.NORMAL,
            remark=around(
                frame_sentences.unknown_command(command) if what is None else what,
                behind=' all nodes' if node == 0 else f' node {node}')))
