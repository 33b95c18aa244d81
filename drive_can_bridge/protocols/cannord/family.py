# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The row of the family table for CANnord, the protocol of NORD inverters."""

from collections.abc import Iterator, Sequence
import re

from drive_can_bridge.core import complaints
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Route, worst_bits
from drive_can_bridge.core.parameters import Parameter, ParameterType, Storage
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.status_bits import STATUS_NAME
from drive_can_bridge.protocols.cannord.identifiers import (
    ADDRESS_MAX, broadcast_identifier, broadcasts, groups, identifier, MessageObject)
from drive_can_bridge.protocols.cannord.monitoring import TIMEOUT_NUMBER, timeout_parameter
from drive_can_bridge.protocols.cannord.options import CannordOptions, PROBED
from drive_can_bridge.protocols.cannord.parameter_frame import INDEX_MAX, NUMBER_MAX
from drive_can_bridge.protocols.cannord.process_data import (
    EXTRA_LENGTH, EXTRA_VALUES, main_length, MAIN_VALUES)
from drive_can_bridge.protocols.family import (
    Claim, Complaint, Family, FamilyParts, out_of_range, ScanEntry)
from drive_can_bridge.protocols.observer import DriveObserver, Emit

#: s that an inverter takes at most to answer process data (BU 0060 page 50)
ANSWER_TIME = 0.003
_RAW_NAME = re.compile(r'p([0-9]{1,4})(?:\.([0-9]{1,3}))?', re.ASCII)
_PURPOSES = {
    MessageObject.PROCESS_REQUEST: 'process data to station',
    MessageObject.PROCESS_RESPONSE: 'process data from station',
    MessageObject.PARAMETER_TASK: 'parameter tasks to station',
    MessageObject.PARAMETER_RESPONSE: 'parameter responses from station',
}
#: keys that decide what the common frames of a broadcast group look like, and how often they come
_COMMON_OPTIONS = ('swap_setpoints_2_3', 'extra_setpoints', 'parameter_set')
#: of a setpoint: what makes the same word mean the same, and which words may be sent
_COMMON_SCALES = ('type', 'scale', 'offset', 'unit')
_COMMON_WORDS = ('raw_limits', 'neutral_raw')
_COMMANDS = ('position_command', 'velocity_command', 'effort_command')


def _placeable(drives: Sequence[DriveConfiguration]) -> list[DriveConfiguration]:
    """Return the drives whose station exists; for the others there are no identifiers."""
    return [drive for drive in drives if 0 <= drive.station <= ADDRESS_MAX]


class Cannord(Family):
    """CANnord: control and status word built in, up to five values each way, parameter tasks."""

    name = 'cannord'
    cyclic = True
    control_built_in = True
    builtin_names = frozenset((STATUS_NAME,))
    options_type = CannordOptions
    probed = PROBED
    scan_entry = ScanEntry('inverter', 'nord_sk500e', ('frequency_setpoint',),
                           ('actual_frequency',))

    def check(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        yield from out_of_range('station', drive.station, 0, ADDRESS_MAX, f' ({self.name})')
        yield from self._check_lists(drive)
        yield from self.check_names(drive)
        yield from self._check_profile(drive)

    def check_together(self, drives: Sequence[DriveConfiguration],
                       ) -> Iterator[tuple[DriveConfiguration, Complaint]]:
        """Yield in what drives of a broadcast group differ from the one that leads them."""
        yield from self._check_kinds(drives)
        for leader, *members in groups(_placeable(drives)):
            for member in members:
                for complaint in self._differences(leader, member):
                    yield member, complaint

    def warnings(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        if drive.period < ANSWER_TIME:
            yield Complaint('period', complaints.inverters_are_slow(
                period=drive.period, answer=1000.0 * ANSWER_TIME, least=ANSWER_TIME))

    def claims(self, drive: DriveConfiguration) -> list[Claim]:
        """Return all identifiers of the drive on its bus; a broadcast one is shared."""
        extended = drive.options.extended_identifiers
        found = [Claim(Route.of(identifier(kind, drive.station, extended=extended),
                             extended=extended), f'{purpose} {drive.station}')
                 for kind, purpose in _PURPOSES.items()]
        broadcast = broadcast_identifier(drive)
        if broadcast is not None:
            found.append(Claim(Route.of(broadcast, extended=extended), 'broadcast process data',
                               shared='cannord broadcast', heard=False, once=True))
        return found

    def overheard(self, drive: DriveConfiguration) -> list[Route]:
        """Return both broadcasts: an inverter that is set to listen obeys both."""
        extended = drive.options.extended_identifiers
        return [Route.of(each, extended=extended) for each in broadcasts(
            drive.station, extended=extended)]

    def bits_per_second(self, drive: DriveConfiguration) -> float:
        """Return the worst-case load of an exchange of its own every period."""
        return 2 * self._telegram_bits(drive) / drive.period

    def loads(self, drives: Sequence[DriveConfiguration]) -> list[float]:
        """Return the load of each drive; those of a group share one exchange a period."""
        found = {drive.name: self.bits_per_second(drive) for drive in drives}
        for group in groups(_placeable(drives)):
            # a broadcast and one exchange for all of them, as long as the longest lists want
            most = max(map(self.bits_per_second, group))
            found.update({drive.name: 1.5 * most / len(group) for drive in group})
        return [found[drive.name] for drive in drives]

    def raw_parameter(self, drive: DriveConfiguration, name: str) -> Parameter | None:
        """Resolve ``p<number>`` and ``p<number>.<sub-index>``; the drive has the width."""
        match = _RAW_NAME.fullmatch(name)
        if match is None:
            return None
        number = int(match.group(1))
        subindex = None if match.group(2) is None else int(match.group(2))
        if number > NUMBER_MAX or (subindex or 0) > INDEX_MAX:
            return None
        return Parameter(name=name, type=ParameterType.UINT32, number=number, subindex=subindex,
                         listed=False, width_known=False)

    def supervision(self, drive: DriveConfiguration) -> Parameter | None:
        return timeout_parameter(drive.profile) or self.raw_parameter(
            drive, f'p{TIMEOUT_NUMBER}')

    def parts(self) -> FamilyParts:
        from drive_can_bridge.protocols.cannord.observer import CannordObserver
        from drive_can_bridge.protocols.cannord.prober import CannordProber
        from drive_can_bridge.protocols.cannord.scanner import CannordScanner
        from drive_can_bridge.protocols.cannord.session import CannordSession
        return FamilyParts(CannordSession, CannordObserver, CannordScanner, CannordProber)

    def make_sessions(self, drives: Sequence[DriveConfiguration]) -> list[Session]:
        from drive_can_bridge.protocols.cannord.session import make_group
        made: dict[str, Session] = {
            session.configuration.name: session for group in groups(drives)
            for session in make_group(group)}
        return [made.get(drive.name) or self.parts().session(drive) for drive in drives]

    def make_observers(self, drives: Sequence[DriveConfiguration], emit: Emit,
                       ) -> list[DriveObserver]:
        """Make what watches inverters; of a broadcast group, the leader's watches broadcasts."""
        from drive_can_bridge.protocols.cannord.observer import CannordObserver
        leaders = {group[0].name for group in groups(drives)}
        own = {broadcast_identifier(drive) for drive in drives}
        return [CannordObserver(
            drive, emit, leads=drive.name in leaders,
            foreign={route.identifier for route in self.overheard(drive)} - own)
            for drive in drives]

    # -- parts ------------------------------------------------------------------------------------

    def _telegram_bits(self, drive: DriveConfiguration) -> int:
        """Return the worst-case length of the process frames in one direction."""
        extended = drive.options.extended_identifiers
        values = max(len(drive.cyclic_request), len(drive.cyclic_response))
        bits = worst_bits(main_length(min(values, MAIN_VALUES)), extended=extended)
        if values > MAIN_VALUES:
            bits += worst_bits(EXTRA_LENGTH, extended=extended)
        return bits

    def _check_kinds(self, drives: Sequence[DriveConfiguration],
                     ) -> Iterator[tuple[DriveConfiguration, Complaint]]:
        """Yield drives of both kinds of broadcast on one bus: inverters obey both."""
        everyone = [drive for drive in drives if drive.options.broadcast != 'none']
        for drive in everyone[1:]:
            mine = drive.options.broadcast
            other = everyone[0].options.broadcast
            if mine != other:
                yield drive, Complaint('broadcast', (
                    complaints.both_broadcasts(mine=mine, drive=everyone[0].name, other=other)))

    def _check_lists(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        extra = drive.options.extra_setpoints
        largest = MAIN_VALUES + EXTRA_VALUES if extra else MAIN_VALUES
        more = '' if extra else f' ({MAIN_VALUES + EXTRA_VALUES} with extra_setpoints: true)'
        for key in ('cyclic_request', 'cyclic_response'):
            listed: tuple[Parameter, ...] = getattr(drive, key)
            if len(listed) > largest:
                yield Complaint(key, complaints.too_many_parameters(
                    count=len(listed), most=largest, more=more))
            for parameter in listed:
                if parameter.type.bits == 32:
                    yield Complaint(key, complaints.not_16_bits(
                        name=parameter.name, type=parameter.type.value))

    def _check_profile(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        foreign = any(protocol != self.name for protocol in drive.profile.protocols)
        for name, parameter in drive.profile.parameters.items():
            place = f'profile.parameters.{name}'
            yield from out_of_range(f'{place}.number', parameter.number or 0, 0, NUMBER_MAX)
            yield from out_of_range(f'{place}.subindex', parameter.subindex or 0, 0, INDEX_MAX)
            if parameter.number is None and not foreign:
                yield from self._check_unnumbered(place, parameter)

    def _check_unnumbered(self, place: str, parameter: Parameter) -> Iterator[Complaint]:
        """Check an entry that exists in process data only."""
        if parameter.subindex is not None:
            yield Complaint(f'{place}.subindex', complaints.subindex_alone())
        if parameter.storage is Storage.EEPROM:
            yield Complaint(f'{place}.storage', complaints.process_data_stored())
        if parameter.type.bits == 32:
            yield Complaint(f'{place}.type', complaints.no_process_word(type=parameter.type.value))

    def _differences(self, leader: DriveConfiguration, member: DriveConfiguration,
                     ) -> Iterator[Complaint]:
        led = f'drive {leader.name}, which leads its broadcast group'
        if [parameter.name for parameter in member.cyclic_request] != [
                parameter.name for parameter in leader.cyclic_request]:
            yield Complaint('cyclic_request', complaints.request_differs(leader=led))
        else:
            for mine, other in zip(member.cyclic_request, leader.cyclic_request):
                if any(getattr(mine, key) != getattr(other, key) for key in _COMMON_SCALES):
                    yield Complaint('cyclic_request', complaints.type_differs(
                        name=mine.name, leader=led))
                elif any(getattr(mine, key) != getattr(other, key) for key in _COMMON_WORDS):
                    yield Complaint('cyclic_request', complaints.range_differs(
                        name=mine.name, leader=led))
                elif mine.limit is not other.limit:
                    yield Complaint('cyclic_request', complaints.limit_differs(
                        name=mine.name, leader=led))
        if member.period != leader.period:
            yield Complaint('period', complaints.period_differs(
                period=member.period, other=leader.period, leader=led))
        for key in _COMMON_OPTIONS:
            mine, other = getattr(member.options, key), getattr(leader.options, key)
            if mine != other:
                yield Complaint(key, complaints.option_differs(
                    value=str(mine).lower(), other=str(other).lower(), leader=led))
        for key in _COMMANDS:
            if member.joint is not None and getattr(member.joint, key) is not None:
                yield Complaint(f'joint.{key}', complaints.led_by_other(leader=led))
