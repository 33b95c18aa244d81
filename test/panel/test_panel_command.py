# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can panel`` as a command: what it prints, how it ends, what it says when it cannot."""

from pathlib import Path
import signal
import socket
import time

from panel_builders import NEEDS_PANEL, Run, Site
import pytest

pytest.importorskip('rclpy')


@pytest.mark.parametrize('arguments', [
    ['--port', '70000'], ['--port', 'x'], ['--namespace', 'no-name'], ['something']])
def test_wrong_usage(run: Run, arguments: list[str]) -> None:
    panel = run('drive_can', 'panel', *arguments)
    assert panel.process.wait(60.0) == 2
    assert panel.errors.startswith('drive_can panel: ')
    assert len(panel.errors.splitlines()) == 1


@pytest.mark.parametrize(('missing', 'words'), [
    ('rclpy', 'needs ROS 2'), ('nicegui', "-m pip install 'nicegui")])
def test_what_is_missing_is_said(run: Run, tmp_path: Path, missing: str, words: str) -> None:
    (tmp_path / f'{missing}.py').write_text(
        f"raise ModuleNotFoundError('no', name='{missing}')\n", encoding='utf-8')
    panel = run('drive_can', 'panel', environment={
        'PYTHONPATH': f'{tmp_path}:{Path(__file__).parents[2]}'})
    assert panel.process.wait(60.0) == 1
    [line] = panel.errors.splitlines()
    assert line.startswith('drive_can panel: ')
    assert words in line


@pytest.mark.parametrize('signum', [signal.SIGINT, signal.SIGTERM])
@NEEDS_PANEL
def test_it_ends_at_once_whoever_looks(site: Site, run: Run, signum: int) -> None:
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
        assert panel.end(signum) == 0
        assert time.monotonic() - begun < 10.0
    assert panel.errors.splitlines() == [panel.errors.splitlines()[0]]
    assert 'ROS domain' in panel.errors


@NEEDS_PANEL
def test_a_port_that_is_taken(site: Site, run: Run) -> None:
    panel = run('drive_can', 'panel', '--port', str(site.port))
    assert panel.process.wait(60.0) == 1
    [line] = panel.errors.splitlines()
    assert f'127.0.0.1, port {site.port}: Address already in use' in line
    assert '--port' in line


@NEEDS_PANEL
@pytest.mark.parametrize('host', ['192.0.2.1', 'no.such.host.invalid'])
def test_an_address_of_another_machine(run: Run, host: str) -> None:
    panel = run('drive_can', 'panel', '--host', host)
    assert panel.process.wait(60.0) == 1
    [line] = panel.errors.splitlines()
    assert line.startswith(f'drive_can panel: {host}, port 8080: ')
    assert line.endswith('no address of this machine, --host chooses another')


@NEEDS_PANEL
def test_listening_on_the_network_is_explained(run: Run) -> None:
    panel = run('drive_can', 'panel', '--host', '0.0.0.0', '--port', '0')
    assert f'http://{socket.gethostname()}:' in panel.line('^operator: http')
    assert 'who reaches this machine and has a token gets in' in panel.errors
    assert panel.end(signal.SIGINT) == 0
