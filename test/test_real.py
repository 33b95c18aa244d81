# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The list of what ``make test`` tells of what is real."""

import ast
from pathlib import Path

import pytest
from real import FIXTURES, TOLD

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize('told', TOLD)
def test_what_is_told_is_there(told: str) -> None:
    file, *name = told.partition('[')[0].split('::')
    tree = ast.parse((ROOT / file).read_text(encoding='utf-8'))
    names = {node.name for node in ast.walk(tree)
             if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    assert names.issuperset(name)


def test_what_is_told_is_short() -> None:
    assert len(TOLD) <= 25
    assert all((ROOT / directory).is_dir() for directory in FIXTURES)
