# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Pages of fixed times and values: golden ones, and that they fit everywhere."""

from itertools import product

from extent import some
from monitor_builders import (
    AT, bus_status, drive_status, ENDED, ENDED_IN_DOUBT, feed, many_drives, model_of, NOW, seen,
    three_drives)
import pytest
from views import golden_file, plain, shown, SIZES, VIEWS

from drive_can_bridge.monitor.model import Model
from drive_can_bridge.view.live import Choice, closely, HINTS, Key, keys_in, Page, ViewSetting


@pytest.mark.parametrize(('width', 'height'), SIZES)
@pytest.mark.parametrize('name', VIEWS)
def test_the_page_is_the_golden_one(name: str, width: int, height: int) -> None:
    snapshot, choice = VIEWS[name]
    golden = golden_file(name, width, height).read_text(encoding='utf-8')
    assert plain(snapshot, choice, width, height) == golden


ANYTHING = [seen(model) for model in (
    three_drives(), many_drives(40), Model(), model_of([drive_status()]))]


@pytest.mark.parametrize('width', [10, 40, 79, 99, 100, 109, 110, 300])
@pytest.mark.parametrize('page', Page)
def test_it_fits_everywhere(width: int, page: Page) -> None:
    for snapshot, height in some(product(ANYTHING, (3, 10, 29, 30, 80)), 3):
        lines = plain(snapshot, Choice(page), width, height).rstrip('\n').split('\n')
        assert len(lines) == height
        assert all(len(line) <= width for line in lines)
        assert 'Layout' not in ''.join(lines)


def test_of_a_bridge_that_took_its_leave_there_is_no_banner() -> None:
    for farewell, doubt in ((ENDED, False), (ENDED_IN_DOUBT, True)):
        model = model_of([bus_status(), drive_status(**farewell)])
        text = plain(model.look(NOW + 60.0, AT + 60.0), Choice(), 100, 30)
        assert 'bridge ended: ' in text
        assert ('may still be running; a stop may not reach them' in text) == doubt


def test_nobody_starts_a_bridge_that_is_being_started() -> None:
    for bridge in ('', 'drive_can_bridge'):
        snapshot = seen(Model())
        told = plain(snapshot, Choice(), 100, 30, ViewSetting(bridge=bridge))
        assert ('To start one' in told) == bool(bridge)
        assert ('drive_can_bridge --ros-args --params-file FILE' in told) == bool(bridge)
        assert 'ros2 run' not in told


def test_a_view_in_the_wrong_domain_says_where_bridges_run() -> None:
    told = plain(seen(Model()), Choice(), 100, 30, ViewSetting(elsewhere='one runs elsewhere'))
    assert 'one runs elsewhere' in told


def test_a_load_that_is_no_number_ends_no_view() -> None:
    snapshot = seen(model_of([bus_status(load_percent='inf'), drive_status()]))
    assert 'load   0.0 % ' in plain(snapshot, Choice(), 100, 30)


def test_the_last_line_names_the_keys() -> None:
    for page, hints in HINTS.items():
        last = plain(seen(three_drives()), Choice(page), 80, 24).rstrip('\n').split('\n')[-1]
        assert last.rstrip() == '  '.join(' '.join(hint) for hint in hints)
    narrow = plain(seen(three_drives()), Choice(), 30, 10).rstrip('\n').split('\n')[-1]
    assert narrow.rstrip().endswith('q quit')


def test_the_marked_drive_is_among_those_that_fit() -> None:
    for number in (0, 7, 20, 39):
        name = f'/axis_{number}'
        text = plain(seen(many_drives()), Choice(drive=name), 80, 24)
        assert f'▸ axis_{number} ' in text
        assert ' of 40 ' in text


def test_columns_stay_where_they_are_whatever_the_values() -> None:
    for width, height in SIZES:
        places = set()
        for speed in (0.0, -3276.8, 3.14):
            model = three_drives()
            model.responded('/conveyor', [('actual_speed', speed), ('motor_current', 0.0),
                                          ('status_word', 0)], 1000.0)
            line = next(line for line in plain(seen(model), Choice(), width, height).split('\n')
                        if 'conveyor' in line)
            places.add((line.rindex('rpm'), len(line.rstrip()) if width == 60 else 0))
        assert len(places) == 1


def test_colours_are_left_out_where_they_are_not_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    snapshot = seen(three_drives())
    assert '\x1b[1;32m' in shown(snapshot, Choice(), 80, 24, colours=True)
    monkeypatch.setenv('NO_COLOR', '1')
    assert '32m' not in shown(snapshot, Choice(), 80, 24, colours=True)


@pytest.mark.parametrize('state', ['switch-on disabled', 'fault reaction active',
                                   'quick stop active, holds'])
@pytest.mark.parametrize('width', [120, 140, 200])
def test_a_state_is_not_cut_where_there_is_room(state: str, width: int) -> None:
    model = model_of([bus_status(), drive_status('lift', control_state=state)])
    feed(model, '/lift')
    assert f' {state} ' in plain(seen(model), Choice(drive='/lift'), width, 50)


def test_help_says_what_another_terminal_has_to_export() -> None:
    snapshot, choice = VIEWS['help']
    text = plain(snapshot, choice, 80, 24)
    for line in ('export ROS_DOMAIN_ID=7', 'drive_can enable /lift', 'drive_can stop'):
        assert f'\n{line}' in text


# -- keys -----------------------------------------------------------------------------------------

@pytest.mark.parametrize(('typed', 'keys'), [
    ('q', [Key.QUIT]), ('?', [Key.HELP]), ('\x1b[A\x1b[B', [Key.UP, Key.DOWN]), ('\x1bOBjk', [
        Key.DOWN, Key.DOWN, Key.UP]), ('\r', [Key.OPEN]), ('\x1b', [Key.BACK]),
    ('x\x00ü', []), ('\x1b[1;5Cq', [Key.QUIT]), ('\x1b[200~\r', [Key.OPEN]), ('\x1b\x1b', [
        Key.BACK, Key.BACK]), ('', [])])
def test_keys_are_found_in_what_is_typed(typed: str, keys: list[Key]) -> None:
    assert keys_in(typed) == keys


def test_keys_change_what_is_chosen() -> None:
    drives = ['/a', '/b', '/c']
    choice = Choice().press(Key.DOWN, drives)
    assert choice.drive == '/a'
    choice = choice.press(Key.UP, drives)
    assert choice.drive == '/c'
    choice = choice.press(Key.OPEN, drives)
    assert (choice.page, closely(choice)) == (Page.DRIVE, '/c')
    choice = choice.press(Key.BACK, drives)
    assert (choice.page, closely(choice)) == (Page.DRIVES, None)
    for key, page in ((Key.HELP, Page.HELP), (Key.HELP, Page.DRIVES), (Key.HELP, Page.HELP),
                      (Key.BACK, Page.DRIVES)):
        choice = choice.press(key, drives)
        assert choice.page is page
    assert choice.among(['/a']).drive == '/a'
    assert choice.among([]).drive is None
