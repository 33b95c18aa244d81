# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The panel in a real browser, as a person sees it: Debian's chromium, driven by selenium."""

from collections.abc import Iterator
from pathlib import Path
import re
import signal
import socket
import time
from urllib.parse import urlsplit

from panel_browser import Browser, browser_missing
from panel_builders import NEEDS_PANEL, Run, SCRIPT, Site
from panel_somebody import Somebody
import pytest
from waiting import wait_for

pytest.importorskip('selenium', reason='.ci/browser brings it')

pytestmark = [NEEDS_PANEL, pytest.mark.browser, pytest.mark.skipif(browser_missing() != '',
                                                      reason=browser_missing())]


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    """Return a browser of desktop size; what it complains of is a failure."""
    opened = Browser(tmp_path)
    yield opened
    opened.close()
    assert opened.complaints == []


@pytest.fixture
def phone(tmp_path: Path) -> Iterator[Browser]:
    """Return a browser of a phone's size."""
    opened = Browser(tmp_path, phone=True)
    yield opened
    opened.close()
    assert opened.complaints == []


def test_the_page_is_live_and_values_move(
        site: Site, browser: Browser, somebody: Somebody) -> None:
    browser.open(site.addresses['operator'])
    browser.shows(r'conveyor\s+not armed.*actual_speed\s+-?\d+\.\d\s+rpm')
    # the token is not left where it is seen and copied
    assert 'token' not in browser.address
    assert browser.value('/conveyor', 'actual_speed') == '0.0'
    somebody.commands('/conveyor', 50.0)
    wait_for(lambda: browser.value('/conveyor', 'actual_speed') == '50.0', 'that it moves')
    assert browser.value('/conveyor', 'speed_setpoint') == '50.0'


def test_nothing_leaves_the_machine(site: Site, browser: Browser) -> None:
    browser.open(site.addresses['operator'])
    for path in ('/', '/drive/conveyor', '/log'):
        browser.open(f'http://{site.host}{path}')
        browser.shows('conveyor')
    # chromium's own pages have schemes of their own
    hosts = {urlsplit(address).netloc for address in browser.requests()
             if urlsplit(address).scheme in ('http', 'https', 'ws', 'wss')}
    assert hosts == {site.host}
    assert any('/_nicegui_ws/' in address for address in browser.requests())


def test_an_edit_reaches_the_drive_and_its_refusal_is_shown(site: Site, browser: Browser) -> None:
    browser.open(site.addresses['operator'])
    browser.open(f'http://{site.host}/drive/conveyor')
    browser.click('.q-tab', 'Parameters')
    browser.shows('ramp_time')
    browser.search('ramp_time')
    browser.shows('1 of 11 parameters')
    wait_for(lambda: browser.field('ramp_time') not in ('', None), 'its value, as read')
    browser.write('ramp_time', '2.5')
    browser.shows('written')
    answer = site.do('write', 'operator',
                     {'drive': '/conveyor', 'name': 'ramp_time', 'value': '1e9'})
    browser.write('ramp_time', '4711')
    # word for word what the bridge answers to anybody
    browser.shows(r'4711(\.0)? is out of range')
    assert answer.said['success'] is False
    wait_for(lambda: browser.field('ramp_time') == '4711', 'what was typed, to be corrected')
    browser.refresh()
    browser.click('.q-tab', 'Parameters')
    wait_for(lambda: browser.field('ramp_time') == '2.50', 'what the drive has')
    # a script in a description is read, not run
    browser.shows('window.intruded=1')
    assert SCRIPT in browser.text
    assert browser.run('return window.intruded') is None


def test_quick_stop_reaches_the_bus(site: Site, phone: Browser, somebody: Somebody) -> None:
    somebody.enables('/lift')
    phone.open(site.addresses['operator'])
    wait_for(lambda: phone.value('/lift', 'control_word') == '0x0001 enable', 'that it is enabled')
    assert phone.fits
    # the control word comes first in the cyclic request of station 2
    stop = '005FFFF0#0002'
    assert stop not in site.frame_log.read_text(encoding='ascii')
    phone.click('[data-drive="/lift"] button', 'Quick stop')
    wait_for(lambda: stop in site.frame_log.read_text(encoding='ascii'), 'the frame on the bus')
    phone.shows('lift: ready')
    wait_for(lambda: phone.value('/lift', 'control_word') == '0x0000 disable',
             'that it is disabled')


def test_all_drives_are_stopped_by_one_button(
        site: Site, phone: Browser, somebody: Somebody) -> None:
    somebody.enables('/lift')
    phone.open(site.addresses['operator'])
    phone.open(f'http://{site.host}/log')
    phone.click('.bar button', 'Quick stop all')
    phone.shows('of 3 drives stopped')
    wait_for(lambda: '005FFFF0#0000' in last_line(site, '005FFFF0'), 'that it is disabled')


def test_a_viewer_sees_no_buttons_and_no_fields(site: Site, browser: Browser) -> None:
    browser.open(site.addresses['viewer'])
    browser.shows('lift')
    assert browser.find_all('button.stop, button.danger') == []
    browser.open(f'http://{site.host}/drive/lift')
    browser.click('.q-tab', 'Parameters')
    browser.shows('ramp_time')
    assert browser.find_all('.parameter input') == []
    browser.expected = ' 403 '
    # what it can still try by hand is refused in words
    said = browser.run("""
        return fetch('/do/quick_stop', {method: 'POST', body: '{"drive": "/lift"}',
            headers: {'Content-Type': 'application/json'}}).then((answer) => answer.json())""")
    assert said['success'] is False


def test_two_browsers_see_the_same(site: Site, browser: Browser, phone: Browser,
                                   somebody: Somebody) -> None:
    for each, role in ((browser, 'operator'), (phone, 'viewer')):
        each.open(site.addresses[role])
        each.open(f'http://{site.host}/drive/lift')
        each.shows('bus main')
        assert each.fits
    somebody.enables('/lift')
    for each in (browser, phone):
        each.shows('lift\\s+not armed\\s+enabled')
    browser.click('button', 'Disable')
    for each in (browser, phone):
        each.shows('lift\\s+disabled')


def test_charts_draw_pause_and_zoom(site: Site, browser: Browser) -> None:
    browser.open(site.addresses['viewer'])
    browser.open(f'http://{site.host}/drive/conveyor')
    wait_for(lambda: browser.points() > 5, 'points in the chart')
    browser.click('button', 'Pause')
    browser.shows('Go on')
    end, points = browser.axis_end(), browser.points()
    time.sleep(1.5)  # nothing is to happen
    assert (browser.axis_end(), browser.points()) == (end, points)
    browser.click('button', 'Go on')
    wait_for(lambda: browser.axis_end() > end, 'that it goes on')
    # nothing is missing
    assert browser.points() > points + 5
    browser.zooms(50, 100)
    end = browser.axis_end()
    wait_for(lambda: browser.axis_end() > end, 'that it goes on zoomed')
    assert browser.zoom() == [50, 100]


def test_a_value_that_does_not_change_has_an_axis_around_it(site: Site, browser: Browser) -> None:
    browser.open(site.addresses['operator'])
    browser.open(f'http://{site.host}/drive/lift')
    wait_for(lambda: browser.points() > 5, 'points in the chart')
    assert browser.run(
        'return getElement(document.querySelector(".chart").id.slice(1)).chart.getModel()'
        '.getComponent("yAxis").axis.scale.getExtent()') == [-1, 1]


def test_a_stop_that_takes_long_is_not_forgotten(site: Site, browser: Browser) -> None:
    browser.open(site.addresses['operator'])
    browser.open(f'http://{site.host}/drive/lift')
    browser.shows('bus main')
    site.bridge.process.send_signal(signal.SIGSTOP)
    browser.click('button', 'Disable')
    browser.shows('lift: no answer to disable yet: may still be running')
    site.bridge.process.send_signal(signal.SIGCONT)
    browser.gone('no answer to disable yet')
    assert 'nobody' not in browser.text


def test_the_bridge_dies_and_comes_back(site: Site, browser: Browser) -> None:
    browser.open(site.addresses['operator'])
    browser.shows('conveyor')
    browser.run('window.mark = 1')
    assert site.bridge.end(signal.SIGKILL) == -signal.SIGKILL
    browser.shows('silent since .*a stop may not reach them')
    browser.shows(r'conveyor\s+unknown\s+its bridge is silent since \d\d:\d\d:\d\d')
    buttons = 'return [...document.querySelectorAll("[data-drive] button")]'
    assert browser.run(f'{buttons}.every(each=>!each.disabled)')
    site.bridge = site.start_bridge()
    browser.shows('bus main: up')
    browser.gone('silent since')
    assert browser.run(f'{buttons}.every(each=>!each.disabled)')
    # all that without loading the page anew
    assert browser.run('return window.mark') == 1


def test_a_panel_that_was_started_again_has_its_page_say_so(run: Run, tmp_path: Path) -> None:
    panel = run('drive_can', 'panel', '--port', '0', '--namespace', '/nowhere')
    address = panel.line('^operator: http').partition(' ')[2]
    browser = Browser(tmp_path)
    try:
        browser.open(address)
        browser.shows('No bridge yet')
        wait_for(lambda: not browser.find_all('.lost'), 'that it is live')
        assert panel.end(signal.SIGKILL) == -signal.SIGKILL
        # what is old looks so
        wait_for(lambda: browser.find_all('.lost'), 'that it is noticed')
        browser.shows(r'connecting… what is shown is of \d\d:\d\d:\d\d')
        run('drive_can', 'panel', '--port', str(urlsplit(address).port), '--namespace', '/nowhere')
        browser.shows('open the address that drive_can panel has printed')
    finally:
        browser.close()


def test_two_operators_at_the_same_parameter(site: Site, browser: Browser, phone: Browser) -> None:
    for each in (browser, phone):
        each.open(site.addresses['operator'])
        each.open(f'http://{site.host}/drive/conveyor')
        each.click('.q-tab', 'Parameters')
    wait_for(lambda: browser.field('ramp_time') and phone.field('ramp_time'), 'its value, as read')
    phone.type('ramp_time', '7')
    browser.write('ramp_time', '3')
    browser.shows('written')
    # what one writes does not get among what the other types, and is told
    phone.shows('now 3.00')
    assert phone.field('ramp_time') == '7'


def test_a_bridge_that_comes_back_with_another_configuration(
        site: Site, browser: Browser) -> None:
    said = site.do('write', 'operator', {'drive': '/conveyor', 'name': 'ramp_time', 'value': '2'})
    assert said.said['success'], said.text
    browser.open(site.addresses['operator'])
    browser.open(f'http://{site.host}/drive/conveyor')
    browser.click('.q-tab', 'Parameters')
    wait_for(lambda: browser.field('ramp_time') == '2.00', 'its value')
    browser.shows(r'0 … 100 s')
    browser.run('window.mark = 1')
    assert site.bridge.end(signal.SIGINT) == 0
    site.write_profile(('scale: 0.01, unit: s', 'scale: 10, unit: ms'),
                       ('maximum: 100,', 'maximum: 100000,'))
    try:
        site.bridge = site.start_bridge()
        browser.shows(r'0 … 100000 ms')
        wait_for(lambda: browser.field('ramp_time') == '2000', 'its value in the other unit')
        assert browser.run('return window.mark') == 1
    finally:
        site.write_profile()


def last_line(site: Site, identifier: str) -> str:
    """Return the newest frame with an identifier."""
    lines = site.frame_log.read_text(encoding='ascii').splitlines()
    return next((line for line in reversed(lines) if f' {identifier}#' in line), '')


def test_what_is_touched_is_large_enough(site: Site, phone: Browser) -> None:
    phone.open(site.addresses['operator'])
    for path in ('/', '/drive/lift', '/log', '/drive/nobody'):
        phone.open(f'http://{site.host}{path}')
        phone.shows('Quick stop all')
        assert phone.fits
        small = phone.run(
            'return [...document.querySelectorAll("button, a, .q-tab, .q-field__control")]'
            '.filter((each) => each.offsetParent).map((each) => [each.textContent, '
            'each.getBoundingClientRect()]).filter(([_, place]) => place.height < 43.9 '
            '|| place.width < 43.9).map(([text, place]) => `${text}: ${place.height}`)')
        assert small == []


def test_which_robot_it_is_stands_above_every_page(site: Site, browser: Browser) -> None:
    browser.open(site.addresses['viewer'])
    for path in ('/', '/log', '/drive/lift'):
        browser.open(f'http://{site.host}{path}')
        browser.shows(f'{re.escape(socket.gethostname())} · ROS domain \\d+')
