# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the shipped profiles say about themselves."""

from pathlib import Path
import re
import runpy

import pytest
import yaml

from drive_can_bridge.core.profile import RestoreStep
from drive_can_bridge.profiles.catalogue import check
from drive_can_bridge.protocols.canopen_pkw.addresses import object_of
from drive_can_bridge.resources import profiles_directory, share_directory

PROFILES = sorted(profiles_directory().glob('*.yaml'))
LTMR = check(profiles_directory() / 'tesys_t_ltmr.yaml')
NORD = check(profiles_directory() / 'nord_sk500e.yaml')


def keys_of(source: str) -> list[str]:
    """Return the keys that a source names: the words before commas and brackets."""
    return [part.strip() for part in re.sub(r'\([^)]*\)', '', source).split(',')]


@pytest.mark.parametrize('path', PROFILES, ids=lambda path: path.stem)
def test_is_right_for_all_its_protocols(path: Path) -> None:
    checked = check(path)
    assert (checked.problems, checked.warnings) == ((), ())


@pytest.mark.parametrize('path', PROFILES, ids=lambda path: path.stem)
def test_every_entry_names_sources_that_are_there(path: Path) -> None:
    document = yaml.safe_load(path.read_text(encoding='utf-8'))
    used = set()
    for name, entry in document['parameters'].items():
        keys = keys_of(entry['source']) if 'source' in entry else []
        assert set(keys) <= set(document['sources']), name
        used |= set(keys)
    # those that no entry names say where all addresses come from, or how they are built
    assert set(document['sources']) - used <= {'register_map'}


@pytest.mark.parametrize('path', PROFILES, ids=lambda path: path.stem)
def test_trust_is_in_keys_and_not_in_words(path: Path) -> None:
    document = yaml.safe_load(path.read_text(encoding='utf-8'))
    for name, entry in document['parameters'].items():
        assert 'verified' not in entry.get('description', '').lower(), name
        if entry.get('verified') is False:
            assert entry['open'], name
        if 'source' not in entry:
            assert entry['verified'] is False, name


def test_page_is_up_to_date() -> None:
    """To write it anew: ``.venv/bin/python docs/profile_provenance.py``."""
    script = runpy.run_path(str(share_directory() / 'docs' / 'profile_provenance.py'))
    page = (share_directory() / 'docs' / script['PAGE']).read_text(encoding='utf-8')
    assert page == script['trust_page'](profiles_directory())


def test_registers_of_the_ltmr_stand_where_the_vendor_says() -> None:
    for parameter in LTMR.loaded.profile.parameters.values():
        assert parameter.number is not None
        assert (parameter.index, parameter.subindex) == object_of(parameter.number)


@pytest.mark.parametrize(('name', 'number', 'unit', 'scale', 'verified'), [
    ('trip_register_3', 454, '', 1.0, True),
    ('average_current', 500, 'A', 0.01, True),
    ('maximum_full_load_current', 96, 'A', 0.1, True),
    ('controller_firmware', 76, '', 1.0, True),
    ('network_port_firmware', 62, '', 1.0, True),
    ('operating_time', 119, 's', 1.0, True),
    ('highest_controller_temperature', 121, 'degC', 1.0, True),
    ('l1_current_ratio', 467, '%', 1.0, False),
    ('thermal_capacity', 465, '%', 1.0, False),
])
def test_ltmr(name: str, number: int, unit: str, scale: float, verified: bool) -> None:
    found = LTMR.loaded.profile.parameters[name]
    assert (found.number, found.unit, found.scale, found.verified) == (
        number, unit, scale, verified)


def test_ltmr_trip_register_2_has_all_bits() -> None:
    assert [position for _, position in LTMR.loaded.profile.parameters['trip_register_2'].bits] \
        == list(range(16))


def test_ltmr_identity_and_restore() -> None:
    profile = LTMR.loaded.profile
    numbers = [profile.parameters[name].number for name in profile.identity]
    assert numbers == [64, 65, 66, 67, 68, 69, 70, 71, 72, 73, 74, 76, 62]
    assert profile.restore.before == (RestoreStep('general_configuration', bits=1, mask=1),)
    assert profile.restore.after == (RestoreStep('general_configuration', bits=0, mask=1),)
    assert profile.parameters['general_configuration'].number == 601
    assert {name for name, each in profile.parameters.items() if each.protected} == {
        'control_register_2', 'network_baud_rate', 'network_address'}


@pytest.mark.parametrize(('name', 'number', 'subindex', 'unit', 'scale'), [
    ('acceleration_time', 102, None, 's', 0.01), ('deceleration_time', 103, None, 's', 0.01),
    ('deceleration_time_set_4', 103, 3, 's', 0.01), ('minimum_frequency', 104, None, 'Hz', 0.1),
    ('maximum_frequency', 105, None, 'Hz', 0.1), ('maximum_frequency_set_2', 105, 1, 'Hz', 0.1),
    ('fault_code', 700, 0, '', 0.1), ('data_base_version', 742, None, '', 1.0),
])
def test_nord(name: str, number: int, subindex: int | None, unit: str, scale: float) -> None:
    found = NORD.loaded.profile.parameters[name]
    assert (found.number, found.subindex, found.unit, found.scale, found.verified) == (
        number, subindex, unit, scale, True)


def test_nord_identity_and_what_cuts_off_the_bus() -> None:
    profile = NORD.loaded.profile
    assert profile.identity == ('data_base_version',)
    assert {name for name, each in profile.parameters.items() if each.protected} == {
        'control_source', 'can_baud_rate', 'can_address', 'drive_profile'}
