# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The file of a backup: what is written is read again, by us and by rclpy; the rest is refused."""

from pathlib import Path

from hypothesis import given, settings, strategies as st
import pytest
import yaml

from drive_can_bridge.backup.document import Backup, Head, head_of, node_of, read_backup, written
from drive_can_bridge.client.drive import DriveFacts
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.profile import RestoreTable

FACTS = DriveFacts('conveyor', 'main', 'socketcan', 'can0', 125000, 'datamodel_extended', 1,
                   'datamodel_example', 'ab' * 32, RestoreTable())
SETTINGS = [(Parameter('ramp_time', number=30, scale=0.01, unit='s', scaled=True), 250),
            (Parameter('brake_enabled', number=34, type=ParameterType.BOOL), 1),
            (Parameter('mode', number=35, type=ParameterType.INT16), -3)]
TEXT = """\
# Settings of drive conveyor, by drive_can backup
# time: 2026-11-22T08:15:00Z
# bus: main (socketcan can0, 125000 bit/s)
# protocol: datamodel_extended
# station: 1
# profile: datamodel_example
# profile_sha256: abababababababababababababababababababababababababababababababab
# identity: firmware=10205 serial_number=4711
# left out: gain: no answer
/conveyor:
  ros__parameters:
    ramp_time: 2.5  # s
    brake_enabled: true
    mode: -3
"""


def read(folder: Path, text: str) -> Backup:
    path = folder / 'b.yaml'
    path.write_text(text)
    return read_backup(path)


def test_written() -> None:
    head = head_of(FACTS, time='2026-11-22T08:15:00Z',
                   identity='firmware=10205 serial_number=4711')
    remarks = ['left out: gain: no answer']
    assert written(FACTS, head, SETTINGS, remarks=remarks) == TEXT


def test_read(tmp_path: Path) -> None:
    backup = read(tmp_path, TEXT)
    assert backup.node == '/conveyor'
    assert backup.drive == 'conveyor'
    assert backup.values == {'ramp_time': 2.5, 'brake_enabled': True, 'mode': -3}
    head = Head(
        '2026-11-22T08:15:00Z', 'main (socketcan can0, 125000 bit/s)', 'datamodel_extended', '1',
        'datamodel_example', 'ab' * 32, 'firmware=10205 serial_number=4711')
    assert backup.head == head
    assert backup.problem('mode', 'no').split(': ') == [f'{tmp_path}/b.yaml:14', 'mode', 'no']


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig', 'utf-16'])
@pytest.mark.parametrize('before', ['', '\n', ' '])
def test_the_head_is_read_as_the_rest_is(tmp_path: Path, encoding: str, before: str) -> None:
    file = tmp_path / 'b.yaml'
    file.write_text(f'{before}# profile_sha256: abc\n# identity: serial_number=7 \u00b5\n'
                    '/conveyor:\n  ros__parameters:\n    ramp_time: 1.5\n', encoding=encoding)
    backup = read_backup(file)
    assert backup.values == {'ramp_time': 1.5}
    assert (backup.head.profile_sha256, backup.head.identity) == ('abc', 'serial_number=7 \u00b5')


def test_rclpy_reads_it_as_ros2_param_load_does(tmp_path: Path) -> None:
    parameter = pytest.importorskip('rclpy.parameter')
    (tmp_path / 'b.yaml').write_text(TEXT)
    messages = parameter.parameter_dict_from_yaml_file(
        str(tmp_path / 'b.yaml'), target_nodes=['/conveyor'], use_wildcard=True)
    assert {name: parameter.parameter_value_to_python(message.value)
            for name, message in messages.items()} == {
        'ramp_time': 2.5, 'brake_enabled': True, 'mode': -3}


def test_in_the_namespace_of_the_bridge() -> None:
    through = DriveFacts(*(getattr(FACTS, name) for name in (
        'name', 'bus', 'interface', 'channel', 'bitrate', 'protocol', 'station', 'profile',
        'profile_sha256', 'restore')), through='/cell/left/drive_can_bridge')
    assert node_of(through) == '/cell/left/conveyor'
    assert node_of(FACTS) == '/conveyor'


def test_output_of_ros2_param_dump(tmp_path: Path) -> None:
    """It sorts names, splits them at dots, and has null for what it did not get."""
    backup = read(tmp_path, '/cell/mixer:\n  ros__parameters:\n    actual: 1.25\n    flag: false\n'
                            '    p613:\n      "5": 7\n    order: null\n')
    assert backup.node == '/cell/mixer'
    assert backup.drive == 'mixer'
    assert backup.values == {'actual': 1.25, 'flag': False, 'p613.5': 7}
    assert backup.head == Head()


@pytest.mark.parametrize(('node', 'drive'), [('/**', ''), ('/**/lift', 'lift'), ('lift', 'lift')])
def test_for_any_node(tmp_path: Path, node: str, drive: str) -> None:
    text = f'{node}:\n  ros__parameters:\n    a: 1\n'
    assert read(tmp_path, text).drive == drive


@pytest.mark.parametrize(('text', 'messages'), [
    ('', ['b.yaml: has no parameters of any node: this is no backup']),
    ('hello\n', ['b.yaml:1: yaml: no mapping, allowed is NODE_NAME: {ros__parameters: …}']),
    ('/a: [\n', ['b.yaml:2: yaml: not valid YAML: ']),
    ('ramp_time: 1.0\n', ['b.yaml:1: ramp_time: no mapping (rcl refuses the file), allowed is '
                          'ros__parameters below it']),
    ('/a:\n  ros__parameters: {x: 1}\n/b:\n  ros__parameters: {x: 1}\n',
     ['b.yaml: has sections of 2 nodes (/a, /b), allowed is one']),
    ('/a:\n  ros__parameters:\n    buses: {main: {channel: can0}}\n',
     ['b.yaml: is a parameter file of a bridge, not a backup of a drive (it has buses)']),
    ('/a:\n  ros__parameters:\n    x: 1\n    x: 2\n', ['b.yaml:4: x: duplicate key']),
    ('/a:\n  ros__parameters:\n    x: fast\n    y: [1, 2]\n    z: 5 rpm\n',
     ["b.yaml:3: x: 'fast' is a string, allowed is a number, true or false",
      'b.yaml:4: y: a list, allowed is a number', "b.yaml:5: z: '5 rpm' is a string"]),
    ('/a:\n  ros__parameters:\n    x:\n    y: *z\n',
     ['b.yaml:3: x: no value', 'b.yaml:4: y: an alias']),
    ('/a:\n  ros__parameters: {}\n', ['b.yaml: has no parameters: this is no backup']),
])
def test_refused_with_a_line_each(tmp_path: Path, text: str, messages: list[str]) -> None:
    with pytest.raises(ConfigurationError) as error:
        read(tmp_path, text)
    assert len(error.value.problems) == len(messages)
    for problem, message in zip(error.value.problems, messages):
        assert problem.startswith(f'{tmp_path}/{message}')
        assert problem.isprintable()


@settings(max_examples=200)
@given(st.binary(max_size=80) | st.text(max_size=80).map(lambda text: (
    f'/a:\n  ros__parameters:\n    {text}').encode('utf-8', 'surrogatepass')))
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory,
                                       data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / 'any.yaml'
    path.write_bytes(data)
    try:
        read_backup(path)
    except ConfigurationError as error:
        assert all(problem.isprintable() for problem in error.problems)


@pytest.mark.parametrize('name', ['yes', 'no', 'on', 'off', 'true', 'false', 'null', 'y', 'n'])
def test_names_that_are_words_of_yaml_are_quoted(tmp_path: Path, name: str) -> None:
    text = written(FACTS, Head(), [(Parameter(name, number=30), 5)])
    assert yaml.safe_load(text) == {'/conveyor': {'ros__parameters': {name: 5}}}
    assert f"    '{name}': 5\n" in text
    assert read(tmp_path, text).values == {name: 5}


@pytest.mark.parametrize('text', [
    '/conveyor:\n  ros__parameters:\n    {name}: 5\n',
    '/conveyor:\n  ros__parameters:\n    {name}: null\n',
    '/conveyor:\n  ros__parameters:\n    {name}: abc\n',
    '/conveyor:\n  ros__parameters:\n    {name}: 1\n    {name}: 2\n',
    '/conveyor:\n  ros__parameters:\n    {name}: [1, {name}]\n',
    '/conveyor:\n  ros__parameters:\n    {name}: &a\n',
    '/{name}:\n  ros__parameters:\n    a: 1\n/b:\n  ros__parameters:\n    a: 1\n',
    '/{name}:\n  ros__parameters: 5\n', '{name}: 5\n'])
def test_what_a_file_brings_is_shown_short(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        read(tmp_path, text.replace('{name}', 5000 * 'x'))
    assert len(str(refused.value)) < 1000
