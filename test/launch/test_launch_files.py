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
    'bridge_per_bus.launch.py': ['params_file', 'namespace', 'log_level'],
    'demo.launch.py': ['params_file', 'drive', 'fault', 'log_frames'],
    'managed.launch.py': ['params_file', 'namespace', 'name', 'log_level', 'activate'],
    'ros2_control.launch.py': ['robot', 'directory', 'params_file', 'controller', 'log_level'],
    'two_bridges.launch.py': ['first_params_file', 'second_params_file', 'first_namespace',
                              'second_namespace', 'log_level'],
}
#: arguments without a default: launch refuses to start without them
REQUIRED = {'bridge.launch.py': ['params_file'], 'bridge_per_bus.launch.py': ['params_file'],
            'demo.launch.py': [], 'managed.launch.py': ['params_file'],
            'ros2_control.launch.py': [],
            'two_bridges.launch.py': ['first_params_file', 'second_params_file']}
#: files whose work is done by others
INCLUDED = {'two_bridges.launch.py': ['bridge.launch.py']}


def calls(tree: ast.AST, name: str) -> list[ast.Call]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name) and node.func.id == name]


def text(node: ast.expr) -> str:
    value = ast.literal_eval(node)
    assert isinstance(value, str)
    return value


def texts(tree: ast.AST) -> set[str]:
    """Return all texts, and all pieces of f-strings put together with each of ``first second``."""
    found = {node.value for node in ast.walk(tree)
             if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            tail = ''.join(part.value for part in node.values
                           if isinstance(part, ast.Constant) and isinstance(part.value, str))
            found.update(f'{which}{tail}' for which in ('first', 'second'))
    return found


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
    assert len(calls(tree, 'LaunchConfiguration')) > 0
    for call in declared:  # what is looked up is something else than the declaration
        call.args.clear()
    assert texts(tree).issuperset(ARGUMENTS[file.name])


def test_the_executables_exist(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding='utf-8'), file.name)
    named = [text(given['executable']) for given in (
        {keyword.arg: keyword.value for keyword in node.keywords}
        for node in ast.walk(tree) if isinstance(node, ast.Call))
        if 'executable' in given and text(given['package']) == 'drive_can_bridge']
    included = [name for name in texts(tree) if name.endswith('.launch.py')]
    assert included == INCLUDED.get(file.name, [])
    assert all((LAUNCH / name).is_file() for name in included)
    assert bool(named) is not bool(included)
    scripts = (LAUNCH.parent / 'setup.py').read_text(encoding='utf-8')
    assert all(f"'{name} = " in scripts for name in named)


# -- with launch ----------------------------------------------------------------------------------

GIVEN = {'namespace': 'cell', 'log_level': 'debug', 'drive': 'true', 'fault': 'a:silent b:off',
         'activate': 'true', 'robot': 'base', 'controller': 'base_controller',
         'directory': str(LAUNCH.parent / 'config' / 'ros2_control')}


TWO_BUSES = """
/**/drive_can_bridge:
  ros__parameters:
    buses:
      left: {interface: virtual, channel: left}
      right-1: {interface: virtual, channel: right}
    drives:
      conveyor: {bus: left, protocol: datamodel_extended, station: 1, profile: datamodel_example,
                 cyclic_request: [speed_setpoint], cyclic_response: [actual_speed]}
      lift: {bus: right-1, protocol: datamodel_extended, station: 1, profile: datamodel_example,
             cyclic_request: [speed_setpoint], cyclic_response: [actual_speed]}
"""


class Launched:
    """A launch file, loaded and performed as far as it goes without starting anything."""

    def __init__(self, file: Path, directory: Path, **given: str) -> None:
        # a directory called launch in the path looks like a package, and has no such module
        pytest.importorskip('launch.launch_description')
        pytest.importorskip('launch_ros.actions')
        specification = importlib.util.spec_from_file_location('launch_file', file)
        assert specification is not None and specification.loader is not None
        module = importlib.util.module_from_spec(specification)
        specification.loader.exec_module(module)
        self.description: Any = module.generate_launch_description()
        launch: Any = importlib.import_module('launch')
        self._actions: Any = importlib.import_module('launch.actions')
        self.context = launch.LaunchContext()
        self.context.extend_locals({'current_launch_file_directory': str(LAUNCH)})
        self.params_file = str(directory / 'bridge.yaml')
        Path(self.params_file).write_text(TWO_BUSES, encoding='utf-8')
        self.context.launch_configurations.update({
            name: value for name, value in
            {**GIVEN, 'params_file': self.params_file, 'first_params_file': '/1.yaml',
             'second_params_file': '/2.yaml', **given}.items() if name in ARGUMENTS[file.name]})
        self.processes: list[Any] = []
        self.handlers: list[Any] = []
        self._perform(self.description.entities)

    def _perform(self, entities: Any) -> None:
        actions = self._actions
        for entity in entities:
            if isinstance(entity, (actions.DeclareLaunchArgument,
                                   actions.SetLaunchConfiguration)):
                entity.execute(self.context)
            elif isinstance(entity, (actions.OpaqueFunction, actions.IncludeLaunchDescription)):
                self._perform(entity.execute(self.context) or [])
            elif isinstance(entity, actions.RegisterEventHandler):
                self.handlers.append(entity.event_handler)
            elif isinstance(entity, actions.ExecuteProcess):
                # an included file has arguments of its own, which count now and not later
                entity.seen = dict(self.context.launch_configurations)
                entity.words = self._words(entity)
                self.processes.append(entity)
            elif hasattr(entity, 'entities'):  # an included description
                self._perform(entity.entities)

    def _words(self, process: Any) -> list[str]:
        """Return the command line without the executable, which need not be installed here."""
        return [''.join(part.perform(self.context) for part in word) for word in process.cmd[1:]
                if not any(type(part).__name__ == 'LocalSubstitution' for part in word)]


@pytest.mark.parametrize('name', ['bridge.launch.py', 'managed.launch.py'])
def test_the_bridge_gets_the_arguments(name: str, tmp_path: Path) -> None:
    launched = Launched(LAUNCH / name, tmp_path)
    [process] = launched.processes
    assert process.words[:3] == ['--ros-args', '--log-level', 'debug']
    assert process.node_package == process.node_executable == 'drive_can_bridge'


def test_the_demo_gets_the_arguments(tmp_path: Path) -> None:
    launched = Launched(LAUNCH / 'demo.launch.py', tmp_path)
    [process] = launched.processes
    assert process.words == ['demo', '--params-file', launched.params_file, '--fault',
                                 'a:silent', '--fault', 'b:off', '--drive']


def test_two_bridges_have_a_file_and_a_namespace_each(tmp_path: Path) -> None:
    launched = Launched(LAUNCH / 'two_bridges.launch.py', tmp_path)
    assert [(process.seen['params_file'], process.seen['namespace'])
            for process in launched.processes] == [('/1.yaml', 'cell1'), ('/2.yaml', 'cell2')]
    for process in launched.processes:
        assert process.words[:3] == ['--ros-args', '--log-level', 'debug']


def test_each_bus_has_a_bridge_of_its_own(tmp_path: Path) -> None:
    launched = Launched(LAUNCH / 'bridge_per_bus.launch.py', tmp_path)
    assert [process.words[:3] for process in launched.processes] == [
        ['--ros-args', '--log-level', 'debug']] * 2
    assert [process._Node__node_name for process in launched.processes] == [
        'drive_can_bridge_left', 'drive_can_bridge_right_1']


@pytest.mark.parametrize(('controller', 'loaded'), [('other', 'other'), ('', 'base_controller')])
def test_ros2_control_gets_the_bridge_and_its_description(tmp_path: Path, controller: str,
                                                          loaded: str) -> None:
    launched = Launched(LAUNCH / 'ros2_control.launch.py', tmp_path, controller=controller)
    bridge, publisher, manager, broadcaster, spawner = launched.processes
    assert bridge.words[:3] == ['--ros-args', '--log-level', 'debug']
    assert {'~/joint_states:=/robot_joint_states',
            '~/joint_commands:=/robot_joint_commands'} <= set(bridge.words)
    assert [process.node_package for process in (publisher, manager)] == [
        'robot_state_publisher', 'controller_manager']
    assert broadcaster.words[0] == 'joint_state_broadcaster'
    assert spawner.words[:2] == [loaded, '--inactive']


@pytest.mark.parametrize('activate', ['true', 'false'])
def test_managed_means_configure_then_activate(tmp_path: Path, activate: str) -> None:
    launched = Launched(LAUNCH / 'managed.launch.py', tmp_path, activate=activate)
    [bridge] = launched.processes
    lifecycle: Any = importlib.import_module('launch_ros.events.lifecycle')
    events: Any = importlib.import_module('launch.events.process')
    messages: Any = importlib.import_module('lifecycle_msgs.msg')

    def asked(event: Any) -> list[str]:
        """Return what follows from an event: transitions to be asked for, or the end."""
        found = []
        for handler in launched.handlers:
            if not handler.matches(event):
                continue
            for entity in handler.handle(event, launched.context) or []:
                if entity.condition is not None and not entity.condition.evaluate(
                        launched.context):
                    continue
                inner = getattr(entity, 'event', None)
                if isinstance(inner, lifecycle.ChangeState):
                    assert inner.lifecycle_node_matcher(bridge)
                    found.append(lifecycle.ChangeState.valid_transitions[inner.transition_id])
                else:
                    found.append(type(entity).__name__)
        return found

    def reached(start: str, goal: str) -> Any:
        message = messages.TransitionEvent()
        message.start_state.label, message.goal_state.label = start, goal
        return lifecycle.StateTransition(action=bridge, msg=message)
    started = events.ProcessStarted(action=bridge, name='bridge', cmd=[], cwd=None, env=None,
                                    pid=1)
    assert asked(started) == ['TRANSITION_CONFIGURE']
    assert asked(reached('configuring', 'inactive')) == (
        ['TRANSITION_ACTIVATE'] if activate == 'true' else [])
    assert asked(reached('configuring', 'unconfigured')) == ['Shutdown']
    assert asked(reached('configuring', 'errorprocessing')) == ['Shutdown']     # a defect
    assert asked(reached('errorprocessing', 'unconfigured')) == []
    assert asked(reached('deactivating', 'inactive')) == []  # whoever stops it means it
