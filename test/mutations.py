# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Change the product in one place at a time, and see whether a test is red that knows no wall clock.

    mutations.py [--seed N] [--places N] [--at FILE:LINE] [--list]

Places are drawn by the seed over conditions, comparisons, ``and``/``or`` and constants of
:data:`FOLDERS`. Each is changed in a copy of the checkout: first the tests run that stand nearest,
then all others of the deterministic part. What survives is printed with the change, and makes the
exit code 1: a survivor is a test that is missing, or a place that makes no difference (say which).
"""

import argparse
import ast
from collections.abc import Iterator
import os
from pathlib import Path
import random
import shutil
import subprocess
import sys
import tempfile
from typing import NamedTuple

from extent import PROFILE
from side_by_side import WANTED

ROOT = Path(__file__).parents[1]
PACKAGE = 'drive_can_bridge'
FOLDERS = ('core', 'protocols', 'exchange', 'transport', 'ros', 'client')
#: comparison -> what stands there instead
OTHER: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}


class Change(NamedTuple):
    """One place, and what stands there instead; line and columns as in :mod:`ast`."""

    file: str
    node: ast.expr
    text: str

    def __str__(self) -> str:
        lines = (ROOT / self.file).read_text().splitlines()
        return (f'{self.file}:{self.node.lineno}: {lines[self.node.lineno - 1].strip()}\n'
                f'    {ast.unparse(self.node)}  ->  {self.text}')

    def apply(self, root: Path) -> None:
        """Write it into a copy of the checkout."""
        path = root / self.file
        lines = path.read_bytes().splitlines(keepends=True)
        first, last = self.node.lineno - 1, (self.node.end_lineno or 0) - 1
        head = lines[first][:self.node.col_offset]
        tail = lines[last][self.node.end_col_offset:]
        lines[first:last + 1] = [head + f'({self.text})'.encode() + tail]
        path.write_bytes(b''.join(lines))


def changes(file: str) -> Iterator[Change]:
    """Go through all places of a file."""
    tree = ast.parse((ROOT / file).read_text())
    left_out: set[ast.AST] = set()
    for node in ast.walk(tree):
        parts: list[ast.AST] = []
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            parts = [each for each in (node.returns, *(
                argument.annotation for argument in ast.walk(node.args)
                if isinstance(argument, ast.arg))) if each]
        elif isinstance(node, ast.AnnAssign):
            parts = [node.annotation]
        elif isinstance(node, ast.JoinedStr):   # columns inside are none before Python 3.12
            parts = [node]
        elif isinstance(node, ast.If) and 'TYPE_CHECKING' in ast.unparse(node.test):
            parts = [node]
        elif isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == '__slots__':
            parts = [node]
        for part in parts:
            left_out.update(ast.walk(part))
    for node in ast.walk(tree):
        if node in left_out:
            continue
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            other = ast.Compare(node.left, [OTHER[type(node.ops[0])]()], node.comparators)
            yield Change(file, node, ast.unparse(other))
        elif isinstance(node, ast.BoolOp):
            swapped = ast.Or() if isinstance(node.op, ast.And) else ast.And()
            yield Change(file, node, ast.unparse(ast.BoolOp(swapped, node.values)))
        elif isinstance(node, (ast.If, ast.IfExp, ast.While)) and not isinstance(
                node.test, (ast.Compare, ast.BoolOp, ast.Constant)):
            yield Change(file, node.test, f'not ({ast.unparse(node.test)})')
        elif isinstance(node, ast.Constant) and isinstance(node.value, (bool, int, float)):
            value = node.value
            yield Change(file, node, repr(not value if isinstance(value, bool)
                                          else value + 1 if isinstance(value, int)
                                          else value * 2 or 1.0))


def nearest(file: str) -> list[str]:
    """Return the tests that name a module, else those of its folder."""
    dotted = file.removesuffix('.py').replace('/', '.')
    tests = [path for path in sorted((ROOT / 'test').rglob('test_*.py'))
             if dotted in path.read_text()]
    folder = ROOT / 'test' / Path(file).relative_to(PACKAGE).parent
    if not tests and folder.is_dir():
        tests = sorted(folder.rglob('test_*.py'))
    return [str(path.relative_to(ROOT)) for path in tests]


def red(root: Path, *files: str) -> str:
    """Run tests in a copy, or all of them; return what was red first, or ''."""
    how = ['-m', 'pytest'] if files else ['test/side_by_side.py']
    command = [sys.executable, *how, '-q', '-x', '-m', f'{WANTED} and not real',
               '-p', 'no:cacheprovider', *files]
    try:
        done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=900,
                              env={**os.environ, PROFILE: 'long'})
    except subprocess.TimeoutExpired:
        return 'it took longer than 15 minutes'
    if done.returncode in (0, 5):
        return ''
    lines = [line for line in done.stdout.splitlines() if line.startswith(('FAILED', 'ERROR'))]
    return lines[0] if lines else f'exit code {done.returncode}'


def judge(change: Change) -> str:
    """Return what was red first in a copy with the change, or ''."""
    with tempfile.TemporaryDirectory() as place:
        root = Path(place) / 'copy'
        shutil.copytree(ROOT, root, symlinks=True, ignore=shutil.ignore_patterns(
            '.venv', '.git', '__pycache__', '*.egg-info', '.*_cache'))
        change.apply(root)
        near = nearest(change.file)
        return (near and red(root, *near)) or red(root)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--places', type=int, default=60)
    parser.add_argument('--at', default='', help='FILE:LINE: only what stands there')
    parser.add_argument('--list', action='store_true', help='say what would be changed')
    arguments = parser.parse_args()
    files = [str(path.relative_to(ROOT)) for folder in FOLDERS
             for path in sorted((ROOT / PACKAGE / folder).rglob('*.py'))]
    found = [change for file in files for change in changes(file)]
    if arguments.at:
        drawn = [each for each in found if f'{each.file}:{each.node.lineno}' == arguments.at]
    else:
        drawn = random.Random(arguments.seed).sample(found, arguments.places)
    print(f'{len(drawn)} of {len(found)} places, seed {arguments.seed}', flush=True)
    survivors = 0
    for number, change in enumerate(drawn, 1):
        print(f'{number}. {change}', flush=True)
        if arguments.list:
            continue
        first = judge(change)
        survivors += not first
        print(f'    {first or "SURVIVED"}', flush=True)
    print(f'{survivors} of {len(drawn)} survived')
    return bool(survivors)


if __name__ == '__main__':
    sys.exit(main())
