# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Finding drives of CiA 402 among CANopen nodes: the lower half of 1000h says it.

Where a master is talking to them already, nobody may ask: then control word and status word at the
head of PDO1, cycle after cycle beside a SYNC, are a likely one.
"""

from collections import Counter
from typing import Any

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.cia402 import pdo, states
from drive_can_bridge.protocols.scanner import Certainty, Scanner

#: device profile, in the lower half of 1000h
PROFILE = 0x0192
#: kinds of drives, in bits 16 to 23 of it
_KINDS = {1: 'frequency converter', 2: 'servo drive', 4: 'stepper'}
#: the other half of it where a node has several device modules (CiA 301)
_MODULES = 0xFFFF
#: cycles that make process data likely to be what they look like
_CYCLES = 3
#: bits of a control word that no mode has
_RESERVED = 0xFE00
_IDENTITY = {1: 'vendor', 2: 'product', 3: 'revision', 4: 'serial number'}


class Cia402Scanner(Scanner):
    """
    Recognises answers to reads of 1000h, whichever master asks.

    Reads objects that every node has or refuses. 600h to 67Fh mean nothing to other families.
    """

    protocol = 'cia402'
    unmistakable = True

    def __init__(self) -> None:
        super().__init__()
        self._types: dict[int, str] = {}
        self._identities: dict[int, dict[str, str]] = {}
        self._cycles: Counter[int] = Counter()      # by identifier; SYNC among them

    def begin(self) -> None:
        # what another scanner's question brought is known already
        self._questions += [sdo.encode_upload(node, sdo.DEVICE_TYPE, 0) for node in range(
            1, network.NODE_MAX + 1) if node not in self._types]
        for node in self.sightings:
            self._ask_identity(node)

    def _ask_identity(self, node: int) -> None:
        self._questions += [sdo.encode_upload(node, sdo.IDENTITY, subindex)
                            for subindex in _IDENTITY
                            if _IDENTITY[subindex] not in self._identities.get(node, ())]

    def settings(self, station: int) -> dict[str, Any]:
        """Return the mode that moves nothing by itself and needs no short period."""
        return {'mode': 'pv'}

    def receive(self, frame: Frame, now: float) -> None:
        base, node = frame.identifier & ~network.NODE_MAX, frame.identifier & network.NODE_MAX
        if frame.extended:
            return
        if frame.identifier == network.SYNC_IDENTIFIER or base in (pdo.RPDO_BASE, pdo.TPDO_BASE):
            self._receive_cycle(frame, node)
        elif base == sdo.RESPONSE_BASE and node:
            self._receive_answer(frame, node)

    def _receive_cycle(self, frame: Frame, node: int) -> None:
        identifier, data, _ = frame
        word = int.from_bytes(data[:2], 'little')
        sync = identifier == network.SYNC_IDENTIFIER
        told = states.state_of(word)
        fits = len(data) <= 1 if sync else len(data) >= 2 and node and (
            told is not states.ServoState.UNKNOWN if identifier < pdo.RPDO_BASE
            else not word & _RESERVED)
        self._cycles[identifier] = self._cycles[identifier] + 1 if fits else 0
        request = pdo.RPDO_BASE + node
        if identifier == pdo.TPDO_BASE + node and min(self._cycles[each] for each in (
                identifier, request, network.SYNC_IDENTIFIER)) >= _CYCLES:
            self.master = frame_sentences.process_data_for(node)
            self.nodes.setdefault(node, f'status word {word:04X}h')
            self._see(node, f'status word {word:04X}h ({told.value}), answered with SYNC',
                      Certainty.LIKELY)

    def _receive_answer(self, frame: Frame, node: int) -> None:
        try:
            (index, subindex), value, _ = sdo.decode_upload(frame.data)
        except RemoteProtocolError:
            return
        if (index, subindex) == (sdo.DEVICE_TYPE, 0):
            self._types[node] = 'refused' if value is None else f'{value:08X}h'
            if value is not None and value & 0xFFFF == PROFILE:
                kind = _KINDS.get(value >> 16 & 0xFF, 'drive')
                if value >> 16 == _MODULES:
                    kind = 'drive, perhaps several axes, of which the first is driven,'
                self._types[node] = f'device type {value:08X}h ({kind} of CiA 402)'
                self._note(node)
                self._ask_identity(node)
        elif index == sdo.IDENTITY and subindex in _IDENTITY and value is not None:
            self._identities.setdefault(node, {})[_IDENTITY[subindex]] = f'{value:X}h'
            # one that only looks like a drive of CiA 402 has not said so in 1000h
            if node in self.sightings and (
                    self.sightings[node].certainty is Certainty.CERTAIN):
                self._note(node)

    def _note(self, node: int) -> None:
        text = ', '.join((self._types[node], *(
            f'{name} {value}' for name, value in self._identities.get(node, {}).items())))
        self.nodes[node] = text
        self._see(node, text, Certainty.CERTAIN)
