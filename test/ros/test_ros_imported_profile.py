# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A table of 300 rows becomes a profile, and that runs: at both ends of the bus."""

from pathlib import Path

from bridges import CONVEYOR, parameters, StartBridge
from clients import Client
import pytest
from rcl_interfaces.srv import ListParameters

from drive_can_bridge.cli.main import main
from drive_can_bridge.core import sentences

HEAD = """\
Antrieb Müller – Parameterliste;;;;;;;;
Nr.;Bezeichnung;Einheit;Auflösung;Min;Max;Zugriff;Datentyp;Speicher
50;Speed setpoint;1/min;0,1;-3.000;3.000;R/W;INT16;RAM
209;Actual speed;1/min;0,1;;;R;INT16;
30;Rampenzeit;s;0,01;0,01;60;R/W;UINT16;EEPROM
"""


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Write a spreadsheet of 300 rows as Windows does it."""
    rows = [f'{300 + n};Einstellung {n};{"Hz" if n % 2 else ""};{"0,1" if n % 2 else ""};;;R/W;'
            'UINT16;EEPROM' for n in range(297)]
    path = tmp_path / 'antrieb.csv'
    path.write_bytes((HEAD + '\n'.join(rows) + '\n').replace('\n', '\r\n').encode('cp1252'))
    return path


def test_bridge_and_simulated_drive_speak_it(bridge: StartBridge, client: Client, table: Path,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    profile = table.with_suffix('.yaml')
    assert main(['profile', 'import', str(table), '-o', str(profile)]) == 0
    assert '300 of 300 entries' in capsys.readouterr().out
    one = bridge(parameters(conveyor={
        **CONVEYOR, 'profile': str(profile), 'cyclic_request': ['speed_setpoint'],
        'cyclic_response': ['actual_speed']})).online()
    names = client.call('/conveyor/list_parameters', ListParameters).result.names
    assert len(names) == 300
    assert {'rampenzeit', 'einstellung_0', 'einstellung_296'} <= set(names)
    one.played['conveyor'].set_value('einstellung_5', 12.3)
    one.played['conveyor'].set_value('einstellung_6', 1000)
    assert client.get('/conveyor', 'einstellung_5', 'einstellung_6') == [12.3, 1000]
    assert client.set('/conveyor', rampenzeit=2.5) == [(True, '')]
    assert one.played['conveyor'].value('rampenzeit') == 2.5
    allowed = '0.01 to 60 s'
    assert client.set('/conveyor', rampenzeit=61.0) == [
        (False, sentences.out_of_range('61', allowed))]
