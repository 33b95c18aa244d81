# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Finding CANopen nodes, among them devices with a PKW mailbox."""

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen_pkw import pkw
from drive_can_bridge.protocols.canopen_pkw.pkw import Address
from drive_can_bridge.protocols.scanner import Certainty, Scanner

#: the object of the mailbox, in the upper half of a mapping entry
MAILBOX = 0x3000
#: the register that is read through the mailbox: system status
STATUS = Address(455)
#: bits of a PDO's identifier entry: it does not exist; 29 bits; and the identifier itself
_PDO_IDENTIFIER = 0xA00007FF
#: all bits of address and function that answers repeat, but for the toggle, wherever it stands
_REPEATED = 0xFF7F7F7F


class CanopenScanner(Scanner):
    """
    Recognises heartbeats, boot-up messages, mailbox traffic and SDO answers.

    Reads objects that every node has or refuses. 600h to 67Fh mean nothing to other families. The
    mailbox itself is read only where the node's own receive PDO4 is known to be one, at 500h +
    node: elsewhere it would be process data. That read is no write in any layout.
    """

    protocol = 'canopen_pkw'
    unmistakable = True

    def __init__(self) -> None:
        super().__init__()
        self._mailboxes: set[int] = set()
        self._facts: dict[int, dict[str, str]] = {}

    def begin(self) -> None:
        self._questions += [sdo.encode_upload(node, sdo.DEVICE_TYPE, 0)
                            for node in range(1, network.NODE_MAX + 1)]

    def receive_request(self, frame: Frame, now: float) -> None:
        base, node = frame.identifier & 0x780, frame.identifier & 0x7F
        if base == network.REQUEST_BASE:
            self._request(node, frame.data, now)
        elif base == sdo.REQUEST_BASE:
            self._request(node, frame.data, now,
                          service=int.from_bytes(frame.data[1:4], 'little'))

    def receive(self, frame: Frame, now: float) -> None:
        if frame.extended:
            return
        base, node = frame.identifier & 0x780, frame.identifier & 0x7F
        try:
            if frame.identifier == network.NMT_IDENTIFIER:
                network.decode_nmt(frame.data)
                self.master = 'NMT commands'
            elif not node:
                return
            elif base == network.HEARTBEAT_BASE:
                self._fact(node, 'heartbeat', network.decode_heartbeat(frame.data).text)
            elif base == sdo.RESPONSE_BASE:
                self._take_upload(node, sdo.decode_upload(frame.data), now)
            elif base == sdo.REQUEST_BASE and len(frame.data) == 8:
                self.receive_request(frame, now)
                self.master = frame_sentences.sdo_requests_to(node)
            elif base == network.REQUEST_BASE and len(frame.data) == 8:
                self.receive_request(frame, now)
            elif base == network.RESPONSE_BASE and len(frame.data) == 8:
                if self._answer(node, 'PKW answers', now, lambda request: _repeats(
                        request, frame.data)) and node in self.sightings:
                    self._fact(node, 'PKW', 'answers')
        except RemoteProtocolError:
            return

    def _take_upload(self, node: int, upload: sdo.Uploaded, now: float) -> None:
        (index, subindex), value, absent = upload
        if index == sdo.DEVICE_TYPE:
            self._fact(node, 'device type', 'refused' if value is None else f'{value:08X}h')
            for entry in ((sdo.IDENTITY, 1), (sdo.IDENTITY, 2), (sdo.RPDO4_MAPPING, 1)):
                self._questions.append(sdo.encode_upload(node, *entry))
        elif (index, subindex) == (sdo.RPDO4, 1) and node in self._mailboxes:
            # one without an object that says where it listens does so as delivered
            if absent or value is not None and (
                    value & _PDO_IDENTIFIER == network.REQUEST_BASE + node):
                # a device that got the function of the first one last, does not answer that one
                self._questions += [Frame(network.REQUEST_BASE + node, pkw.encode(
                    pkw.read_request(STATUS, 1, toggle), pkw.PkwLayout.WORD_LE), False)
                    for toggle in (False, True)]
        elif value is None:
            return
        elif index == sdo.IDENTITY:
            self._fact(node, 'vendor' if subindex == 1 else 'product', f'{value:X}h')
        elif index == sdo.RPDO4_MAPPING:
            told = f'{value >> 16:04X}h'
            self._fact(node, 'RPDO4 maps', told)
            if value >> 16 == MAILBOX and self._answer(
                    node, told, now, service=_service(index, subindex)) and (
                    node in self.sightings):
                self._mailboxes.add(node)
                self._fact(node, 'mailbox', 'yes')
                self._questions.append(sdo.encode_upload(node, sdo.RPDO4, 1))

    def _fact(self, node: int, name: str, text: str) -> None:
        facts = self._facts.setdefault(node, {})
        facts[name] = text
        told = ', '.join(f'{key} {value}' for key, value in facts.items() if key != 'mailbox')
        self.nodes[node] = told
        if node in self._mailboxes:
            self._see(node, told, Certainty.CERTAIN)
        elif facts.get('PKW'):
            self._see(node, told, Certainty.LIKELY)


def _service(index: int, subindex: int) -> int:
    """Return the service that an object is; PKW is 0. Requests hold it in bytes 1 to 3."""
    return subindex << 16 | index


def _repeats(request: bytes, answer: bytes) -> bool:
    """Return whether address and function are the same, as in every layout, refusals aside."""
    different = int.from_bytes(request[:4], 'big') ^ int.from_bytes(answer[:4], 'big')
    return not different & _REPEATED
