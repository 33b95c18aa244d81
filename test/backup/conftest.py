# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives of all families for the tests of backups."""

from collections.abc import Iterator
from pathlib import Path

from backup_builders import Shop, shop
import pytest


@pytest.fixture(name='shop')
def shop_fixture(tmp_path: Path, bench: object) -> Iterator[Shop]:
    """Give drives to each test."""
    with shop(tmp_path) as made:
        yield made
