# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The family table's row of the DataModel protocol with 29-bit identifiers."""

from dataclasses import replace
from pathlib import Path

from builders import CONTROL, drive as configured, parameter, SPEED, WORD
from configuration_builders import load
import pytest
from saying import says

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import AccessMode, ParameterType, ValueKind
from drive_can_bridge.protocols.datamodel.extended import encode_read_request, encode_write
from drive_can_bridge.protocols.datamodel.family import DataModelExtended
from drive_can_bridge.protocols.families import FAMILIES

FAMILY = DataModelExtended()


@pytest.fixture
def drive(tmp_path: Path) -> DriveConfiguration:
    return load(tmp_path).drives['conveyor']


def with_options(drive: DriveConfiguration, **options: object) -> DriveConfiguration:
    return replace(drive, options=replace(drive.options, **options))


def test_claims_are_all_frames_of_the_station(drive: DriveConfiguration) -> None:
    (claim,) = FAMILY.claims(drive)
    assert claim.route == (0x00200000, 0x0FE00000, True)
    frames = [Frame(0x003FFFF0, bytes(8), True), encode_read_request(1, 122, 4),
              encode_write(1, 0x1234, [5])]
    for frame in frames:
        assert claim.route.matches(frame)
        assert claim.route.matches(Frame(frame.identifier | 0x10000000, frame.data, True))
    assert not claim.route.matches(Frame(0x005FFFF0, bytes(8), True))
    assert not claim.route.matches(Frame(0x200, b'', False))


def test_claims_collide_with_the_same_station_only(drive: DriveConfiguration) -> None:
    (own,) = FAMILY.claims(drive)
    for station in range(1, 128):
        (other,) = FAMILY.claims(replace(drive, station=station))
        assert own.overlaps(other) == (station == 1)


@pytest.mark.parametrize(('period', 'mapping', 'bits'), [
    (0.02, 'assume', 16000.0), (0.02, 'verify', 16640.0), (0.02, 'configure', 16640.0),
    (0.005, 'assume', 64000.0), (1.0, 'verify', 960.0)])
def test_load(drive: DriveConfiguration, period: float, mapping: str, bits: float) -> None:
    drive = with_options(replace(drive, period=period), mapping=mapping)
    assert FAMILY.bits_per_second(drive) == pytest.approx(bits)


@pytest.mark.parametrize(('offset', 'name', 'number'), [
    (0, 'p0', 0), (0, 'p30', 30), (0, 'p030', 30), (0, 'p65534', 65534),
    *((0, name, None) for name in (
        '', 'p', 'p65536', 'p123456', 'p-1', 'P30', 'p30.1', 'x1000.1', 'speed', 'p1 ', 'p٣',
        'pp1')),
    (-1, 'p0', None), (-1, 'p65536', None), (-1, 'p1', 1),
    # on the wire it would be the number that marks cyclic telegrams
    (1, 'p65534', None), (1, 'p65533', 65533)])
def test_raw_names(drive: DriveConfiguration, offset: int, name: str, number: int | None) -> None:
    found = FAMILY.raw_parameter(with_options(drive, parameter_offset=offset), name)
    assert (found and found.number) == number
    assert found is None or (found.name, found.type, found.scaled, found.storage, found.listed,
                             found.access, found.kind) == (
        name, ParameterType.UINT16, False, None, False, AccessMode.READ_WRITE, ValueKind.INTEGER)


@pytest.mark.parametrize('offset', [-123, 65532])
def test_maps_moved_out_of_range(drive: DriveConfiguration, offset: int) -> None:
    found = [(complaint.key, complaint.message) for complaint in FAMILY.check(
        with_options(drive, parameter_offset=offset))]
    assert ('request_map_base', says('map_out_of_range', base=122, offset=offset)) in found


@pytest.mark.parametrize('family', ['datamodel_extended', 'datamodel_standard'])
def test_an_alias_of_the_control_word_is_no_setpoint(family: str) -> None:
    alias = parameter('raw_word', WORD.number)
    for request, told in (((SPEED, alias), ['raw_word']), ((alias, WORD), ['control_word']),
                          ((SPEED, WORD), []), ((SPEED,), [])):
        found = [complaint.message for complaint in FAMILIES[family].check(configured(
            protocol=family, control=CONTROL, request=request))]
        assert [each.fields['name'] for each in found if each.code == 'same_number'] == told
