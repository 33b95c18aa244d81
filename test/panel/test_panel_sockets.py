# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Sockets of a panel that runs as a process: too many, too long, too slow; and it goes on."""

from collections.abc import Iterator
from contextlib import ExitStack
from http.client import HTTPConnection
import select
import selectors
import socket

from panel_builders import FILE_OF_PANEL, NEEDS_PANEL, Site
import pytest
from waiting import wait_for

pytest.importorskip('rclpy')

pytestmark = NEEDS_PANEL

STOP = {'drive': '/lift'}


@pytest.fixture(autouse=True)
def goes_on(site: Site) -> Iterator[None]:
    """Look whether panel and bridge go on."""
    yield
    site.check_alive()


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


def test_who_says_nothing_keeps_nobody_from_stopping(site: Site) -> None:
    with ExitStack() as stack:
        def more() -> None:
            connection = stack.enter_context(
                socket.create_connection(('127.0.0.1', site.port), timeout=30.0))
            connection.sendall(b'G')
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
        # an operator finds the button, too
        assert site.get('/', 'operator').status == 200
        assert site.websocket('viewer').status == site.websocket(None).status == 503
        assert site.websocket('operator').status == 101
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
        assert answer.headers['content-type'].startswith('text/')
        assert answer.text
    return answer.status == 200
