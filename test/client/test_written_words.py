# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What ``drive_can write`` says below its table: that a value is lost at power-off, and why."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from builders import EEPROM, parameter, RAM
import pytest

from drive_can_bridge.cli.write import _show
from drive_can_bridge.client.drive import WriteOutcome

RAMP = parameter('ramp', None, index=0x6083, subindex=0, storage=RAM)
KEPT = parameter('kept', None, index=0x2001, subindex=0, storage=EEPROM)
STORE = parameter('store_parameters', None, index=0x1010, subindex=1, storage=RAM)
LOST = 'not stored: lost at power-off; to store all of it: '
COMMAND = 'drive_can write axis x1010.1=0x65766173'


def below(capsys: pytest.CaptureFixture[str], written: Any, *, ok: bool = True,
          protocol: str = 'cia402', json: bool = False, params_file: Path | None = None,
          namespace: str | None = None) -> list[str]:
    """Return what is printed behind the row of one value."""
    drive: Any = SimpleNamespace(name='axis', facts=SimpleNamespace(protocol=protocol),
                                 rounded=lambda _, value: value, unnamed=lambda *_: None)
    args: Any = SimpleNamespace(json=json, params_file=params_file, namespace=namespace)
    _show(args, [drive], {written.name: '1'},  # type: ignore[arg-type]
          [(drive, WriteOutcome(written.name, ok, written, '' if ok else 'no answer'))])
    return capsys.readouterr().out.splitlines()[1 if json else 2:]


def test_what_is_in_the_ram_of_a_servo_drive_is_told_to_be_lost(
        capsys: pytest.CaptureFixture[str]) -> None:
    assert below(capsys, RAMP) == [f'{LOST}{COMMAND}']


@pytest.mark.parametrize(('options', 'words'), [
    ({'params_file': Path('my drives.yaml')}, "-p 'my drives.yaml'"),
    ({'namespace': '/cell1'}, '--namespace /cell1')])
def test_the_command_that_stores_goes_the_same_way(
        options: dict[str, Any], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert below(capsys, RAMP, **options) == [f'{LOST}{COMMAND} {words}']


@pytest.mark.parametrize('written', [KEPT, STORE])
def test_what_is_kept_or_what_stores_is_not(capsys: pytest.CaptureFixture[str],
                                            written: Any) -> None:
    assert below(capsys, written) == []


def test_nothing_is_said_of_what_was_not_written(capsys: pytest.CaptureFixture[str]) -> None:
    assert below(capsys, RAMP, ok=False) == []
    assert below(capsys, RAMP, json=True) == []
    assert below(capsys, RAMP, protocol='datamodel_extended') == []
