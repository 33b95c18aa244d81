# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Backups through the panel: the commands that a person would use, run by it.

Once in processes of their own, as it is, and all the rest on the bench.
"""

from typing import TYPE_CHECKING

from panel_builders import NEEDS_PANEL, Site, Visitors
import pytest
from waiting import wait_for

if TYPE_CHECKING:
    from panel_bench import House

pytest.importorskip('rclpy')

pytestmark = NEEDS_PANEL


def test_a_backup_goes_there_and_back_in_processes(site: Site) -> None:
    wait_for(lambda: write(site, 'ramp_time', '1.5'), 'its parameters')
    backup = site.get('/do/backup?drive=/conveyor', 'viewer')
    assert backup.status == 200, backup.text
    restored = carry(site, 'restore', 'operator', backup.body)
    assert restored['success'] is True, restored['text']


def test_a_backup_is_made_compared_and_restored(house: 'House') -> None:
    assert write(house, 'ramp_time', '1.5')
    backup = house.get('/do/backup?drive=/conveyor', 'viewer')
    assert backup.status == 200, backup.text
    assert backup.headers['content-disposition'] == 'attachment; filename="conveyor.yaml"'
    assert 'ramp_time: 1.5' in backup.text

    assert write(house, 'ramp_time', '2.5')
    differs = carry(house, 'compare', 'viewer', backup.body)
    assert differs['success'] is True
    assert 'ramp_time' in differs['text']

    restored = carry(house, 'restore', 'operator', backup.body)
    assert restored['success'] is True, restored['text']
    assert house.bridge.played['conveyor'].value('ramp_time') == 1.5
    same = carry(house, 'compare', 'viewer', backup.body)
    assert same['success'] is True
    assert 'ramp_time' not in same['text']


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig', 'utf-16'])
def test_of_another_drive_is_refused_in_words_for_a_browser(house: 'House', encoding: str) -> None:
    assert write(house, 'ramp_time', '1.5')
    text = house.get('/do/backup?drive=/conveyor', 'viewer').text
    lines = [f'# profile_sha256: {"ab" * 32}' if line.startswith('# profile_sha256') else line
             for line in text.replace('ramp_time: 1.5', 'ramp_time: 2.5').splitlines()]
    answer = carry(house, 'restore', 'operator', '\n'.join(lines).encode(encoding))
    assert answer['success'] is False
    assert str(answer['text']).splitlines()[-1].startswith('(--force: ')
    assert house.bridge.played['conveyor'].value('ramp_time') == 1.5


@pytest.mark.parametrize('body', [b'', b'\xff\xfe', b'[1, 2]', b'/conveyor: {ros__parameters: 7}'])
def test_what_is_no_backup_is_refused_in_words(house: 'House', body: bytes) -> None:
    answer = carry(house, 'restore', 'operator', body)
    assert answer['success'] is False
    assert answer['text']
    assert 'Traceback' not in answer['text']
    house.check_alive()


def write(where: Visitors, name: str, value: str) -> bool:
    """Write a parameter."""
    answer = where.do('write', 'operator', {'drive': '/conveyor', 'name': name, 'value': value})
    return bool(answer.said['success'])


def carry(where: Visitors, action: str, role: str, backup: bytes) -> dict[str, object]:
    """Upload a backup."""
    answer = where.ask('POST', f'/do/{action}?drive=/conveyor', role, {
        'Content-Type': 'application/yaml', 'Origin': f'http://{where.host}'}, backup)
    said: dict[str, object] = answer.said
    return said
