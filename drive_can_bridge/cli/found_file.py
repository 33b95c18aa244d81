# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a scan found as a parameter file, with tables of raw parameters where none is known."""

from collections.abc import Sequence
import json
from pathlib import Path
import re
from typing import Any

from drive_can_bridge.cli.whole_file import write_whole
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.protocols.scout import Sighting

#: shipped tables for families of one maker, and an exchange that all their drives know
_KNOWN = {
    'cannord': ('inverter', 'nord_sk500e', ['frequency_setpoint'], ['actual_frequency']),
    'canopen_pkw': ('starter', 'tesys_t_ltmr', [], ['system_status_1']),
    'cia402': ('axis', 'cia402_servo', ['target_velocity'], ['actual_velocity']),
}
_HEAD = """\
# Found by drive_can scan. Look it over before a bridge runs with it: profiles are the shipped ones
# where there is one, and otherwise tables of raw numbers beside this file, without units.
"""
#: families without a known table -> what their drives are called
_UNKNOWN = {'datamodel_extended': 'drive', 'datamodel_standard': 'drive_std'}


def tables_beside(path: Path) -> list[Path]:
    """Return the tables there are that a parameter file of this name may be written with."""
    table = re.compile(rf'{re.escape(path.stem)}_(?:{"|".join(_UNKNOWN.values())})_[0-9]+\.yaml')
    return sorted(each for each in path.parent.glob('*.yaml') if table.fullmatch(each.name))


def write_parameter_file(path: Path, bus: BusConfiguration, sightings: Sequence[Sighting],
                         settings: Sequence[dict[str, Any]]) -> list[Path]:
    """
    Write a parameter file that ``validate`` accepts, after the tables that it names.

    :param sightings: at least one.
    :param settings: for each sighting, what its scout knows.
    :return: the files written.
    :raises OSError: they cannot be written.
    """
    written = [path]
    # so slow that all of them fit the bus
    period = max(0.05, 0.01 * len(sightings))
    lines = [_HEAD, '/**/drive_can_bridge:', '  ros__parameters:', '    buses:', '      main:',
             f'        interface: {bus.interface}', f'        channel: {json.dumps(bus.channel)}',
             f'        bitrate: {bus.bitrate}', '    drives:']
    for sighting, keys in zip(sightings, settings):
        if sighting.protocol in _KNOWN:
            kind, profile, request, response = _KNOWN[sighting.protocol]
        else:
            kind = _UNKNOWN[sighting.protocol]
            table = path.with_name(f'{path.stem}_{kind}_{sighting.station}.yaml').absolute()
            request = [f'parameter_{number}' for number in keys['request_numbers']]
            response = [f'parameter_{number}' for number in keys['response_numbers']]
            _write_table(table, sighting, keys)
            written.append(table)
            profile = str(table)
            lines += [f'      # {remark}' for remark in keys.get('remarks', ())]
        lines += [f'      {kind}_{sighting.station}:   # {sighting.text}', '        bus: main',
                  f'        protocol: {sighting.protocol}',
                  f'        station: {sighting.station}',
                  f'        profile: {json.dumps(profile)}',
                  f'        period: {period:g}', f'        cyclic_request: [{", ".join(request)}]',
                  f'        cyclic_response: [{", ".join(response)}]']
        lines += [f'        mode: {keys["mode"]}'] if 'mode' in keys else []
    _write(path, lines)
    return written


def _write_table(path: Path, sighting: Sighting, keys: dict[str, Any]) -> None:
    lines = [f'description: Raw parameters of station {sighting.station}, found by a scan',
             f'protocols: [{sighting.protocol}]', 'parameters:']
    entries = dict.fromkeys(keys['response_numbers'], 'access: ro')
    entries.update(dict.fromkeys(keys['request_numbers'], 'access: rw, storage: ram'))
    lines += [f'  parameter_{number}: {{number: {number}, type: uint16, {entry}}}'
              for number, entry in sorted(entries.items())]
    if not entries:
        lines[-1] = 'parameters: {}'
    _write(path, lines)


def _write(path: Path, lines: Sequence[str]) -> None:
    write_whole(path, ('\n'.join(lines) + '\n').encode('utf-8'))
