# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The list of the real tests that ``make test`` runs."""

import ast
from pathlib import Path

import pytest
from real import CHOSEN, files, FIXTURES, part

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize('chosen', CHOSEN)
def test_what_is_chosen_is_there(chosen: str) -> None:
    file, *name = chosen.partition('[')[0].split('::')
    tree = ast.parse((ROOT / file).read_text(encoding='utf-8'))
    names = {node.name for node in ast.walk(tree)
             if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    assert names.issuperset(name)


def test_what_is_chosen_is_short() -> None:
    assert len(CHOSEN) <= 25
    assert all((ROOT / directory).is_dir() for directory in FIXTURES)


def test_none_is_lost_between_the_two_parts() -> None:
    system, others = part('system'), part('others')
    assert sorted(system + others) == files(everything=True) == part('')
    assert len(system) > 10 and FIXTURES.keys() <= {*others}
