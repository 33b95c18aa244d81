# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Listening to a gateway that closes the connection meanwhile."""

from pathlib import Path
import threading

from asked_bus import drive_can
from clocks import REAL
from literal_adapters import Socketcand
import pytest

FILE = """
/**/drive_can_bridge:
  ros__parameters:
    buses:
      main: {{interface: socketcand, channel: can0, host: 127.0.0.1, port: {port},
             reconnect_period: 0.1}}
"""


@pytest.mark.usefixtures('threads')
@pytest.mark.parametrize('command', ['record', 'decode'])
@pytest.mark.parametrize('closes', [True, False])
def test_bus_that_was_lost_meanwhile(command: str, closes: bool, tmp_path: Path,
                                     capsys: pytest.CaptureFixture[str]) -> None:
    gateway = Socketcand()

    def speak() -> None:
        end = REAL.now() + 20.0
        for connection in range(1, 2 + closes):
            while gateway.raw < connection and REAL.now() < end:
                REAL.wait(REAL.now() + 0.01)
            for _ in range(10):
                gateway.say('< frame 123 1700000000.5 01 >')
                REAL.wait(REAL.now() + 0.02)
            if closes and connection == 1:
                gateway.drop()
    speaker = threading.Thread(target=speak)
    file = tmp_path / 'bus.yaml'
    file.write_text(FILE.format(port=gateway.port), encoding='utf-8')
    speaker.start()
    words = ['-o', tmp_path / 'x.log'] if command == 'record' else ['--live']
    try:
        code = drive_can(command, *words, '-p', file, '--seconds', 3)
    finally:
        speaker.join()
        gateway.close()
    told = capsys.readouterr()
    assert code == (1 if closes else 0)
    if closes:
        assert told.err == (
            f'bus main: receive: the gateway 127.0.0.1:{gateway.port} has closed the connection; '
            'tried again every 0.1 s\nbus main: open again\n')
    else:
        assert told.err == ''
    if command == 'record':
        # stamps are the host's: of this year, not the gateway's
        first = (tmp_path / 'x.log').read_text(encoding='utf-8').splitlines()[0]
        assert abs(float(first[1:].split(')')[0]) - 1e-9 * REAL.stamp()) < 60.0
