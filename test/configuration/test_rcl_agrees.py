# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Ask rcl itself: what it reads from a file is what our reader reads, and what it refuses we refuse.

One further process reads all documents with rclpy, each into a context and node of its own.
"""

import json
from pathlib import Path
import subprocess
import sys
from typing import Any

from configuration_builders import SCALARS
import pytest

from drive_can_bridge.configuration.parameter_file import read_parameter_file

PROBE = """
import json, sys
import rclpy
from rclpy.context import Context
from rclpy.node import Node

answers = []
for path in json.load(sys.stdin):
    context = Context()
    try:
        rclpy.init(args=['--ros-args', '--params-file', path, '--log-level', 'FATAL'],
                   context=context)
    except Exception as error:
        answers.append(None)
        continue
    node = Node('drive_can_bridge', context=context, enable_rosout=False,
                start_parameter_services=False)
    answers.append({name: repr(parameter.value)
                    for name, parameter in node._parameter_overrides.items()})
    node.destroy_node()
    rclpy.shutdown(context=context)
print(json.dumps(answers))
"""

HEAD = '/**/drive_can_bridge:\n  ros__parameters:\n    buses: x\n'

#: taken by both
TAKEN = [
    *(f'    a: {text}\n' for text, _ in SCALARS),
    '    a: "5"\n', "    a: 'yes'\n", '    a: !!str 5\n', '    a: !!int "5"\n', '    a: !x 5\n',
    '    a: ""\n', '    a: &b 5\n', '    a: |\n      5\n', '    a: |-\n      5\n',
    '    a: >-\n      yes\n', '    a: "\\x35"\n', '    a: ! 5\n',
    '    a: []\n', '    a: [1, 2]\n', '    a: [0x10, 010]\n', '    a: [1.5, .inf]\n',
    '    a: [yes, off]\n', '    a: [x, "1", null]\n', '    a: [1,]\n', '    a:\n      - x\n',
    '    a:\n    - x\n    - y z\n', '    a: !!seq [1]\n',
    '    a: {b: 1, c: {d: 2}, e: 3}\n    f: 4\n', '    a:\n      b: []\n      c: 1\n',
    '    a:\n      b:\n        c: 1\n    d:\n      e: {f: 1, g: [x]}\n    h: 1\n',
    '    1: 2\n    true: 3\n    "a b": 4\n    a-b: 5\n', '    ? a\n    : 1\n',
    '    "a": 1 # comment\n', 'x:\n  ros__parameters: {a.b: 1, c: 5}\n',
    # of several sections that are for the node the later one counts, parameter by parameter
    '    a: 1\n/**:\n  ros__parameters: {a: 2, b: 3}\n',
    '    a: {p: 1, q: 2}\n/**:\n  ros__parameters: {a: {p: x, r: 3}}\n',
    '    a: [u, v]\n/*:\n  ros__parameters: {a: [z]}\n',
    '    a: [u, v]\n/**:\n  ros__parameters: {a: []}\n',
    '    a: 1\ndrive_can_bridge:\n  ros__parameters: {a: x}\n',
    '    a: 1\n/**:\n  drive_can_bridge:\n    other:\n      ros__parameters: {a: 2}\n',
    '    a: 1\n/drive_can_bridge:\n  ros__parameters: {a: 2}\n'
    '/**:\n  drive_can_bridge:\n    ros__parameters: {a: 3}\n',
    '    a: 1\n/**/other:\n  ros__parameters: {a: 2}\n',
    '    a: 1\n/*/drive_can_bridge:\n  ros__parameters: {a: 2}\n',
]

#: refused by both, or read by rcl in a way nobody means
REFUSED = [
    '    a:\n', '    a: *x\n', '    a: &x 1\n    b: *x\n', '    a: [1, 2.0]\n', '    a: [x, 1]\n',
    '    a: [x, yes]\n', '    a: [[1], [2]]\n', '    a: {b}\n', '    a: {b: 1, c: }\n',
    '    "": 1\n', '    ? [a]\n    : 1\n', 'x:\n', 'x:\n  a: 1\n',
    'x y:\n  ros__parameters: {a: 1}\n', '//x:\n  ros__parameters: {a: 1}\n',
    '/x/:\n  ros__parameters: {a: 1}\n', 'x:\n  ros__parameters: 5\n', 'ros__parameters: {a: 1}\n',
    'x:\n  ros__parameters: {a: [1, x]}\n',
    '    a: b: c\n', '    a: "open\n', '  \ta: 1\n', '    a: @x\n',
]
#: refused by us and by rcl 9.2.8 (Jazzy); passed over by rcl 10.1.3 (Kilted), which nobody means
PASSED_OVER = ['  a: {ros__parameters: {b: 1}}\n']
GARBLED = [
    '    a: {}\n    b: 1\n', '    a: {b: {}, c: 1}\n', '    a: 1\n    a: x\n',
    '    a: 1\n    a: {b: 2}\n', '    a: "x\\0y"\n', '    a: [{a: 1}]\n',
    '    a: {p: 1}\n/**:\n  ros__parameters: {a: 3}\n',
    '    a: 3\n/**:\n  ros__parameters: {a: {p: 1}}\n',
    '    a: 3\n/**:\n  ros__parameters: {b.c: 1}\n',
    '    a: [b: 1]\n', '    a: [[], 1]\n', '    ? {a: 1}\n    : 1\n',
]


@pytest.fixture(scope='module')
def rcl(tmp_path_factory: pytest.TempPathFactory, programs: None) -> dict[str, Any]:
    """Return what rcl reads from every document; None where it refuses."""
    pytest.importorskip('rclpy')
    folder = tmp_path_factory.mktemp('documents')
    documents = [*TAKEN, *REFUSED, *PASSED_OVER, *GARBLED]
    paths = []
    for number, document in enumerate(documents):
        path = folder / f'{number}.yaml'
        path.write_text(HEAD + document, encoding='utf-8')
        paths.append(str(path))
    done = subprocess.run([sys.executable, '-c', PROBE], input=json.dumps(paths), text=True,
                          capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    return dict(zip(documents, json.loads(done.stdout.splitlines()[-1])))


def ours(folder: Path, document: str) -> tuple[dict[str, str], list[str]]:
    path = folder / 'f.yaml'
    path.write_text(HEAD + document, encoding='utf-8')
    tree, problems = read_parameter_file(path)
    values: dict[str, str] = {}

    def flatten(data: dict[str, Any], prefix: str) -> None:
        for key, value in data.items():
            if isinstance(value, dict):
                flatten(value, f'{prefix}{key}.')
            else:
                values[prefix + key] = repr(None if value == [] else value)

    if tree is not None:
        flatten(tree.data, '')
    return values, [str(problem) for problem in problems]


@pytest.mark.parametrize('document', TAKEN)
def test_both_read_the_same(tmp_path: Path, rcl: dict[str, Any], document: str) -> None:
    values, problems = ours(tmp_path, document)
    assert problems == []
    assert values == rcl[document]


@pytest.mark.parametrize('document', REFUSED)
def test_both_refuse(tmp_path: Path, rcl: dict[str, Any], document: str) -> None:
    assert rcl[document] is None
    assert ours(tmp_path, document)[1] != []


@pytest.mark.parametrize('document', PASSED_OVER)
def test_nothing_is_passed_over(tmp_path: Path, rcl: dict[str, Any], document: str) -> None:
    assert not [name for name in rcl[document] or () if name.endswith('b')]
    assert ours(tmp_path, document)[1] != []


@pytest.mark.parametrize('document', GARBLED)
def test_garbled_by_rcl(tmp_path: Path, rcl: dict[str, Any], document: str) -> None:
    """We refuse these; should rcl ever learn to read one, its row moves to the first list."""
    values, problems = ours(tmp_path, document)
    assert problems != []
    assert rcl[document] is None or rcl[document] != values or 'duplicate' in problems[0]
