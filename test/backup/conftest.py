# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives of all families for the tests of backups."""

from collections.abc import Iterator
import os
from pathlib import Path
import sys

from backup_builders import Command, Said, Shop, shop
import pytest

from drive_can_bridge.cli.main import main


@pytest.fixture(name='shop')
def shop_fixture(tmp_path: Path, bench: object) -> Iterator[Shop]:
    """Give drives to each test."""
    with shop(tmp_path) as made:
        yield made


@pytest.fixture(name='command')
def command_fixture(shop: Shop, capsys: pytest.CaptureFixture[str],
                    monkeypatch: pytest.MonkeyPatch) -> Iterator[Command]:
    """Run a command on the drives of the shop, where nobody can be asked."""
    monkeypatch.chdir(shop.folder)
    with open(os.devnull, encoding='ascii') as nobody:
        monkeypatch.setattr(sys, 'stdin', nobody)

        def run(*words: str, direct: bool = True) -> Said:
            way = ['--params-file', str(shop.file), '--nmt-start'] if direct else []
            code = main([*words, *way])
            found = capsys.readouterr()
            return Said(code, found.out.splitlines(), found.err.splitlines())
        yield run
