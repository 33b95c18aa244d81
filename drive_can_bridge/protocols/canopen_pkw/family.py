# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The row of the family table for the CANopen PKW mailbox."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from drive_can_bridge.core import complaints
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Route, worst_bits
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.process_image import control_word
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.canopen.addressing import (
    node_claims, predefined_set, reserved_claims, station_complaints)
from drive_can_bridge.protocols.canopen.masters import NMT_ROUTE, sdo_route
from drive_can_bridge.protocols.canopen_pkw import addresses, pkw
from drive_can_bridge.protocols.canopen_pkw.addresses import Placement, Span
from drive_can_bridge.protocols.canopen_pkw.options import PkwOptions, PROBED
from drive_can_bridge.protocols.family import (
    Claim, Complaint, Family, FamilyParts, ImportRules, ScanEntry)
from drive_can_bridge.protocols.observer import DriveObserver, Emit
from drive_can_bridge.protocols.polled_exchange import round_time

#: of every frame of the mailbox
FRAME_BITS = worst_bits(pkw.PAYLOAD, extended=False)


class CanopenPkw(Family):
    """PKW over PDO4: acknowledged access to registers, one request at a time."""

    name = 'canopen_pkw'
    cyclic = False
    #: a device may take its time: nothing is documented
    drive_defaults = {'parameter_timeout': 0.5}
    options_type = PkwOptions
    on_canopen = True
    probed = PROBED
    scan_entry = ScanEntry('starter', 'tesys_t_ltmr', response=('system_status_1',))
    import_rules = ImportRules(
        choices=({'addressing': 'register'}, {'addressing': 'canopen'}), elements=False,
        eds_objects=())

    def make_options(self, station: int, given: Mapping[str, Any]) -> PkwOptions:
        """Make the options; the COB-IDs are the predefined ones of the node by default."""
        options: PkwOptions = super().make_options(station, {
            'request_cob_id': network.REQUEST_BASE + station,
            'response_cob_id': network.RESPONSE_BASE + station, **given})
        return options

    def check(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        yield from list(station_complaints(drive)) or self._check_identifiers(drive)
        wrong = list(self._check_profile(drive))
        yield from wrong
        if not wrong:
            yield from self._check_request(drive)

    def warnings(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        """Yield what is allowed but suspicious."""
        if not drive.options.predefined_set:
            return
        node = drive.station
        taken = {network.SYNC_IDENTIFIER: 'SYNC', **predefined_set(node)}
        for key, at_home in (('request_cob_id', network.REQUEST_BASE + node),
                             ('response_cob_id', network.RESPONSE_BASE + node)):
            identifier = getattr(drive.options, key)
            if identifier in taken and identifier != at_home:
                yield Complaint(key, complaints.predefined_identifier(
                    identifier=identifier, taken=taken[identifier]))

    def claims(self, drive: DriveConfiguration) -> list[Claim]:
        node, options = drive.station, drive.options
        return node_claims(drive, {options.request_cob_id: f'PKW requests to node {node}',
                                   options.response_cob_id: f'PKW responses of node {node}'})

    def reserved(self, drive: DriveConfiguration) -> list[Claim]:
        return reserved_claims(drive)

    def overheard(self, drive: DriveConfiguration) -> list[Route]:
        """Return NMT, and what the bridge does not use: requests to the SDO server of the node."""
        return [NMT_ROUTE, sdo_route(drive.station)]

    def bits_per_second(self, drive: DriveConfiguration) -> float:
        """Return the worst-case load: each period one round, and every setpoint changes."""
        return 2 * self._requests(drive) * FRAME_BITS / drive.period

    def shortest_period(self, drive: DriveConfiguration, bitrate: int) -> float:
        """Return the time of a round in which every setpoint changes, in s."""
        requests = self._requests(drive)
        return round_time([FRAME_BITS] * (2 * requests), requests, bitrate)

    def raw_parameter(self, drive: DriveConfiguration, name: str) -> Parameter | None:
        """
        Resolve ``p<register>`` and ``x<index>.<sub-index>``: 16 bits, unsigned.

        One that is the register of a listed parameter carries that one's numbers, by which its
        rules are found. What goes over the wire is always what the raw name says.
        """
        address = addresses.raw_address(name)
        if address is None:
            return None
        by_register = address.subindex is None
        raw = Parameter(name=name, listed=False,
                        number=address.word if by_register else None,
                        index=None if by_register else address.word,
                        subindex=address.subindex)
        mine = addresses.keys(raw)
        for other in drive.profile.parameters.values():
            if other.type.bits == 16 and mine & addresses.keys(other):
                return Parameter(name=name, listed=False, number=other.number,
                                 index=other.index, subindex=other.subindex)
        return raw

    def profile_remark(self, entries: Iterable[Mapping[str, Any]]) -> str:
        if any('number' in entry for entry in entries):
            return ''
        return (f'The entries are CANopen objects: a drive of {self.name} that uses them needs '
                '"addressing: canopen".')

    def parts(self) -> FamilyParts:
        from drive_can_bridge.protocols.canopen_pkw.observer import PkwObserver
        from drive_can_bridge.protocols.canopen_pkw.prober import PkwProber
        from drive_can_bridge.protocols.canopen_pkw.scanner import CanopenScanner
        from drive_can_bridge.protocols.canopen_pkw.session import PkwSession
        return FamilyParts(PkwSession, PkwObserver, CanopenScanner, PkwProber)

    def make_observers(self, drives: Sequence[DriveConfiguration], emit: Emit,
                       ) -> list[DriveObserver]:
        """Make the observers of the devices, and of NMT."""
        from drive_can_bridge.protocols.canopen.observer import NmtObserver
        return [*super().make_observers(drives, emit),
                NmtObserver({drive.station: drive.name for drive in drives}, emit)]

    # -- parts ------------------------------------------------------------------------------------

    def _requests(self, drive: DriveConfiguration) -> int:
        """Return the requests of a period in which every setpoint changes."""
        return len(addresses.round_plan(drive)) + len(drive.cyclic_request)

    def _check_identifiers(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        mine = {'request': drive.options.request_cob_id, 'response': drive.options.response_cob_id}
        taken = {**mine, 'emergency': network.EMERGENCY_BASE + drive.station,
                 'heartbeat': network.HEARTBEAT_BASE + drive.station}
        for own, identifier in mine.items():
            purpose = next((purpose for purpose, other in taken.items()
                            if purpose != own and other == identifier), None)
            if purpose is not None:
                yield Complaint(f'{own}_cob_id', complaints.identifier_of_node(
                    identifier=identifier, purpose=purpose))

    def _check_profile(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        placement = Placement.of(drive)
        for name, parameter in drive.profile.parameters.items():
            place = f'profile.parameters.{name}'
            if parameter.index is not None and parameter.subindex is None:
                yield Complaint(f'{place}.subindex', complaints.subindex_missing(
                    most=pkw.SUBINDEX_MAX))
                continue
            address = placement.address(parameter)
            if address is None:
                key, what = ('number', 'a number') if placement.addressing == 'register' \
                    else ('index', 'an index with a subindex')
                yield Complaint(f'{place}.{key}', complaints.address_missing(
                    family=self.name, addressing=placement.addressing, what=what))
                continue
            last = Span(address, parameter.type.bits // 16).addresses[-1]
            if last.word > pkw.WORD_MAX or (last.subindex or 0) > pkw.SUBINDEX_MAX:
                yield Complaint(f'{place}.type', complaints.last_register(
                    type=parameter.type.value, address=str(address)))

    def _check_request(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        """Look for setpoints that would overwrite each other, or the control word."""
        taken: dict[addresses.Key, str] = {}
        listed = list(drive.cyclic_request)
        word = control_word(drive, controlled=True)
        if word is not None and word not in listed:
            listed.insert(0, word)
        for parameter in listed:
            mine = addresses.keys(parameter) if parameter.listed else frozenset()
            other = next((taken[key] for key in mine if key in taken), None)
            if other is not None:
                yield Complaint('cyclic_request', complaints.shared_register(
                    name=parameter.name, other=other))
            taken.update(dict.fromkeys(mine, parameter.name))
