# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The launch files: their arguments always, what they start wherever launch is installed."""

import ast
import importlib
import importlib.util
from pathlib import Path
from typing import Any

import pytest

LAUNCH = Path(__file__).parents[2] / 'launch'
ARGUMENTS = {
    'bridge.launch.py': ['params_file', 'namespace', 'name', 'log_level'],
    'demo.launch.py': ['params_file', 'drive', 'fault', 'log_frames'],
}
#: arguments without a default: launch refuses to start without them
REQUIRED = {'bridge.launch.py': ['params_file'], 'demo.launch.py': []}


def calls(tree: ast.AST, name: str) -> list[ast.Call]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name) and node.func.id == name]


def text(node: ast.expr) -> str:
    value = ast.literal_eval(node)
    assert isinstance(value, str)
    return value


@pytest.fixture(params=sorted(ARGUMENTS))
def file(request: pytest.FixtureRequest) -> Path:
    return LAUNCH / str(request.param)


def test_there_are_no_others() -> None:
    assert {path.name for path in LAUNCH.glob('*')} - {'__pycache__'} == set(ARGUMENTS)


def test_arguments_are_declared_described_and_used(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding='utf-8'), file.name)
    compile(tree, file.name, 'exec')
    declared = calls(tree, 'DeclareLaunchArgument')
    assert [text(call.args[0]) for call in declared] == ARGUMENTS[file.name]
    keywords = [{keyword.arg: keyword.value for keyword in call.keywords} for call in declared]
    assert all(text(entry['description']) for entry in keywords)
    assert [text(call.args[0]) for call, entry in zip(declared, keywords)
            if 'default_value' not in entry] == REQUIRED[file.name]
    used = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    assert used.issuperset(ARGUMENTS[file.name])
    assert len(calls(tree, 'LaunchConfiguration')) > 0


def test_the_executables_exist(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding='utf-8'), file.name)
    named = [text(keyword.value) for node in ast.walk(tree) if isinstance(node, ast.Call)
             for keyword in node.keywords if keyword.arg == 'executable']
    assert named
    scripts = (LAUNCH.parent / 'setup.py').read_text(encoding='utf-8')
    assert all(f"'{name} = " in scripts for name in named)


# -- with launch ----------------------------------------------------------------------------------

@pytest.fixture
def description(file: Path) -> Any:
    # a directory called launch in the path looks like a package, and has no such module
    pytest.importorskip('launch.launch_description')
    pytest.importorskip('launch_ros.actions')
    specification = importlib.util.spec_from_file_location('launch_file', file)
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module.generate_launch_description()


def test_launch_takes_it(description: Any, file: Path) -> None:
    arguments = description.get_launch_arguments()
    assert [argument.name for argument in arguments] == ARGUMENTS[file.name]


def test_what_is_started_gets_the_arguments(description: Any, file: Path, tmp_path: Path) -> None:
    launch: Any = importlib.import_module('launch')
    actions: Any = importlib.import_module('launch.actions')
    context = launch.LaunchContext()
    given = {'params_file': str(tmp_path / 'bridge.yaml'), 'namespace': 'cell',
             'log_level': 'debug', 'drive': 'true', 'fault': 'a:silent b:off'}
    context.launch_configurations.update(
        {name: value for name, value in given.items() if name in ARGUMENTS[file.name]})
    started: list[Any] = []
    for entity in description.entities:
        if isinstance(entity, actions.DeclareLaunchArgument):
            entity.execute(context)
        elif isinstance(entity, actions.OpaqueFunction):
            started += entity.execute(context) or []
        else:
            started.append(entity)
    [process] = started
    # the first is the executable, which need not be installed here
    words = [''.join(part.perform(context) for part in word) for word in process.cmd[1:]
             if not any(type(part).__name__ == 'LocalSubstitution' for part in word)]
    if file.name == 'demo.launch.py':
        assert words == ['demo', '--params-file', given['params_file'], '--fault', 'a:silent',
                         '--fault', 'b:off', '--drive']
    else:
        assert words[:3] == ['--ros-args', '--log-level', 'debug']
        assert process.node_package == 'drive_can_bridge'
        assert process.node_executable == 'drive_can_bridge'
