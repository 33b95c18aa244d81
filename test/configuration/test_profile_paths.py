# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Profiles by a path that is relative to the parameter file that sets it."""

from pathlib import Path
from typing import Any

from configuration_builders import at, changed, FILE, load, problems, PROFILE
import pytest

from drive_can_bridge.configuration.load import (
    configuration_from_overrides, declared_parameters)
from drive_can_bridge.configuration.parameter_file import directory_that_sets
from drive_can_bridge.core.errors import ConfigurationError

KEY = ('drives', 'conveyor', 'profile')
RELATIVE = changed(FILE, 'station: 1\n        profile: table',
                   'station: 1\n        profile: ./tables/mine.yaml')


@pytest.fixture
def place(tmp_path: Path) -> Path:
    (tmp_path / 'tables').mkdir()
    (tmp_path / 'tables' / 'mine.yaml').write_text(PROFILE)
    return tmp_path


def test_beside_the_file(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir('/')
    configuration = load(place, RELATIVE)
    # what is declared, dumped and written is the absolute path
    values = {each.name: each.value for each in declared_parameters(configuration)}
    assert values['drives.conveyor.profile'] == str(place / 'tables' / 'mine.yaml')
    assert values['drives.lift.profile'] == 'table'


def test_in_a_directory_that_everybody_may_write_to(place: Path) -> None:
    place.chmod(0o1777)
    assert problems(place, RELATIVE) == [at(
        'f.yaml:14: drives.conveyor.profile', 'open_directory', name='./tables/mine.yaml',
        meant='tables/mine.yaml')]     # without the place, as all paths there


def overrides(profile: str, place: Path, **more: Any) -> dict[str, Any]:
    return {'buses.main.interface': 'virtual', 'buses.main.channel': 'demo',
            'drives.conveyor.bus': 'main', 'drives.conveyor.protocol': 'datamodel_extended',
            'drives.conveyor.station': 1, 'drives.conveyor.profile': profile,
            'drives.conveyor.cyclic_request': ['speed'],
            'drives.conveyor.cyclic_response': ['actual'], **more}


def test_of_a_node_the_last_file_that_sets_it_counts(place: Path) -> None:
    elsewhere = place / 'elsewhere'
    elsewhere.mkdir()
    first, second, third = place / 'f.yaml', elsewhere / 'g.yaml', elsewhere / 'h.yaml'
    first.write_text(RELATIVE)
    second.write_text(RELATIVE.replace('/**/drive_can_bridge', '/other/drive_can_bridge'))
    third.write_text('/**/drive_can_bridge:\n  ros__parameters: {autostart: false}\n')
    files = [first, second, third]
    assert directory_that_sets(
        files, '/drive_can_bridge', KEY, './tables/mine.yaml') == place
    assert directory_that_sets(
        files, '/other/drive_can_bridge', KEY, './tables/mine.yaml') == elsewhere
    # by -p: no file has this value
    assert directory_that_sets(files, '/drive_can_bridge', KEY, './mine.yaml') is None
    found = configuration_from_overrides(
        overrides('./tables/mine.yaml', place), setter=lambda drive, profile: place)
    assert found.drives['conveyor'].profile_key == str(place / 'tables' / 'mine.yaml')


def test_set_by_no_file(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_overrides(overrides('tables/mine.yaml', place))
    assert caught.value.problems == [at(
        'drives.conveyor.profile', 'no_absolute_path', name='tables/mine.yaml',
        meant=f'{place}/tables/mine.yaml')]


def test_a_file_that_is_not_there(place: Path) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load(place, RELATIVE.replace('mine.yaml', 'yours.yaml'))
    assert f'no file {place}/tables/yours.yaml, allowed is an existing one' in str(caught.value)

