# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Whoever means no good: refused in words, and panel and bridge go on.

On the bench; what takes sockets is told of a process, in ``test_panel_sockets.py``.
"""

from collections.abc import Iterator
import itertools
from typing import TYPE_CHECKING

from panel_builders import SCRIPT
import pytest

if TYPE_CHECKING:
    from panel_bench import House

pytest.importorskip('rclpy')
pytest.importorskip('nicegui', reason="needs the extra 'panel'")

STOP = {'drive': '/lift'}
PARAMETERS = 'mode', 'address', 'other_setpoint', 'target_x', 'ramp_time'
#: everything that there is to be had
PATHS = ['/', '/log', '/drive/lift', '/panel/panel.js', '/favicon.ico', '/do/backup?drive=/lift',
         '/_nicegui_ws/socket.io/?EIO=4&transport=polling', '/nothing', '/docs', '/openapi.json']


@pytest.fixture(autouse=True)
def goes_on(house: 'House') -> Iterator[None]:
    """Look whether panel and bridge go on, and that nothing was written."""
    drive = house.bridge.played['conveyor']
    before = {name: drive.value(name) for name in PARAMETERS}
    yield
    assert {name: drive.value(name) for name in PARAMETERS} == before
    house.check_alive()


@pytest.mark.parametrize('path', PATHS)
def test_without_token_there_is_nothing(house: 'House', path: str) -> None:
    answer = house.get(path)
    assert answer.status == 401
    assert 'set-cookie' not in answer.headers
    assert 'nicegui' not in answer.text.lower()


@pytest.mark.parametrize('path', ['/?token=guessed', '/?token=', '/?token=%00%ff'])
def test_a_wrong_token_opens_nothing(house: 'House', path: str) -> None:
    answer = house.get(path)
    assert (answer.status, 'set-cookie' in answer.headers) == (401, False)
    # not either where another token opened before
    assert house.get(path, 'operator').status == 401


def test_a_browser_is_told_in_a_page(house: 'House') -> None:
    answer = house.get('/', Accept='text/html')
    assert answer.status == 401
    assert answer.headers['content-type'].startswith('text/html')
    nothing = house.get('/nothing', 'viewer', Accept='text/html')
    assert nothing.status == 404
    # the same page, with a way back
    for text in (answer.text, nothing.text):
        assert '<a href="/">' in text


def test_the_printed_address_opens_and_leaves_a_cookie_for_this_site_only(house: 'House') -> None:
    answer = house.get(f'/?token={house.tokens["viewer"]}')
    assert answer.status == 200
    cookie = answer.headers['set-cookie']
    assert {'HttpOnly', 'SameSite=Strict'} <= set(cookie.split('; '))
    assert answer.headers['x-frame-options'] == 'DENY'
    assert "frame-ancestors 'none'" in answer.headers['content-security-policy']
    assert answer.headers['referrer-policy'] == 'no-referrer'
    assert house.get('/', None, Cookie=cookie.partition(';')[0]).status == 200


@pytest.mark.parametrize('action', ['quick_stop', 'disable', 'write', 'restore'])
def test_a_viewer_is_no_operator(house: 'House', action: str) -> None:
    path = 'restore?drive=/lift' if action == 'restore' else action
    answer = house.do(path, 'viewer', {**STOP, 'name': 'ramp_time', 'value': '2'})
    assert answer.status == 403
    assert answer.said['success'] is False
    assert house.do(path, None, STOP).status == 401


@pytest.mark.parametrize('role', ['viewer', 'operator'])
def test_a_viewer_is_shown_no_buttons(house: 'House', role: str) -> None:
    assert ('Quick stop' in house.get('/', role).text) is (role == 'operator')


@pytest.mark.parametrize('origin', ['http://evil.example', 'null', 'http://127.0.0.1:1'])
def test_another_origin_is_refused(house: 'House', origin: str) -> None:
    answer = house.do('quick_stop', 'operator', STOP, Origin=origin)
    assert answer.status == 403
    assert house.websocket('operator', Origin=origin).status == 403
    assert house.get('/', 'operator', Origin=origin).status == 403


def test_what_another_page_can_send_without_asking_is_refused(house: 'House') -> None:
    form = {'Content-Type': 'text/plain', 'Origin': f'http://{house.host}'}
    for path in ('quick_stop', 'restore?drive=/lift', 'compare?drive=/lift'):
        answer = house.ask('POST', f'/do/{path}', 'operator', form, b'{"drive": "/lift"}')
        assert answer.status == 415
    answer = house.do('quick_stop', 'operator', STOP, Sec_Fetch_Site='cross-site')
    assert answer.status == 403


@pytest.mark.parametrize('host', ['evil.example', 'evil.example:{port}', '10.1.2.3:{port}'])
def test_dns_rebinding_is_refused(house: 'House', host: str) -> None:
    host = host.format(port=house.port)
    for answer in (house.get('/', 'operator', Host=host),
                   house.websocket('operator', Host=host, Origin=f'http://{host}'),
                   house.do('quick_stop', 'operator', STOP, Host=host, Origin=f'http://{host}'),
                   house.get(f'/?token={house.tokens["operator"]}', Host=host)):
        assert answer.status == 403


def test_a_websocket_needs_the_cookie(house: 'House') -> None:
    assert house.websocket(None).status == 401
    assert house.websocket(None, Cookie=f'drive_can_panel_{house.port}=guessed').status == 401
    assert house.websocket(None, '/_nicegui_ws/socket.io/?EIO=4&transport=websocket&token='
                                 f'{house.tokens["operator"]}').status == 401
    assert house.websocket('viewer').status == 101


def test_a_script_in_a_description_stays_text(house: 'House') -> None:
    for path in ('/', '/drive/conveyor', '/log', '/drive/%3Cscript%3Ealert(1)%3C/script%3E'):
        text = house.get(path, 'operator').text
        assert SCRIPT not in text
        assert '<script>window.intruded' not in text
        assert '<script>alert' not in text


@pytest.mark.parametrize('fields', [
    {}, {'drive': 7}, {'drive': '/nobody'}, {'drive': '/lift/../conveyor'}, {'drive': None},
    {'drive': ['/lift']}, {'drive': '/lift\x1b[2J'}])
def test_there_are_only_the_drives_that_there_are(
        house: 'House', fields: dict[str, object]) -> None:
    answer = house.do('quick_stop', 'operator', fields)
    assert answer.status == 404
    assert answer.said['success'] is False
    assert '\x1b' not in answer.said['text']


@pytest.mark.parametrize('body', [b'', b'[]', b'{', b'\xff\xfe', b'[' * 100_000, b'"x"'])
def test_what_is_no_request_is_refused(house: 'House', body: bytes) -> None:
    answer = house.ask('POST', '/do/disable', 'operator', {
        'Content-Type': 'application/json', 'Origin': f'http://{house.host}'}, body)
    assert (answer.status, answer.said['success']) == (400, False)


@pytest.mark.parametrize('value', ['1_5', '１５', '\x1b[2J', 'nan', '9' * 30, '1' * 900_000, ''])
def test_what_is_no_number_is_refused(house: 'House', value: str) -> None:
    said = house.do('write', 'operator',
                    {'drive': '/conveyor', 'name': 'mode', 'value': value}).said
    assert said['success'] is False
    assert 'integer' in said['text']
    assert len(said['text']) < 1000
    assert said['text'].isprintable()


@pytest.mark.parametrize('action', ['enable', 'reset_fault', 'command', 'joint_command'])
def test_nothing_that_moves_can_be_asked_for(house: 'House', action: str) -> None:
    assert house.do(action, 'operator', STOP).status == 404


@pytest.mark.parametrize('fields', [{}, {'value': None}, {'value': 2.5}])
def test_a_write_without_a_value_says_so(house: 'House', fields: dict[str, object]) -> None:
    answer = house.do('write', 'operator', {'drive': '/conveyor', 'name': 'mode', **fields})
    assert answer.status == 400


def test_setpoints_and_control_words_are_no_parameters(house: 'House') -> None:
    answer = house.do('write', 'operator', {'drive': '/lift', 'name': 'nothing', 'value': '1'})
    assert answer.status == 400
    for drive, name, why in (
            ('/lift', 'control_word', '~/enable'), ('/lift', 'speed_setpoint', 'cyclically'),
            ('/conveyor', 'speed_setpoint', 'cyclically'), ('/conveyor', 'address', 'protected'),
            ('/conveyor', 'other_setpoint', 'moves'),
            ('/conveyor', 'target_x', 'moves')):
        said = house.do('write', 'operator', {'drive': drive, 'name': name, 'value': '1'}).said
        assert (said['success'], why in said['text']) == (False, True)


# -- too much of everything -----------------------------------------------------------------------


def test_a_hundred_megabytes_are_not_taken(house: 'House') -> None:
    headers = {'Content-Type': 'application/yaml', 'Content-Length': str(100_000_000)}
    path = '/do/compare?drive=/lift'
    assert house.ask('POST', path, 'viewer', headers, b'x' * 1000).status == 413
    # who has no token is not listened to either
    assert house.ask('POST', path, None, headers, b'x' * 1000).status == 401


def test_a_body_without_end_is_not_taken(house: 'House') -> None:
    answer, taken = house.send('POST', '/do/compare?drive=/lift', 'viewer',
                               {'Content-Type': 'application/yaml'},
                               itertools.repeat(b'x' * 0x10000))
    assert answer.status == 413
    assert taken * 0x10000 < 30_000_000


def test_pages_without_end_are_not_made(house: 'House') -> None:
    # what there is not makes no pages
    for number in range(60):
        assert house.get(f'/nothing{number}', 'viewer').status == 404
    answers = [house.get('/', 'viewer') for _ in range(60)]
    assert {answer.status for answer in answers} == {200, 503}
    # viewers cannot keep an operator out
    assert house.get('/', 'operator').status == 200
    answers = [house.get('/', 'operator') for _ in range(60)]
    assert answers[-1].status == 503
    # a stop is no page
    assert house.do('quick_stop', 'operator', STOP).said['success'] is True
    house.close_pages()
    assert house.get('/', 'viewer').status == 200
