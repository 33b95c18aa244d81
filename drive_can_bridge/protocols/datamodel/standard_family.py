# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The row of the family table for the DataModel protocol with 11-bit identifiers."""

from collections.abc import Iterator, Sequence
from typing import Any

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Route, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.datamodel import standard_round
from drive_can_bridge.protocols.datamodel.common_family import COMMON_OPTIONS, DataModelFamily
from drive_can_bridge.protocols.datamodel.standard import REQUEST_ID_BASE, RESPONSE_ID_BASE
from drive_can_bridge.protocols.family import Claim, Complaint
from drive_can_bridge.protocols.observer import DriveObserver, Emit
from drive_can_bridge.protocols.scout import Scout

_BASES = ('request_id_base', 'response_id_base')
_DIRECTION = {'request_id_base': 'request', 'response_id_base': 'response'}


class DataModelStandard(DataModelFamily):
    """DataModel, 11-bit identifiers: single reads and writes, from which an exchange is made."""

    name = 'datamodel_standard'
    cyclic = False
    options_schema: dict[str, Any] = {
        **COMMON_OPTIONS,
        'request_id_base': {
            'description': 'CanStdRxIDbase of the drive; plus station it is the identifier of '
                           'requests.',
            'type': 'integer', 'minimum': 0, 'maximum': STANDARD_IDENTIFIER_MAX - 1,
            'default': REQUEST_ID_BASE,
        },
        'response_id_base': {
            'description': 'CanStdTxIDbase of the drive; plus station it is the identifier of '
                           'responses.',
            'type': 'integer', 'minimum': 0, 'maximum': STANDARD_IDENTIFIER_MAX - 1,
            'default': RESPONSE_ID_BASE,
        },
        'quarantine': {
            'description': 's of silence after a read that was not answered: a late answer does '
                           'not say what it answers.',
            'type': 'number', 'minimum': 0.0, 'maximum': 60.0, 'default': 0.1,
        },
        'refresh_interval': {
            'description': 's after which unchanged cyclic_request values are written again; '
                           '0: only on change.',
            'type': 'number', 'minimum': 0.0, 'maximum': 3600.0, 'default': 0.5,
        },
    }

    def claims(self, drive: DriveConfiguration) -> list[Claim]:
        """Return both identifiers of the drive."""
        found = []
        for base in _BASES:
            identifier = drive.family_options[base] + drive.station
            # one that does not fit is refused as such: it must not look like another one
            if 0 <= identifier <= STANDARD_IDENTIFIER_MAX:
                found.append(Claim(Route(identifier, STANDARD_IDENTIFIER_MAX, False),
                                   f'11-bit identifier {identifier:03X}h'))
        return found

    def bits_per_second(self, drive: DriveConfiguration) -> float:
        """Return the worst-case load: a round of reads and every setpoint, each period."""
        return standard_round.FRAME_BITS * standard_round.frames(drive) / drive.period

    def shortest_period(self, drive: DriveConfiguration, bitrate: int) -> float:
        """Return the time of a round of reads in which every setpoint changes."""
        return standard_round.shortest_period(drive, bitrate)

    def make_session(self, drive: DriveConfiguration) -> Session:
        """Make the drive's session. Nothing is sent before ``activate``."""
        # Imported late: configuration checks read this table without any need of sessions.
        from drive_can_bridge.protocols.datamodel.standard_session import StandardSession
        return StandardSession(drive)

    def make_observers(self, drives: Sequence[DriveConfiguration], emit: Emit,
                       ) -> list[DriveObserver]:
        """Make what watches drives."""
        from drive_can_bridge.protocols.datamodel.observer import StandardObserver
        return [StandardObserver(drive, emit) for drive in drives]

    def make_scout(self) -> Scout:
        """Make what looks for drives of this family."""
        from drive_can_bridge.protocols.datamodel.scout import StandardScout
        return StandardScout()

    # -- parts of the check -----------------------------------------------------------------------

    def _check_station(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        options = drive.family_options
        highest = STANDARD_IDENTIFIER_MAX - max(options[base] for base in _BASES)
        if drive.station < 1:
            yield Complaint('station', f'{drive.station} is out of range, '
                                       f'allowed is 1 to {highest} ({self.name})')
        for base in _BASES:
            identifier = options[base] + drive.station
            if identifier > STANDARD_IDENTIFIER_MAX:
                yield Complaint(
                    'station', f'{drive.station} is out of range: the identifier of '
                    f'{_DIRECTION[base]}s, {options[base]:X}h + {drive.station} = '
                    f'{identifier:X}h, does not fit 11 bits; allowed is 1 to {highest} with these '
                    f'bases')
                break
        if options[_BASES[0]] == options[_BASES[1]]:
            yield Complaint('response_id_base', f'{options[_BASES[1]]} is request_id_base, too: '
                                                'allowed are bases that differ')
