# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The row of the family table for drives of CiA 402."""

from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Any

from drive_can_bridge.core import complaints
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Route, worst_bits
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.status_bits import STATUS_NAME
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen.addressing import (
    node_claims, object_of_name, reserved_claims, station_complaints)
from drive_can_bridge.protocols.canopen.masters import NMT_ROUTE
from drive_can_bridge.protocols.canopen.network import NODE_MAX
from drive_can_bridge.protocols.cia402 import pdo
from drive_can_bridge.protocols.cia402.options import Cia402Options, PROBED
from drive_can_bridge.protocols.cia402.pdo import PDO_MAX
from drive_can_bridge.protocols.cia402.states import (
    CONTROL_PARAMETER, CONTROL_WORD, INTERPOLATION_MAX, MODE, MODES, MOVING, state_of,
    STATUS_PARAMETER, STATUS_WORD)
from drive_can_bridge.protocols.family import (
    Claim, Complaint, Family, FamilyParts, ImportRules, ModeKey, ScanEntry)
from drive_can_bridge.protocols.observer import DriveObserver, Emit

#: s: periods of which the jitter of a process without a real-time kernel is a good part
JITTERS_BELOW = 0.005
#: s: longest event timer, and longest time of a heartbeat consumer (16 bits of ms)
TIMER_MAX = 65.535
_SETPOINTS = {(mode.index, mode.subindex) for mode in MODES.values()}
#: control word, mode, setpoints of all modes, offsets of setpoints (60B0h to 60B2h), of all axes
_COMMANDS = {index + 0x800 * axis for axis in range(8) for index in (
    CONTROL_WORD, MODE, 0x60B0, 0x60B1, 0x60B2, *(index for index, _ in _SETPOINTS))}
_LISTS = (('request_pdos', 'cyclic_request', CONTROL_PARAMETER),
          ('response_pdos', 'cyclic_response', STATUS_PARAMETER))
_HEARTBEAT = worst_bits(1, extended=False)
_SYNC = worst_bits(0, extended=False)


class Cia402(Family):
    """CiA 402: control and status word built in, PDOs at SYNC or by event, parameters by SDO."""

    name = 'cia402'
    cyclic = True
    control_built_in = True
    builtin_names = frozenset((STATUS_NAME,))
    widths = frozenset((8, 16, 32))
    options_type = Cia402Options
    mode_key = ModeKey({mode.number: name for name, mode in MODES.items()}, (
        'target_position', 'interpolation_target', 'target_velocity', 'target_torque',
        'vl_target_velocity'))
    on_canopen = True
    probed = PROBED
    scan_entry = ScanEntry('axis', 'cia402_servo', ('target_velocity',), ('actual_velocity',))
    import_rules = ImportRules(
        eds_objects=(CONTROL_WORD, STATUS_WORD), eds_profile=scan_entry.profile)

    def check(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        yield from station_complaints(drive)
        yield from self.check_names(drive)
        yield from self._check_profile(drive)
        yield from self._check_lists(drive)
        yield from self._check_mode(drive)
        yield from self._check_times(drive)

    def warnings(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        options = drive.options
        mode = MODES.get(options.mode)
        if mode is None:
            return
        for parameter in drive.cyclic_request:
            place = parameter.index, parameter.subindex or 0
            if place in _SETPOINTS and place != (mode.index, mode.subindex):
                yield Complaint('cyclic_request', complaints.setpoint_of_other_mode(
                    name=parameter.name, mode=options.mode))
        if not options.ramp_bits and options.mode != 'vl':
            yield Complaint('ramp_bits', complaints.vl_only(mode=options.mode))
        if mode.interpolated and options.transmission == 'event' and options.mode != 'ip':
            yield Complaint('transmission', complaints.interpolated_by_event(mode=options.mode))
        if drive.period < JITTERS_BELOW:
            yield Complaint('period', complaints.period_jitters(period=drive.period))
        if options.mode == 'pp' and drive.command_timeout > 0:
            yield Complaint('command_timeout', (
                complaints.pp_halts(timeout=drive.command_timeout)))

    def check_together(self, drives: Sequence[DriveConfiguration],
                       ) -> Iterator[tuple[DriveConfiguration, Complaint]]:
        """Yield contradictions between drives of one bus: SYNC period, Node-ID of the bridge."""
        in_step = [drive for drive in drives if drive.options.transmission == 'sync']
        for drive in in_step[1:]:
            first = in_step[0]
            if drive.period != first.period:
                yield drive, Complaint('period', (
                    complaints.period_of_sync(
                        period=drive.period, other=first.period, drive=first.name)))
        stations = {drive.station: drive.name for drive in drives}
        beating = [drive for drive in drives if drive.options.bridge_heartbeat > 0]
        for drive in beating:
            node, first = drive.options.bridge_node, beating[0]
            if node != first.options.bridge_node:
                yield drive, Complaint('bridge_node', (
                    complaints.bridge_node_differs(
                        node=node, other=first.options.bridge_node, drive=first.name)))
            elif node in stations and drive is first:
                yield drive, Complaint('bridge_node', (
                    complaints.node_of_drive(node=node, drive=stations[node])))

    def claims(self, drive: DriveConfiguration) -> list[Claim]:
        node, options = drive.station, drive.options
        used = {each.identifier: f'receive PDO{each.number} of node {node}'
                for each in pdo.request_pdos(drive)}
        used |= {each.identifier: f'transmit PDO{each.number} of node {node}'
                 for each in pdo.response_pdos(drive)}
        used |= {sdo.REQUEST_BASE + node: f'SDO requests to node {node}',
                 sdo.RESPONSE_BASE + node: f'SDO responses of node {node}'}
        claims = node_claims(drive, used)
        if options.transmission == 'sync':
            claims.append(_shared(network.SYNC_IDENTIFIER, 'SYNC', 'SYNC'))
        if options.bridge_heartbeat > 0:
            claims.append(_shared(network.HEARTBEAT_BASE + options.bridge_node,
                                  'heartbeats of the bridge', 'bridge heartbeat'))
        return claims

    def reserved(self, drive: DriveConfiguration) -> list[Claim]:
        return reserved_claims(drive)

    def overheard(self, drive: DriveConfiguration) -> list[Route]:
        """Return NMT: another master may restart or stop all nodes at once."""
        return [NMT_ROUTE]

    def bits_per_second(self, drive: DriveConfiguration) -> float:
        """Return the worst-case load: PDOs and SYNC once a period, and the heartbeats."""
        return self._own_load(drive) + self._shared_load([drive])

    def loads(self, drives: Sequence[DriveConfiguration]) -> list[float]:
        """Return bit/s of each drive; SYNC and the bridge's heartbeat in equal shares."""
        share = self._shared_load(drives) / len(drives) if drives else 0.0
        return [self._own_load(drive) + share for drive in drives]

    def is_command(self, parameter: Parameter) -> bool:
        return parameter.index in _COMMANDS

    def scan_keys(self, taken: Collection[int]) -> dict[str, Any]:
        """Return the highest Node-ID that no node has, for the bridge, where that is not 127."""
        free = max({*range(1, NODE_MAX + 1)} - {*taken}, default=NODE_MAX)
        return {} if free == NODE_MAX else {'bridge_node': free}

    def raw_parameter(self, drive: DriveConfiguration, name: str) -> Parameter | None:
        """Resolve ``x<index>.<sub-index>``; the drive has the width."""
        place = object_of_name(name)
        return None if place is None else Parameter(
            name=name, type=ParameterType.UINT32, index=place[0], subindex=place[1], listed=False,
            width_known=False)

    def enabled_status(self, drive: DriveConfiguration) -> tuple[Parameter, Callable[[int], bool]]:
        return STATUS_PARAMETER, lambda word: state_of(word) in MOVING

    def parts(self) -> FamilyParts:
        from drive_can_bridge.protocols.cia402.observer import Cia402Observer
        from drive_can_bridge.protocols.cia402.prober import Cia402Prober
        from drive_can_bridge.protocols.cia402.scanner import Cia402Scanner
        from drive_can_bridge.protocols.cia402.session import Cia402Session
        return FamilyParts(Cia402Session, Cia402Observer, Cia402Scanner, Cia402Prober)

    def make_sessions(self, drives: Sequence[DriveConfiguration]) -> list[Session]:
        """Make the sessions of one bus, which share SYNC and the heartbeat of the bridge."""
        from drive_can_bridge.protocols.cia402.session import make_sessions
        return make_sessions(drives)

    def make_observers(self, drives: Sequence[DriveConfiguration], emit: Emit,
                       ) -> list[DriveObserver]:
        """Make the observers of the drives, and of NMT, SYNC and heartbeats."""
        from drive_can_bridge.protocols.cia402.observer import make_observers
        return make_observers(drives, emit)

    # -- parts ------------------------------------------------------------------------------------

    def _own_load(self, drive: DriveConfiguration) -> float:
        bits = sum(worst_bits(each.length, extended=False)
                   for each in (*pdo.request_pdos(drive), *pdo.response_pdos(drive)))
        beat: float = drive.options.heartbeat_producer
        return bits / drive.period + (_HEARTBEAT / beat if beat > 0 else 0.0)

    def _shared_load(self, drives: Sequence[DriveConfiguration]) -> float:
        periods = [drive.period for drive in drives if drive.options.transmission == 'sync']
        beats = [drive.options.bridge_heartbeat for drive in drives
                 if drive.options.bridge_heartbeat > 0]
        return ((_SYNC / min(periods) if periods else 0.0)
                + (_HEARTBEAT / min(beats) if beats else 0.0))

    def _check_profile(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        foreign = any(protocol != self.name for protocol in drive.profile.protocols)
        for name, parameter in drive.profile.parameters.items():
            place = f'profile.parameters.{name}'
            if parameter.index is None:
                if not foreign:
                    yield Complaint(f'{place}.index', complaints.index_missing(family=self.name))
            elif parameter.number is not None and not foreign:
                yield Complaint(f'{place}.number', complaints.no_numbers(family=self.name))

    def _check_lists(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        taken: dict[tuple[int, int], str] = {
            (CONTROL_WORD, 0): complaints.THE_CONTROL_WORD,
            (MODE, 0): 'the mode, which the key mode gives'}
        for key, listed, first in _LISTS:
            parameters: tuple[Parameter, ...] = getattr(drive, listed)
            for parameter in parameters:
                if parameter.listed and parameter.index is None:
                    yield Complaint(listed, complaints.no_index(name=parameter.name))
                if key == 'request_pdos' and parameter.index is not None:
                    place = parameter.index, parameter.subindex or 0
                    if place in taken:
                        yield Complaint(listed, complaints.mapped_already(
                            name=parameter.name, taken=taken[place]))
                    elif pdo.is_map(parameter.index):
                        yield Complaint(listed, complaints.mapped_already(
                            name=parameter.name, taken='a mapping parameter'))
                    taken.setdefault(place, f"the same object as '{parameter.name}'")
                elif parameter.index == STATUS_WORD:
                    yield Complaint(listed, complaints.status_word_mapped(name=parameter.name))
            numbers = getattr(drive.options, key)
            if len(set(numbers)) < len(numbers):
                yield Complaint(key, complaints.pdo_twice())
            needed = len(pdo.distribute([pdo.width(each) for each in (first, *parameters)]))
            count = len(numbers) or PDO_MAX
            if needed > count:
                free = [each for each in range(1, PDO_MAX + 1) if each not in numbers]
                more = [*numbers, *free[:needed - count]]
                yield Complaint(key, complaints.pdos_too_small(
                    count=count, plural='s' * (count != 1), listed=listed, needed=needed,
                    write=f'{key}: {more}' if needed <= PDO_MAX else ''))

    def _check_mode(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        name: str | None = drive.options.mode
        if name is None:
            yield Complaint('mode', complaints.one_missing(allowed=', '.join(MODES)))
            return
        mode = MODES[name]
        setpoint = next((each for each in drive.cyclic_request if (
            each.index, each.subindex or 0) == (mode.index, mode.subindex)), None)
        if setpoint is None:
            if all(each.listed for each in drive.cyclic_request):
                yield Complaint('cyclic_request', (
                    complaints.setpoint_missing(
                        name=name, index=mode.index, subindex=mode.subindex, parameter=next((
                            each.name for each in drive.profile.parameters.values() if (
                                each.index, each.subindex or 0) == (mode.index, mode.subindex)),
                            ''))))
        elif setpoint.limit:
            yield Complaint(f'profile.parameters.{setpoint.name}.limit', (
                complaints.setpoint_limit(name=setpoint.name, mode=name)))
        elif setpoint.type is not mode.type:
            yield Complaint(f'profile.parameters.{setpoint.name}.type', (
                complaints.setpoint_type(
                    type=setpoint.type.value, name=name, wanted=mode.type.value)))
        elif mode.position and not setpoint.neutral_from:
            yield Complaint(f'profile.parameters.{setpoint.name}.neutral_from', (
                complaints.no_neutral_position(name=name)))
        if mode.interpolated and drive.period > INTERPOLATION_MAX:
            yield Complaint('mode', complaints.interpolated(name=name, most=INTERPOLATION_MAX))
        if name == 'ip' and drive.options.transmission == 'event':
            yield Complaint('transmission', complaints.ip_by_event())

    def _check_times(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        options, milliseconds = drive.options, 1000 * drive.period
        if options.transmission == 'event' and (
                abs(milliseconds - round(milliseconds)) > 1e-6 or drive.period > TIMER_MAX):
            yield Complaint('period', complaints.no_event_timer(
                period=drive.period, most=TIMER_MAX))
        if 0 < options.heartbeat_timeout <= options.heartbeat_producer:
            yield Complaint('heartbeat_timeout', (
                complaints.heartbeat_too_short(
                    timeout=options.heartbeat_timeout, producer=options.heartbeat_producer)))
        for key in ('heartbeat_producer', 'bridge_heartbeat'):
            if 0 < getattr(options, key) < 0.001:
                yield Complaint(key, complaints.time_too_short(seconds=getattr(options, key)))


def _shared(identifier: int, purpose: str, mark: str) -> Claim:
    return Claim(Route.of(identifier), f'{identifier:03X}h ({purpose})', mark, heard=False,
                 once=True)
