# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the overview shows of many drives, of few, and of those of a silent bridge."""

from typing import Any

import pytest

from drive_can_bridge.clock import time_of_day
from drive_can_bridge.monitor.snapshot import (
    BridgeSnapshot, DriveSnapshot, Level, LogLine, Place, Snapshot,
)
from drive_can_bridge.monitor.summary import silence
from drive_can_bridge.monitor.values import ParameterInfo
from drive_can_bridge.panel.access import PanelRole

pytest.importorskip('nicegui', reason="needs the extra 'panel'")

BRIDGE = '/drive_can_bridge'
STATES = {
    'online': (Level.OK, 'online'), 'disabled': (Level.OK, 'disabled: call ~/enable'),
    'offline': (Level.STALE, 'not seen since start'),
    'not armed': (Level.WARN, 'not armed: publish 0 to /{}/command/speed')}
HIDDEN = 'hidden-now'


def seen(*states: str, silent: bool = False) -> Snapshot:
    drives = []
    for number, state in enumerate(states):
        name = f'axis_{number}'
        level, advice = STATES[state]
        drives.append(DriveSnapshot(
            f'/{name}', name, BRIDGE, 'unknown' if silent else state, level,
            state != 'offline' and not silent, advice.format(name), silent=silent,
            facts={'control_state': 'enabled'}))
    return Snapshot(1000.0, (BridgeSnapshot(BRIDGE, 7.0 if silent else 0.0),),
                    drives=tuple(drives))


def shown(page: Any, kind: str) -> list[Any]:
    """Return the elements of a class, as they are in the page."""
    return [each for each in page.elements.values() if kind in each.classes]


def texts(page: Any, kind: str) -> list[str]:
    return [''.join(getattr(each, 'text', '') for each in found.descendants(include_self=True))
            for found in shown(page, kind)]


def overview(snapshot: Snapshot, role: PanelRole = PanelRole.OPERATOR) -> Any:
    from drive_can_bridge.panel.pages import Overview
    made = Overview(role, 'ROS domain 7')
    made.show(snapshot)
    return made


def test_six_are_cards_and_seven_are_rows_the_worst_first(page: Any) -> None:
    made = overview(seen('online', 'disabled', 'not armed', 'online', 'online', 'offline'))
    assert (len(shown(page, 'card')), len(shown(page, 'drive-row'))) == (6, 0)
    made.show(seen('online', 'disabled', 'not armed', 'not armed', 'online', 'online', 'offline'))
    assert len(shown(page, 'card')) == 0
    rows = sorted(shown(page, 'drive-row'), key=lambda row: int(row.style['order']))
    assert [row.props['data-drive'] for row in rows] == [
        f'/axis_{number}' for number in (6, 2, 3, 1, 0, 4, 5)]
    assert [set(row.classes) & {'ok', 'off', 'warn', 'error', 'unknown'} for row in rows] == [
        {'error'}, {'warn'}, {'warn'}, {'off'}, {'ok'}, {'ok'}, {'ok'}]
    assert texts(page, 'count') == ['1 offline', '2 not armed', '1 disabled', '3 online']
    assert texts(page, 'trouble') == [
        'axis_6: not seen since start',
        '2 drives not armed: publish 0 to /\N{HORIZONTAL ELLIPSIS}/command/speed (axis_2, axis_3)']
    # one gets worse: it goes up, and no row is made anew, somebody may be about to click
    made.show(seen('offline', 'disabled', 'not armed', 'not armed', 'online', 'online', 'offline'))
    assert set(shown(page, 'drive-row')) == set(rows)
    assert [row.style['order'] for row in rows] == ['1', '2', '3', '4', '0', '5', '6']


def test_equal_advice_stands_once_above_cards(page: Any) -> None:
    overview(seen('not armed', 'not armed', 'offline'))
    assert len(texts(page, 'trouble')) == 1
    assert sum('publish 0' in text for text in texts(page, 'card')) == 0
    assert sum('not seen' in text for text in texts(page, 'card')) == 1


def test_many_are_filtered(page: Any) -> None:
    made = overview(seen(*['online'] * 6, 'not armed', 'not armed'))

    def left() -> list[str]:
        return [row.props['data-drive'] for row in shown(page, 'drive-row')
                if HIDDEN not in row.classes]
    made._filter.set_value('armed')
    assert left() == ['/axis_6', '/axis_7']
    made._filter.set_value('armed AXIS_7')
    assert left() == ['/axis_7']
    made._filter.set_value('')
    assert len(left()) == 8


@pytest.mark.parametrize(('count', 'kind'), [(2, 'card'), (7, 'drive-row')])
def test_stops_of_a_silent_bridge_are_there(page: Any, count: int, kind: str) -> None:
    made = overview(seen(*['online'] * count))
    for silent in (False, True, False):
        made.show(seen(*['online'] * count, silent=silent))
        assert ['disabled' in each.props for each in shown(page, 'danger')] == [False] * 2 * count
        assert {'unknown' in each.classes for each in shown(page, kind)} == {silent}


@pytest.mark.parametrize(('count', 'kind'), [(2, 'advice'), (7, 'why')])
def test_what_is_grey_says_why(page: Any, count: int, kind: str) -> None:
    made = overview(seen(*['online'] * count))
    assert not any('silent' in text for text in texts(page, kind))
    made.show(seen(*['online'] * count, silent=True))
    assert texts(page, kind) == [f'its bridge is silent since {time_of_day(993.0)}'] * count
    made.show(seen(*['online'] * count))
    assert not any('silent' in text for text in texts(page, kind))


def test_bits_stand_by_number_and_those_without_a_name_are_folded(page: Any) -> None:
    from drive_can_bridge.panel.drive_page import _make_lamps
    info = ParameterInfo('status_word', facts={'bits': '0:ready 3:fault 8:bit_8 9:remote'})
    drive = DriveSnapshot(
        '/axis', 'axis', BRIDGE, 'online', Level.OK, True, '', parameters=(info,),
        bits={'status_word': {'remote': True, 'bit_12': True, 'fault': False, 'unheard_of': True,
                              'bit_8': False, 'ready': True}})
    bits = drive.bits_of('status_word')
    assert [(bit.number, bit.name) for bit in bits] == [
        (0, 'ready'), (3, 'fault'), (8, 'bit_8'), (9, 'remote'), (12, 'bit_12'),
        (None, 'unheard_of')]
    looks = _make_lamps((('', tuple((bit.number, bit.name, bit.named) for bit in bits)),))
    assert len(looks) == len(bits)
    folded, = texts(page, 'folded')
    assert folded == '2 bits without a name812'
    assert texts(page, 'lamp') == ['0 ready', '3 fault', '8', '9 remote', '12', 'unheard_of']


def test_bits_that_no_descriptor_numbers_are_known_of_the_family(page: Any) -> None:
    drive = DriveSnapshot(
        '/axis', 'axis', BRIDGE, 'online', Level.OK, True, '', place=Place(protocol='cia402'),
        bits={'status_word': {'remote': True, 'bit_8': False, 'ready_to_switch_on': True}})
    assert [(bit.number, bit.name) for bit in drive.bits_of('status_word')] == [
        (0, 'ready_to_switch_on'), (8, 'bit_8'), (9, 'remote')]


def test_the_banner_says_so_once(page: Any) -> None:
    from drive_can_bridge.panel.parts import Banner
    banner = Banner()
    snapshot = seen('online', 'online', silent=True)
    banner.show(snapshot)
    text, = texts(page, 'banner')
    assert [text] == list(silence(snapshot, time_of_day))
    banner.show(seen('online', 'online'))
    assert texts(page, 'banner') == []


def test_a_bridge_that_took_its_leave_neither_runs_nor_is_silent(page: Any) -> None:
    from drive_can_bridge.panel.pages import LogPage
    made = LogPage()
    for bridge, told in ((BridgeSnapshot(BRIDGE), 'runs'), (BridgeSnapshot(BRIDGE, 7.0), 'silent'),
                         (BridgeSnapshot(BRIDGE, ended=True), 'ended')):
        made.show(Snapshot(bridges=(bridge,)))
        assert told in [text for kind in ('facts', 'states') for text in ' '.join(
            texts(page, kind)).replace(BRIDGE, ' ').split()]


def test_the_log_is_filtered_and_stands_still_on_request(page: Any) -> None:
    from drive_can_bridge.panel.pages import LogPage
    made = LogPage()

    def log(count: int) -> Snapshot:
        return Snapshot(log=tuple(LogLine(
            float(number), 'WARN' if number % 2 else 'INFO', 'bridge', f'line {number}')
            for number in range(count)))

    def lines() -> list[str]:
        return [text.rpartition(' ')[2] for text in reversed(texts(page, 'text'))]
    made.show(log(4))
    assert sorted(lines()) == ['0', '1', '2', '3']
    made._pause()
    made.show(log(5))
    assert len(lines()) == 4
    made._pause()
    assert len(lines()) == 5
    made._filter.set_value('warn')
    assert sorted(lines()) == ['1', '3']
    assert texts(page, 'number')[0].startswith('1970-01-01 ')
