# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The keys that only drives of CiA 402 have."""

from dataclasses import dataclass
from typing import Literal

from drive_can_bridge.protocols.canopen.addressing import NodeOptions
from drive_can_bridge.protocols.canopen.network import NODE_MAX
from drive_can_bridge.protocols.cia402.pdo import PDO_MAX
from drive_can_bridge.protocols.family import IntegerList, option

#: those that a prober settles
PROBED = ('mode', 'mapping', 'disable_word', 'bridge_heartbeat')


@dataclass(frozen=True, slots=True)
class Cia402Options(NodeOptions):
    """Mode, PDOs, heartbeats and NMT of the drive."""

    mode: Literal['csp', 'csv', 'cst', 'pp', 'pv', 'tq', 'vl', 'ip'] = option(
        None, 'Mode of operation, written to 6060h; its setpoint has to be in cyclic_request.')
    mapping: Literal['configure', 'verify', 'assume'] = option(
        'configure', 'What becomes of the PDOs: configure (written, each read back), verify '
        '(read; not cycled where they differ), assume (not looked at).')
    request_pdos: IntegerList = option(
        (), 'Numbers of the receive PDOs to be filled, in order: control word, then '
        'cyclic_request; none: as many as needed, from 1.', minimum=1, maximum=PDO_MAX)
    response_pdos: IntegerList = option(
        (), 'Numbers of the transmit PDOs to be filled, in order: status word, then '
        'cyclic_response; none: as many as needed, from 1.', minimum=1, maximum=PDO_MAX)
    transmission: Literal['sync', 'event'] = option(
        'sync', 'sync: one SYNC a period and bus; event: the drive sends by its event timer.')
    heartbeat_producer: float = option(
        0.1, 's between heartbeats of the drive, written to 1017h; 0: left alone.', minimum=0,
        maximum=65.535)
    heartbeat_timeout: float = option(
        0.35, 's without heartbeat until the drive counts as offline; 0: not watched.', minimum=0,
        maximum=3600)
    ramp_bits: bool = option(
        True, 'Mode vl: enabled by 007Fh (ramp generator enabled, unlocked, its input taken); '
        'false: by 000Fh.')
    bridge_heartbeat: float = option(
        0.2, 's between heartbeats of the bridge, which the drive watches (1016h) for three times '
        'as long; 0: off.', minimum=0, maximum=20)
    bridge_node: int = option(
        NODE_MAX, 'Node-ID of the bridge, for its heartbeat.', minimum=1, maximum=NODE_MAX)
    disable_word: Literal['disable_operation', 'shutdown', 'disable_voltage'] = option(
        'disable_operation', 'What disable and the stop send to an enabled drive: 0007h (brakes '
        'as its 605Ch says), 0006h (as 605Bh says, usually coasts), 0000h (coasts).')
    homing: bool = option(False, 'Offer ~/home.')
    homing_timeout: float = option(
        60.0, 's until a homing that has not ended counts as failed.', minimum=0.1, maximum=3600)
    nmt_start: bool = option(
        True, 'Send NMT: pre-operational for the set-up, start behind it, again after a boot-up, '
        'at most once a second while it is offline, and pre-operational before a stop to a node '
        'that NMT has stopped. false: none, and the mapping is written only where the node is '
        'found pre-operational.')
