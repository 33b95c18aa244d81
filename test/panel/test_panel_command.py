# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can panel`` as a command: what it prints, how it ends, what it says when it cannot."""

from collections.abc import Callable
import errno
from importlib import import_module
import os
import signal
import socket
import sys
import time
from types import ModuleType
from typing import Any

from clocks import REAL
from panel_builders import NEEDS_PANEL, Run
import pytest
from world import world

from drive_can_bridge.cli import panel as command
from drive_can_bridge.cli.main import understood
from drive_can_bridge.core.errors import DriveCanError

pytest.importorskip('rclpy')


def serve(*words: str, ended: Callable[[], bool] = lambda: False) -> bool:
    """Do what the command does between its signals; return whether it told its addresses."""
    _, args = understood(['panel', *words])
    args.clock = REAL
    return command._serve(args, ended)


@pytest.mark.parametrize(('missing', 'by', 'words'), [
    ('rclpy', 'ros.monitor.client', 'needs ROS 2'),
    ('nicegui', 'panel.pages', "-m pip install 'nicegui"),
    ('starlette', 'panel.pages', 'module nicegui (starlette) is not installed: ')])
def test_what_is_missing_is_said(missing: str, by: str, words: str,
                                 monkeypatch: pytest.MonkeyPatch) -> None:
    class Incomplete(ModuleType):
        def __getattr__(self, name: str) -> Any:
            raise ModuleNotFoundError('no', name=missing)
    monkeypatch.setitem(sys.modules, f'drive_can_bridge.{by}', Incomplete(by))
    with pytest.raises(DriveCanError) as said:
        serve()
    assert str(said.value).startswith('drive_can panel: ')
    assert words in str(said.value)


@NEEDS_PANEL
@pytest.mark.parametrize('looks', [1, 2])
def test_a_signal_while_it_is_being_loaded(looks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    left = list(range(looks))
    monkeypatch.setattr('drive_can_bridge.panel.server.listen', lambda *_: pytest.fail('late'))
    assert serve(ended=lambda: (left.pop(), not left)[1]) is False


@NEEDS_PANEL
def test_it_ends_at_once_whoever_looks(run: Run) -> None:
    panel = run('drive_can', 'panel', '--port', '0', '--namespace', '/nowhere')
    address = panel.line('^viewer: http').partition(' ')[2]
    port, token = int(address.split(':')[2].partition('/')[0]), address.rpartition('=')[2]
    # somebody who is in the middle of something, and somebody with a WebSocket
    with socket.create_connection(('127.0.0.1', port)) as half, \
            socket.create_connection(('127.0.0.1', port), timeout=10.0) as whole:
        half.sendall(b'GET / HTTP/1.1\r\n')
        whole.sendall((
            'GET /_nicegui_ws/socket.io/?EIO=4&transport=websocket HTTP/1.1\r\n'
            f'Host: 127.0.0.1:{port}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n'
            'Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n'
            f'Cookie: drive_can_panel_{port}={token}\r\n\r\n').encode())
        assert whole.recv(4096).startswith(b'HTTP/1.1 101 ')
        begun = time.monotonic()
        assert panel.end(signal.SIGINT) == 0
        assert time.monotonic() - begun < 10.0
    assert panel.errors.splitlines() == [panel.errors.splitlines()[0]]
    assert 'ROS domain' in panel.errors


@NEEDS_PANEL
def test_a_port_that_is_taken() -> None:
    with socket.create_server(('127.0.0.1', 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(DriveCanError) as said:
            serve('--port', str(port))
    for word in ('drive_can panel: ', '127.0.0.1', str(port), os.strerror(errno.EADDRINUSE),
                 '--port'):
        assert word in str(said.value)


@NEEDS_PANEL
@pytest.mark.parametrize('host', ['192.0.2.1', 'no.such.host.invalid'])
def test_an_address_of_another_machine(host: str) -> None:
    with pytest.raises(DriveCanError) as said:
        serve('--host', host)
    for word in ('drive_can panel: ', host, '8080', '--host'):
        assert word in str(said.value)
    assert '--port' not in str(said.value)


@NEEDS_PANEL
@pytest.mark.parametrize('host', ['127.0.0.1', '0.0.0.0'])
def test_what_it_prints(host: str, monkeypatch: pytest.MonkeyPatch,
                        capsys: pytest.CaptureFixture[str]) -> None:
    def begin(_: object, listener: socket.socket, *__: object, ready: Callable[[], None],
              **___: object) -> None:
        with listener:
            ready()
    monkeypatch.setattr(import_module('drive_can_bridge.panel.server'), 'serve', begin)
    monkeypatch.setattr(import_module('drive_can_bridge.panel.pages'), 'application',
                        lambda *_: None)
    with world(0, ros=True):
        assert serve('--host', host, '--port', '0') is True
    told = capsys.readouterr()
    shown = socket.gethostname() if host == '0.0.0.0' else host
    for line, role in zip(told.out.splitlines(), ('operator', 'viewer'), strict=True):
        assert line.startswith(f'{role}: http://{shown}:')
        assert '/?token=' in line
    assert all(line.startswith('drive_can panel: ') for line in told.err.splitlines())
    assert 'ROS domain' in told.err
    # who can get in is explained where others can
    assert ('docs/security.md' in told.err) is (host == '0.0.0.0')
