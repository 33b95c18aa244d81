# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Simulated drives, a bridge and a panel as processes, and plain HTTP to talk to the panel."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPResponse
from importlib.util import find_spec
import json
from pathlib import Path
import re
from typing import Any

import pytest
from running import Running
from waiting import wait_for

#: looked for, not imported: that takes a second, and only the processes need it
NEEDS_PANEL = pytest.mark.skipif(find_spec('nicegui') is None, reason="needs the extra 'panel'")
#: what a drive's description, or a log line, may try
SCRIPT = '<script>window.intruded=1</script><img src=x onerror=window.intruded=1>'
FILE = """
/**/drive_can_bridge:
  ros__parameters:
    diagnostics_period: 0.5
    profile_directories: ['{directory}']
    buses:
      main: {{interface: slcan, channel: '{directory}', bitrate: 500000, reconnect_period: 0.2}}
    drives:
      conveyor:
        bus: main
        protocol: datamodel_extended
        station: 1
        profile: hostile
        period: 0.1
        missed_limit: 1000
        parameter_timeout: 2.0
        cyclic_request: [speed_setpoint]
        cyclic_response: [actual_speed, status_word]
      lift:
        bus: main
        protocol: datamodel_extended
        station: 2
        profile: datamodel_control_example
        period: 0.1
        missed_limit: 1000
        parameter_timeout: 2.0
        cyclic_request: [control_word, speed_setpoint]
        cyclic_response: [status_word, actual_speed]
      press:
        bus: main
        protocol: datamodel_extended
        station: 3
        profile: without_quick_stop
        period: 0.1
        missed_limit: 1000
        parameter_timeout: 2.0
        cyclic_request: [control_word]
        cyclic_response: [status_word]
"""
WITHOUT_QUICK_STOP = """
description: Can only be enabled and disabled
protocols: [datamodel_extended]
parameters:
  control_word: {number: 52, type: uint16, access: rw, storage: ram}
  status_word: {number: 211, type: uint16, access: ro, bits: {ready: 0, enabled: 1}}
control:
  parameter: control_word
  words: {disable: 0x0000, enable: 0x0001}
  status: {parameter: status_word, ready: [0x0001, 0x0001], enabled: [0x0002, 0x0002]}
"""
PROFILE = """
description: A profile whose author means no good
protocols: [datamodel_extended]
parameters:
  speed_setpoint: {{number: 50, type: int16, scale: 0.1, unit: rpm, access: rw, minimum: -3000,
    maximum: 3000, neutral: 0}}
  actual_speed: {{number: 209, type: int16, scale: 0.1, unit: rpm, access: ro}}
  status_word: {{number: 211, type: uint16, access: ro, bits: {{ready: 0, enabled: 1, fault: 3}}}}
  ramp_time: {{number: 30, type: uint16, scale: 0.01, unit: s, access: rw, storage: eeprom,
    minimum: 0, maximum: 100, description: '{script}'}}
  mode: {{number: 33, type: uint16, access: rw, storage: ram}}
  address: {{number: 34, type: uint16, access: rw, storage: ram, protected: true}}
  other_setpoint: {{number: 35, type: int16, access: rw, storage: ram}}
  target_x: {{number: 36, type: int16, access: rw, storage: ram}}
  serial: {{number: 40, type: uint16, access: ro}}
  user_command: {{number: 41, type: uint16, access: wo}}
  release: {{number: 42, type: bool, access: wo}}
"""
#: costs nothing, unlike a page
FILE_OF_PANEL = '/panel/panel.css'
Run = Callable[..., Running]


@dataclass(frozen=True)
class Answer:
    """A response, read to its end."""

    status: int
    headers: Mapping[str, str]
    body: bytes

    @property
    def text(self) -> str:
        """Body as text."""
        return self.body.decode()

    @property
    def said(self) -> Any:
        """Body as JSON."""
        return json.loads(self.body)


def write_profiles(directory: Path, *changes: tuple[str, str]) -> None:
    """Write the profiles of drives, that of the conveyor with changes."""
    text = PROFILE.format(script=SCRIPT)
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    (directory / 'hostile.yaml').write_text(text, encoding='utf-8')
    (directory / 'without_quick_stop.yaml').write_text(WITHOUT_QUICK_STOP, encoding='utf-8')


class Visitors:
    """
    What people and programs ask of a panel.

    :ivar tokens: by role.
    """

    host: str
    port: int
    tokens: dict[str, str]

    def ask(self, method: str, path: str, role: str | None = None,
            headers: Mapping[str, str] | None = None, body: bytes | None = None) -> Answer:
        """Send a request; headers may take the place of the usual ones."""
        raise NotImplementedError

    def cookie(self, role: str | None) -> dict[str, str]:
        """Return the header that tells a role."""
        return {} if role is None else {
            'Cookie': f'drive_can_panel_{self.port}={self.tokens[role]}'}

    def get(self, path: str, role: str | None = None, **headers: str) -> Answer:
        """Get a page."""
        return self.ask('GET', path, role, {name.replace('_', '-'): value
                                            for name, value in headers.items()})

    def do(self, action: str, role: str | None, fields: Mapping[str, object],
           **headers: str) -> Answer:
        """Ask for something, as the page does."""
        return self.ask('POST', f'/do/{action}', role, {
            'Content-Type': 'application/json', 'Origin': f'http://{self.host}',
            **{name.replace('_', '-'): value for name, value in headers.items()}},
            json.dumps(fields).encode())

    def websocket(self, role: str | None, **headers: str) -> Answer:
        """Begin a WebSocket; 101: it was let in."""
        return self.ask('GET', '/_nicegui_ws/socket.io/?EIO=4&transport=websocket', role, {
            'Connection': 'Upgrade', 'Upgrade': 'websocket', 'Sec-WebSocket-Version': '13',
            'Sec-WebSocket-Key': 'dGhlIHNhbXBsZSBub25jZQ==', 'Origin': f'http://{self.host}',
            **{name.replace('_', '-'): value for name, value in headers.items()}})


class Site(Visitors):
    """
    A bridge with its drives, and a panel for them.

    :param arguments: of the panel.
    """

    def __init__(self, run: Run, directory: Path, *arguments: str) -> None:
        self._run = run
        self._directory = directory
        self._file = directory / 'drives.yaml'
        self._file.write_text(FILE.format(directory=directory), encoding='utf-8')
        self.write_profile()
        self._links = directory / 'links'
        #: as candump writes it
        self.frame_log = directory / 'frames.log'
        self.drives = run('drive_can', 'simulate', '--params-file', str(self._file), '--pty-link',
                          str(self._links), '--log-frames', str(self.frame_log))
        wait_for((self._links / 'main').is_symlink, 'the drives')
        self.bridge = self.start_bridge()
        self.panel = run('drive_can', 'panel', '--port', '0', *arguments)
        self.addresses = {role: self.panel.line(f'^{role}: http').partition(' ')[2]
                          for role in ('operator', 'viewer')}
        found = re.fullmatch(r'http://127\.0\.0\.1:(\d+)/\?token=(\S+)',
                             self.addresses['operator'])
        assert found is not None, self.addresses
        self.port = int(found[1])
        self.tokens = {role: address.rpartition('=')[2]
                       for role, address in self.addresses.items()}
        self.host = f'127.0.0.1:{self.port}'
        wait_for(lambda: self.do('disable', 'operator', {'drive': '/lift'}).said['success'],
                 'that the panel reaches the drives')

    def write_profile(self, *changes: tuple[str, str]) -> None:
        """Write the profile of a drive, with changes."""
        write_profiles(self._directory, *changes)

    def start_bridge(self) -> Running:
        """Start the bridge, once more after it has ended."""
        return self._run('drive_can_bridge', '--ros-args', '--params-file', str(self._file), '-p',
                         f'buses.main.channel:={self._links / "main"}')

    def ask(self, method: str, path: str, role: str | None = None,
            headers: Mapping[str, str] | None = None, body: bytes | None = None) -> Answer:
        """Send a request; headers may take the place of the usual ones."""
        connection = HTTPConnection('127.0.0.1', self.port, timeout=60.0)
        try:
            connection.request(method, path, body, {**self.cookie(role), **(headers or {})})
            response: HTTPResponse = connection.getresponse()
            return Answer(response.status, {name.lower(): value
                                            for name, value in response.getheaders()},
                          response.read())
        finally:
            connection.close()

    def check_alive(self) -> None:
        """Panel and bridge go on, and nobody was shown a traceback."""
        assert self.get(FILE_OF_PANEL, 'viewer').status == 200
        for process in (self.panel, self.bridge):
            assert process.process.poll() is None
            assert 'Traceback' not in process.errors
