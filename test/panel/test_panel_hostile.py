# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Whoever means no good, in plain HTTP: refused in words, and panel and bridge go on."""

from collections.abc import Iterator
from contextlib import ExitStack
from http.client import HTTPConnection
import select
import selectors
import socket

from panel_builders import FILE_OF_PANEL, NEEDS_PANEL, SCRIPT, Site
import pytest
from waiting import wait_for

pytest.importorskip('rclpy')

pytestmark = NEEDS_PANEL

STOP = {'drive': '/lift'}
#: everything that there is to be had
PATHS = ['/', '/log', '/drive/lift', '/panel/panel.js', '/favicon.ico', '/do/backup?drive=/lift',
         '/_nicegui_ws/socket.io/?EIO=4&transport=polling', '/nothing', '/docs', '/openapi.json']


@pytest.fixture(autouse=True)
def goes_on(site: Site) -> Iterator[None]:
    """Look whether panel and bridge go on."""
    yield
    site.check_alive()


@pytest.mark.parametrize('path', PATHS)
def test_without_token_there_is_nothing(site: Site, path: str) -> None:
    answer = site.get(path)
    assert answer.status == 401
    assert 'open the address that drive_can panel has printed' in answer.text
    assert 'set-cookie' not in answer.headers
    assert 'nicegui' not in answer.text.lower()


@pytest.mark.parametrize('path', ['/?token=guessed', '/?token=', '/?token=%00%ff'])
def test_a_wrong_token_opens_nothing(site: Site, path: str) -> None:
    answer = site.get(path)
    assert (answer.status, 'set-cookie' in answer.headers) == (401, False)
    # not either where another token opened before
    assert site.get(path, 'operator').status == 401


def test_a_browser_is_told_in_a_page(site: Site) -> None:
    answer = site.get('/', Accept='text/html')
    assert answer.status == 401
    assert answer.headers['content-type'].startswith('text/html')
    assert 'with its token' in answer.text
    nothing = site.get('/nothing', 'viewer', Accept='text/html')
    assert nothing.status == 404
    # the same page, with a way back
    for text in (answer.text, nothing.text):
        assert '<a href="/">All drives</a>' in text


def test_the_printed_address_opens_and_leaves_a_cookie_for_this_site_only(site: Site) -> None:
    answer = site.get(f'/?token={site.tokens["viewer"]}')
    assert answer.status == 200
    cookie = answer.headers['set-cookie']
    assert {'HttpOnly', 'SameSite=Strict'} <= set(cookie.split('; '))
    assert answer.headers['x-frame-options'] == 'DENY'
    assert "frame-ancestors 'none'" in answer.headers['content-security-policy']
    assert answer.headers['referrer-policy'] == 'no-referrer'
    assert site.get('/', None, Cookie=cookie.partition(';')[0]).status == 200


@pytest.mark.parametrize('action', ['quick_stop', 'disable', 'write', 'restore'])
def test_a_viewer_is_no_operator(site: Site, action: str) -> None:
    path = 'restore?drive=/lift' if action == 'restore' else action
    answer = site.do(path, 'viewer', {**STOP, 'name': 'ramp_time', 'value': '2'})
    assert answer.status == 403
    assert answer.said['success'] is False
    assert "needs the operator's token" in answer.said['text']
    assert site.do(path, None, STOP).status == 401


@pytest.mark.parametrize('role', ['viewer', 'operator'])
def test_a_viewer_is_shown_no_buttons(site: Site, role: str) -> None:
    assert ('Quick stop' in site.get('/', role).text) is (role == 'operator')


@pytest.mark.parametrize('origin', ['http://evil.example', 'null', 'http://127.0.0.1:1'])
def test_another_origin_is_refused(site: Site, origin: str) -> None:
    answer = site.do('quick_stop', 'operator', STOP, Origin=origin)
    assert answer.status == 403
    assert 'another page has sent this' in answer.text
    assert site.websocket('operator', Origin=origin).status == 403
    assert site.get('/', 'operator', Origin=origin).status == 403


def test_what_another_page_can_send_without_asking_is_refused(site: Site) -> None:
    form = {'Content-Type': 'text/plain', 'Origin': f'http://{site.host}'}
    for path in ('quick_stop', 'restore?drive=/lift', 'compare?drive=/lift'):
        answer = site.ask('POST', f'/do/{path}', 'operator', form, b'{"drive": "/lift"}')
        assert answer.status == 415
    answer = site.do('quick_stop', 'operator', STOP, Sec_Fetch_Site='cross-site')
    assert answer.status == 403


@pytest.mark.parametrize('host', ['evil.example', 'evil.example:{port}', '10.1.2.3:{port}'])
def test_dns_rebinding_is_refused(site: Site, host: str) -> None:
    host = host.format(port=site.port)
    for answer in (site.get('/', 'operator', Host=host),
                   site.websocket('operator', Host=host, Origin=f'http://{host}'),
                   site.do('quick_stop', 'operator', STOP, Host=host, Origin=f'http://{host}'),
                   site.get(f'/?token={site.tokens["operator"]}', Host=host)):
        assert answer.status == 403
        assert 'does not answer to that name' in answer.text


def test_a_websocket_needs_the_cookie(site: Site) -> None:
    assert site.websocket(None).status == 401
    assert site.websocket(None, Cookie=f'drive_can_panel_{site.port}=guessed').status == 401
    assert site.ask('GET', f'/_nicegui_ws/socket.io/?EIO=4&transport=websocket&token='
                           f'{site.tokens["operator"]}', None, {
        'Connection': 'Upgrade', 'Upgrade': 'websocket', 'Sec-WebSocket-Version': '13',
        'Sec-WebSocket-Key': 'dGhlIHNhbXBsZSBub25jZQ=='}).status == 401


def test_a_websocket_with_the_cookie_is_let_in(site: Site) -> None:
    with socket.create_connection(('127.0.0.1', site.port), timeout=10.0) as connection:
        connection.sendall((
            'GET /_nicegui_ws/socket.io/?EIO=4&transport=websocket HTTP/1.1\r\n'
            f'Host: {site.host}\r\nOrigin: http://{site.host}\r\nConnection: Upgrade\r\n'
            'Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n'
            'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n'
            f'Cookie: {site.cookie("viewer")["Cookie"]}\r\n\r\n').encode())
        assert connection.recv(4096).startswith(b'HTTP/1.1 101 ')


def test_a_script_in_a_description_stays_text(site: Site) -> None:
    for path in ('/', '/drive/conveyor', '/log', '/drive/%3Cscript%3Ealert(1)%3C/script%3E'):
        text = site.get(path, 'operator').text
        assert SCRIPT not in text
        assert '<script>window.intruded' not in text
        assert '<script>alert' not in text


@pytest.mark.parametrize('fields', [
    {}, {'drive': 7}, {'drive': '/nobody'}, {'drive': '/lift/../conveyor'}, {'drive': None},
    {'drive': ['/lift']}, {'drive': '/lift\x1b[2J'}])
def test_there_are_only_the_drives_that_there_are(site: Site, fields: dict[str, object]) -> None:
    answer = site.do('quick_stop', 'operator', fields)
    assert answer.status == 404
    assert answer.said['text'].startswith('no drive ')
    assert '\x1b' not in answer.said['text']


@pytest.mark.parametrize('body', [b'', b'[]', b'{', b'\xff\xfe', b'[' * 100_000, b'"x"'])
def test_what_is_no_request_is_refused(site: Site, body: bytes) -> None:
    answer = site.ask('POST', '/do/disable', 'operator', {
        'Content-Type': 'application/json', 'Origin': f'http://{site.host}'}, body)
    assert answer.status == 400
    assert answer.said['text'] == 'that is no JSON object'


@pytest.mark.parametrize('value', ['1_5', '１５', '\x1b[2J', 'nan', '9' * 30, '1' * 900_000, ''])
def test_what_is_no_number_is_refused(site: Site, value: str) -> None:
    fields = {'drive': '/conveyor', 'name': 'mode', 'value': value}
    wait_for(lambda: 'not told' not in site.do('write', 'operator', fields).said['text'],
             'its parameters')
    said = site.do('write', 'operator', fields).said
    assert said['success'] is False
    assert 'is no value: write an integer' in said['text']
    assert len(said['text']) < 1000
    assert said['text'].isprintable()


@pytest.mark.parametrize('action', ['enable', 'reset_fault', 'command', 'joint_command'])
def test_nothing_that_moves_can_be_asked_for(site: Site, action: str) -> None:
    assert site.do(action, 'operator', STOP).status == 404


@pytest.mark.parametrize('fields', [{}, {'value': None}, {'value': 2.5}])
def test_a_write_without_a_value_says_so(site: Site, fields: dict[str, object]) -> None:
    wanted = {'drive': '/conveyor', 'name': 'ramp_time', **fields}
    wait_for(lambda: 'no value' in site.do('write', 'operator', wanted).said['text'],
             'its parameters')


def test_setpoints_and_control_words_are_no_parameters(site: Site) -> None:
    fields = {'drive': '/lift', 'name': 'nothing', 'value': '1'}
    wait_for(lambda: 'no such parameter' in site.do('write', 'operator', fields).said['text'],
             'its parameters')
    for drive, name in (('/lift', 'control_word'), ('/lift', 'speed_setpoint'),
                        ('/conveyor', 'speed_setpoint')):
        answer = site.do('write', 'operator', {'drive': drive, 'name': name, 'value': '1'})
        assert answer.said['success'] is False
        assert 'use ~/enable' in answer.said['text'] or 'sent cyclically' in answer.said['text']
    for name, why in (('address', 'protected'), ('other_setpoint', 'moves the drive')):
        said = site.do('write', 'operator',
                       {'drive': '/conveyor', 'name': name, 'value': '1'}).said
        assert (said['success'], why in said['text']) == (False, True)


# -- too much of everything -----------------------------------------------------------------------


def test_a_hundred_megabytes_are_not_taken(site: Site) -> None:
    headers = {'Content-Type': 'application/yaml', 'Content-Length': str(100_000_000)}
    path = '/do/compare?drive=/lift'
    answer = site.ask('POST', path, 'viewer', headers, b'x' * 1000)
    assert answer.status == 413
    assert 'too much at once' in answer.text
    # who has no token is not listened to either
    assert site.ask('POST', path, None, headers, b'x' * 1000).status == 401


def test_a_body_without_end_is_not_taken(site: Site) -> None:
    with socket.create_connection(('127.0.0.1', site.port), timeout=30.0) as connection:
        connection.sendall((
            f'POST /do/compare?drive=/lift HTTP/1.1\r\nHost: {site.host}\r\n'
            f'Cookie: {site.cookie("viewer")["Cookie"]}\r\n'
            'Content-Type: application/yaml\r\n'
            'Transfer-Encoding: chunked\r\n\r\n').encode())
        sent = 0
        # as much as is taken, until there is an answer
        while not select.select([connection], [], [], 0)[0] and sent < 100_000_000:
            try:
                connection.sendall(b'10000\r\n' + b'x' * 0x10000 + b'\r\n')
            except ConnectionError:
                break
            sent += 0x10000
        assert sent < 30_000_000
        answer = connection.recv(4096)
    assert answer.startswith(b'HTTP/1.1 413 ')


def test_a_head_without_end_is_not_taken(site: Site) -> None:
    with socket.create_connection(('127.0.0.1', site.port), timeout=30.0) as connection:
        connection.sendall(b'GET / HTTP/1.1\r\n')
        with pytest.raises(OSError):  # closed, whenever that is noticed
            while True:
                connection.sendall(b'X-Filler: ' + b'x' * 4000 + b'\r\n')


def test_a_thousand_connections(site: Site) -> None:
    resource = pytest.importorskip('resource')
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    told: list[bytes] = []
    with ExitStack() as stack:
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, hard), hard))
        stack.callback(resource.setrlimit, resource.RLIMIT_NOFILE, (soft, hard))
        listening = stack.enter_context(selectors.DefaultSelector())
        for _ in range(1000):
            connection = stack.enter_context(
                socket.create_connection(('127.0.0.1', site.port), timeout=30.0))
            listening.register(connection, selectors.EVENT_READ)

        def refused() -> bool:
            for key, _ in listening.select(0):
                listening.unregister(key.fileobj)
                said = key.fileobj.recv(4096)  # type: ignore[union-attr]
                told.extend([said] if said else [])     # the others have waited too long
            return len(told) > 500
        wait_for(refused, 'refusals')
        assert all(b'connections are open already' in each for each in told)
        # who says nothing makes room for those who talk
        wait_for(lambda: room(site), 'room for a viewer')
    assert site.do('quick_stop', 'operator', STOP).said['success'] is True


@pytest.mark.parametrize('says', [b'', b'G'])
def test_who_says_nothing_keeps_nobody_from_stopping(site: Site, says: bytes) -> None:
    with ExitStack() as stack:
        def more() -> None:
            connection = stack.enter_context(
                socket.create_connection(('127.0.0.1', site.port), timeout=30.0))
            connection.sendall(says)
        for _ in range(205):
            more()
        for _ in range(20):
            assert site.do('quick_stop', 'operator', STOP).said['success'] is True
            for _ in range(20):
                more()


def test_a_viewer_who_takes_all_places_keeps_nobody_from_stopping(site: Site) -> None:
    with ExitStack() as stack:
        connections = []
        for _ in range(230):
            connection = HTTPConnection('127.0.0.1', site.port, timeout=30.0)
            stack.callback(connection.close)
            connections.append(connection)
            connection.request('GET', FILE_OF_PANEL, headers=site.cookie('viewer'))
            answer = connection.getresponse()
            answer.read()
            if answer.status == 503:
                break
        assert answer.status == 503
        assert site.do('quick_stop', 'operator', STOP).said['success'] is True
        assert site.do('disable', 'operator', STOP).said['success'] is True
        assert site.do('disable', 'viewer', STOP).status == 503


def room(site: Site) -> bool:
    """Tell whether somebody is let in, and not told in words that there are too many."""
    try:
        answer = site.get(FILE_OF_PANEL, 'viewer')
    except ConnectionError:  # closed while it was asked
        return False
    if answer.status == 503:
        assert 'connections are open already' in answer.text
    return answer.status == 200


def test_pages_without_end_are_not_made(site: Site) -> None:
    # what there is not makes no pages
    for number in range(60):
        answer = site.get(f'/nothing{number}', 'viewer')
        assert (answer.status, answer.text) == (404, 'there is nothing at this address\n')
    answers = [site.get('/', 'viewer') for _ in range(60)]
    assert {answer.status for answer in answers} == {200, 503}
    assert 'pages are open already' in answers[-1].text
    # viewers cannot keep an operator out
    assert site.get('/', 'operator').status == 200
    answers = [site.get('/', 'operator') for _ in range(60)]
    assert answers[-1].status == 503
    # a stop is no page
    assert site.do('quick_stop', 'operator', STOP).said['success'] is True
