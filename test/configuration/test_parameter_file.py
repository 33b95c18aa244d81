# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Reading parameter files: structure, sections, lines; everything that rcl refuses or garbles."""

from pathlib import Path

from configuration_builders import FILE, PROFILE
import pytest

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.configuration.parameter_file import read_parameter_file, unseen_problems
from drive_can_bridge.configuration.problems import PROBLEMS_MAX
from drive_can_bridge.configuration.profiles import read_profile
from drive_can_bridge.core.errors import ConfigurationError

HEAD = '/**/drive_can_bridge:\n  ros__parameters:\n'
BUSES = '    buses: {m: {interface: virtual}}\n'


def read(folder: Path, text: str | bytes) -> tuple[object, list[str]]:
    path = folder / 'f.yaml'
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    tree, problems = read_parameter_file(path)
    return (None if tree is None else tree.data,
            [str(problem).replace(f'{folder}/', '') for problem in problems])


@pytest.mark.parametrize('top', [
    '/**/drive_can_bridge', 'drive_can_bridge', '/drive_can_bridge', '/ns/drive_can_bridge',
    '/**', '"**"', '"*"', '/*', '/*/drive_can_bridge', '/a/b_2/other_name'])
def test_section_names(tmp_path: Path, top: str) -> None:
    text = f'{top}:\n  ros__parameters:\n' + BUSES
    assert read(tmp_path, text) == ({'buses': {'m': {'interface': 'virtual'}}}, [])


def test_nested_names(tmp_path: Path) -> None:
    text = '/ns:\n  a:\n    ros__parameters: {x: 1}\n  b:\n    ros__parameters:\n' + \
        BUSES.replace('    ', '      ', 1)
    assert read(tmp_path, text) == ({'buses': {'m': {'interface': 'virtual'}}}, [])


def test_values(tmp_path: Path) -> None:
    text = HEAD + BUSES + """\
    a: [1, 0x2, 010]
    b: [x, 'yes', "1"]
    c: []
    d: &anchor 5
    e: !!str 5
    f: |-
      7
    g: >-
      yes
    "h": {i: {j: -0.5}}
    k:
      - on
      - off
    l: !!map {m: ''}
"""
    data, problems = read(tmp_path, text)
    assert problems == []
    assert data == {
        'buses': {'m': {'interface': 'virtual'}}, 'a': [1, 2, 8], 'b': ['x', 'yes', '1'], 'c': [],
        'd': 5, 'e': '5', 'f': 7, 'g': True, 'h': {'i': {'j': -0.5}}, 'k': [True, False],
        'l': {'m': ''}}


@pytest.mark.parametrize('text', [
    '\ufeff' + HEAD + BUSES, (HEAD + BUSES).replace('\n', '\r\n'), '---\n' + HEAD + BUSES + '...',
    '%YAML 1.1\n---\n' + HEAD + BUSES, 'x:\n  ros__parameters: {a: 1}\n---\n' + HEAD + BUSES,
    HEAD + BUSES + 'x:\n  ros__parameters: {a.b: 1, a.b: 2}\n', (HEAD + BUSES).encode('utf-16'),
])
def test_what_else_is_fine(tmp_path: Path, text: str | bytes) -> None:
    assert read(tmp_path, text) == ({'buses': {'m': {'interface': 'virtual'}}}, [])


CASES = [
    # what rcl refuses
    ('    a: *x\n',
     ['f.yaml:4: a: an alias (rcl refuses the file), allowed is the value itself']),
    ('    a: {b: &x 1, <<: *x}\n',
     ['f.yaml:4: a.<<: an alias (rcl refuses the file), allowed is the value itself']),
    ('    a:\n    b: 1\n',
     ['f.yaml:4: a: no value (rcl refuses the file), allowed is a value, or [] for an empty '
      'list']),
    ('    a: !!str\n    b: 1\n',
     ['f.yaml:4: a: no value (rcl refuses the file), allowed is a value, or [] for an empty '
      'list']),
    ('    a: {b}\n',
     ['f.yaml:4: a.b: no value (rcl refuses the file), allowed is a value, or [] for an empty '
      'list']),
    ('    a: [1, 2.0]\n',
     ['f.yaml:4: a: 2.0 is a number in a list that began with an integer (rcl refuses the file), '
      'allowed are values of one type']),
    ('    a:\n      - x\n      - y\n      - 5\n',
     ['f.yaml:6: a: true is a bool in a list that began with a string (rcl refuses the file), '
      'allowed are values of one type',
      'f.yaml:7: a: 5 is an integer in a list that began with a string (rcl refuses the file), '
      'allowed are values of one type']),
    ('    a: [1, *x]\n',
     ['f.yaml:4: a: an alias (rcl refuses the file), allowed is the value itself']),
    ('    a: [x, {b: 2}]\n',
     ['f.yaml:4: a: a list or mapping in a list, allowed are plain values']),
    ('    "": 1\n',
     ['f.yaml:4: an empty key, allowed is a name']),
    ('    ? [a]\n    : 1\n',
     ['f.yaml:4: a list or mapping as a key, allowed is a name']),
    ('    a:\n      ? {b: 1}\n      : {c: 2}\n',
     ['f.yaml:5: a: a list or mapping as a key, allowed is a name']),
    ('    a:\n      *x : 1\n',
     ['f.yaml:5: a: an alias as a key, allowed is a name']),
    ('x:\n  a: 1\n',
     ['f.yaml:5: x/a: no mapping (rcl refuses the file), allowed: ros__parameters']),
    ('x:\n  ros_parameters: [1]\n',
     ['f.yaml:5: x/ros_parameters: misspelt, allowed is ros__parameters']),
    # one line, and not one for everything below it
    ('x:\n  ros_parameters: {a: 1, b: {c: 2}}\n',
     ['f.yaml:5: x/ros_parameters: misspelt, allowed is ros__parameters']),
    ('x:\n',
     ['f.yaml:4: x: no mapping (rcl refuses the file), allowed is ros__parameters below it']),
    ('x y:\n  ros__parameters: {a: 1}\n',
     ["f.yaml:5: x y: 'x y' is no node name (rcl refuses the file), allowed is for example "
      '/**/drive_can_bridge']),
    ('//x:\n  ros__parameters: {a: 1}\n',
     ["f.yaml:5: //x: '//x' is no node name (rcl refuses the file), allowed is for example "
      '/**/drive_can_bridge']),
    ('x:\n  ros__parameters: {a: [1, x]}\n',
     ["f.yaml:5: a: 'x' is a string in a list that began with an integer (rcl refuses the file), "
      'allowed are values of one type']),
    ('ros__parameters: {a: 1}\n',
     ['f.yaml:4: ros__parameters: no node name above it, allowed is NODE_NAME: '
      '{ros__parameters: …}']),
    ('[a, b]: {}\n',
     ['f.yaml:4: yaml: a key that is no name, allowed are node names']),
    # what rcl garbles
    ('    a: {b: {}, c: 1}\n',
     ['f.yaml:4: a.b: an empty mapping (rcl garbles what follows), allowed is to leave the key '
      'out']),
    ('    a.b: 1\n',
     ['f.yaml:4: a.b: a key with dots, allowed are nested keys']),
    ('    a:\n      b.c: {d: 1}\n',
     ['f.yaml:5: a.b.c: a key with dots, allowed are nested keys']),
    ('    a: 1\n    b: 2\n    a: 3\n',
     ['f.yaml:6: a: duplicate key, allowed is one (the first is in line 4)']),
    ('    a: {b: 1}\n    a: {c: 1}\n',
     ['f.yaml:5: a: duplicate key, allowed is one (the first is in line 4)']),
    ('    a: "x\\0y"\n',
     ['f.yaml:4: a: a NUL character, allowed is text without']),
    ('    "a\\0": 1\n',
     ['f.yaml:4: a key with a NUL character, allowed is a name']),
    ('/**/drive_can_bridge:\n  ros__parameters: {a: 1}\n',
     ['f.yaml:4: /**/drive_can_bridge: duplicate key, allowed is one (the first is in line 1)']),
    ('  a: 1\n',
     ['f.yaml:4: /**/drive_can_bridge/a: stands beside ros__parameters (rcl refuses or garbles '
      'the file), allowed is a section of its own',
      'f.yaml:4: /**/drive_can_bridge/a: no mapping (rcl refuses the file), allowed: '
      'ros__parameters']),
    ('x:\n  ros__parameterss: {a: 1}\n',
     ['f.yaml:5: x/ros__parameterss: misspelt, allowed is ros__parameters']),
    ('x:\n  ros__parameters: []\n',
     ['f.yaml:5: x/ros__parameters: no mapping, allowed are parameters']),
    ('---\ntext\n',
     ['f.yaml:5: yaml: no mapping, allowed is NODE_NAME: {ros__parameters: …}']),
]


@pytest.mark.parametrize(('tail', 'expected'), CASES)
def test_problem(tmp_path: Path, tail: str, expected: list[str]) -> None:
    data, problems = read(tmp_path, HEAD + BUSES + tail)
    assert problems == expected
    assert isinstance(data, dict)
    assert data['buses'] == {'m': {'interface': 'virtual'}}


@pytest.mark.parametrize(('tail', 'line', 'what'), [
    ('    a: b: c\n', 4, 'mapping values are not allowed in this context'),
    ('    a: "open\n    b: 1\n', 4, 'found unexpected end of stream'),
    # where it begins, not where it is noticed
    ('    drives\n    a: 1\n', 4, "could not find expected ':'"),
    ('    a:\n      b: 1\n   c: 1\n', 6, 'did not find expected key (no key above it is '
     'indented like it: is one missing?)'),
    ('    a: [1\n    b: 1\n', 4, "did not find expected ',' or ']'"),
    ('    a: @x\n', 4, 'found character that cannot start any token'),
])
def test_broken_yaml(tmp_path: Path, tail: str, line: int, what: str) -> None:
    pytest.importorskip('yaml._yaml', reason='the wording is that of libyaml')
    assert read(tmp_path, HEAD + BUSES + tail) == (
        None, [f'f.yaml:{line}: yaml: not valid YAML: {what}'])


@pytest.mark.parametrize('tail', ['  \ta: 1\n', '\ta: 1\n', '    \ta: 1\n'])
def test_tabs(tmp_path: Path, tail: str) -> None:
    assert read(tmp_path, HEAD + BUSES + tail) == (
        None, ['f.yaml:4: yaml: a tab in the indentation, allowed are spaces'])


@pytest.mark.parametrize(('top', 'fits'), [
    ('/**/drive_can_bridge', True), ('/**', True), ('/ns/drive_can_bridge', True),
    ('/**/drive_can_brige', False), ('conveyors', False), ('/ns/other', False)])
def test_a_name_that_only_a_renamed_bridge_has(tmp_path: Path, top: str, fits: bool) -> None:
    path = tmp_path / 'f.yaml'
    path.write_text(f'{top}:\n  ros__parameters:\n{BUSES}', encoding='utf-8')
    tree, problems = read_parameter_file(path)
    assert tree is not None and problems == []
    assert [warning.key for warning in tree.warnings] == ([] if fits else [top])


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    data, problems = read(tmp_path, HEAD.encode() + b'    a: \xff\xfe\n')
    assert data is None
    assert len(problems) == 1
    assert problems[0].startswith('f.yaml:')
    assert 'not valid YAML' in problems[0]


@pytest.mark.parametrize(('text', 'found'), [
    ('', ''), ('# nothing\n', ''), ('{}\n', ''),
    ('x:\n  ros__parameters: {a: 1}\n', '; the file has: x'),
    ('x: {ros__parameters: {}}\n/y/z: {ros__parameters: {a: 1}}\n', '; the file has: x, /y/z'),
])
def test_no_section_of_a_bridge(tmp_path: Path, text: str, found: str) -> None:
    assert read(tmp_path, text) == (None, [
        'f.yaml:1: buses: no section of the file holds it, allowed is one '
        '/**/drive_can_bridge: {ros__parameters: {buses: …}}' + found])


def test_section_whose_buses_are_misspelled(tmp_path: Path) -> None:
    """It is meant for the bridge: then the problem can be told where it is."""
    (tmp_path / 'f.yaml').write_text(
        'drive_can_bridge:\n  ros__parameters:\n    busses: {main: {channel: c0}}\n'
        '    drives: {lift: {station: 1}}\n',
        encoding='utf-8')
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_file(tmp_path / 'f.yaml')
    lines = [line.removeprefix(f'{tmp_path}/') for line in str(caught.value).splitlines()]
    assert 'f.yaml:3: buses: missing, allowed is a mapping' in lines
    assert "f.yaml:3: busses: unknown key, did you mean 'buses'?" in lines


@pytest.mark.parametrize('key', ['use_sim_time', 'start_type_description_service'])
def test_standard_switches_are_bools(tmp_path: Path, key: str) -> None:
    text = ('drive_can_bridge:\n  ros__parameters:\n    KEY: no way\n    buses:\n      main:\n'
            '        interface: virtual\n        channel: c0\n')
    (tmp_path / 'f.yaml').write_text(text.replace('KEY', key), encoding='utf-8')
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_file(tmp_path / 'f.yaml')
    assert str(caught.value).removeprefix(f'{tmp_path}/') == (
        f"f.yaml:3: {key}: 'no way' is a string, allowed is true or false")


def test_several_sections_of_bridges(tmp_path: Path) -> None:
    text = HEAD + BUSES + '/b/drive_can_bridge:\n  ros__parameters:\n' + BUSES
    assert read(tmp_path, text) == (None, [
        'f.yaml:6: buses: in a second section, /b/drive_can_bridge; allowed is one section that '
        'holds it (the first is /**/drive_can_bridge)'])


@pytest.mark.parametrize(('head', 'sections', 'value'), [
    ('/**/drive_can_bridge', '/**: {ros__parameters: {a: 2}}', 2),
    ('/**/drive_can_bridge', 'drive_can_bridge: {ros__parameters: {a: 2}}', 2),
    ('/cell/drive_can_bridge', '/*/drive_can_bridge: {ros__parameters: {a: 2}}', 2),
    ('/cell/drive_can_bridge', '/drive_can_bridge: {ros__parameters: {a: 2}}', 1),
    ('/**', 'drive_can_bridge: {ros__parameters: {a: 2}}', 2),
    ('/**/*', '/drive_can_bridge: {ros__parameters: {a: 2}}', 2),
    ('/*/left', '/*/right: {ros__parameters: {a: 2}}', 1)])
def test_all_sections_for_the_node_count(tmp_path: Path, head: str, sections: str,
                                         value: int) -> None:
    own = f'{head}:\n  ros__parameters:\n    a: 1\n{BUSES}'
    after, before = read(tmp_path, f'{own}{sections}\n'), read(tmp_path, f'{sections}\n{own}')
    assert after[0] is not None and before[0] is not None
    assert (after[0]['a'], after[1]) == (value, [])
    # the last in the file counts
    assert (before[0]['a'], before[1]) == (1, [])


def test_lines_of_what_another_section_says(tmp_path: Path) -> None:
    text = (f'{HEAD}    a: {{b: 1}}\n    list: [true]\n{BUSES}/**:\n  ros__parameters:\n'
            '    a: 1\n    list: [1, 2]\n    c.d: 1\n')
    tree, problems = read(tmp_path, text)
    assert tree is not None and tree['list'] == [1, 2]
    assert problems == [
        'f.yaml:10: c.d: a key with dots, allowed are nested keys',
        'f.yaml:8: a: has a value in one section, and keys below it in another; allowed is one of '
        'them']


@pytest.mark.parametrize(('section', 'told'), [
    ('/cell/drive_can_bridge', True), ('/*/drive_can_bridge', True), ('/camera', False),
    ('/cell/camera', False), ('/**/other', False)])
@pytest.mark.parametrize('head', ['/**/drive_can_bridge', '/**'])
def test_section_for_another_namespace(tmp_path: Path, head: str, section: str,
                                       told: bool) -> None:
    path = tmp_path / 'f.yaml'
    path.write_text(f'{head}:\n  ros__parameters:\n{BUSES}{section}:\n  ros__parameters:\n'
                    '    a: 1\n', encoding='utf-8')
    tree, problems = read_parameter_file(path)
    assert tree is not None and problems == [] and 'a' not in tree.data
    assert [(each.line, each.key, each.message) for each in tree.warnings] == ([
        (6, section, 'counts for the bridge in another namespace, and is not checked: checked is '
                     '/drive_can_bridge')] if told else [])


def test_another_bridge_is_no_section_for_this_one(tmp_path: Path) -> None:
    path = tmp_path / 'f.yaml'
    path.write_text(f'/a/drive_can_bridge:\n  ros__parameters:\n{BUSES}'
                    '/b/drive_can_bridge: {ros__parameters: {a: 1}}\n', encoding='utf-8')
    tree, _ = read_parameter_file(path)
    assert tree is not None and tree.warnings == []


@pytest.mark.parametrize(('drive', 'line', 'problem'), [
    ('profile: ', 11, 'drives.x.profile: no value (rcl refuses the file), allowed is a value, or '
                      '[] for an empty list'),
    ('pro.file: 1', 11, 'drives.x.pro.file: a key with dots, allowed are nested keys')])
def test_what_nobody_can_read_elsewhere_is_not_missing(tmp_path: Path, drive: str, line: int,
                                                       problem: str) -> None:
    path = tmp_path / 'f.yaml'
    path.write_text(f'{HEAD}    buses: {{m: {{interface: virtual, channel: c}}}}\n/**:\n'
                    '  ros__parameters:\n    drives:\n      x:\n        bus: m\n'
                    '        station: 1\n        protocol: datamodel_extended\n'
                    f'        {drive}\n', encoding='utf-8')
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_file(path)
    assert str(caught.value) == f'{path}:{line}: {problem}'


def test_buses_are_named_in_the_order_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / 'f.yaml'
    names = ['zeta', 'alpha', 'omega', 'beta', 'main']
    path.write_text(f'{HEAD}    buses:\n' + ''.join(f'      {name}: 1\n' for name in names)
                    + '    drives: {x: {bus: quite_another}}\n', encoding='utf-8')
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_file(path)
    assert "'quite_another' is unknown, allowed: " + ', '.join(names) in str(caught.value)


def test_a_profile_is_no_parameter_file(tmp_path: Path) -> None:
    assert read(tmp_path, PROFILE) == (None, [
        'f.yaml:1: yaml: a profile, allowed is NODE_NAME: {ros__parameters: …}; drive_can profile '
        'check looks at profiles'])


def test_a_parameter_file_is_no_profile(tmp_path: Path) -> None:
    path = tmp_path / 'f.yaml'
    path.write_text(FILE, encoding='utf-8')
    assert [str(problem) for problem in read_profile(path).problems] == [
        f'{path}:1: yaml: parameters of nodes, allowed is a profile; drive_can validate looks at '
        'the file of a bridge']


def test_dotted_buses_still_mark_the_section(tmp_path: Path) -> None:
    assert read(tmp_path, HEAD + '    buses.main.interface: virtual\n')[1] == [
        'f.yaml:3: buses.main.interface: a key with dots, allowed are nested keys']


def test_nested_too_deep(tmp_path: Path) -> None:
    _, problems = read(tmp_path, HEAD + BUSES + '    a: ' + '{a: ' * 5000 + '1' + '}' * 5000)
    assert [problem.split(': ', 2)[2] for problem in problems] == [
        'nested too deep, allowed are 32 levels']
    _, problems = read(tmp_path, '{a: ' * 5000 + '1' + '}' * 5000)
    assert problems


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        configuration_from_file(tmp_path / 'nothing.yaml')


def test_lines_are_those_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / 'f.yaml'
    path.write_text('# one\n\n' + FILE.replace('rearm: neutral', 'rearm: x'))
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_file(path)
    assert f'{path}:20: drives.conveyor.rearm: ' in str(caught.value)


@pytest.mark.parametrize(('section', 'node', 'meant'), [
    ('drive_can_bridge', '/drive_can_bridge', True), ('/**', '/a/b', True), ('/**', '/b', True),
    ('/**/drive_can_bridge', '/cell/drive_can_bridge', True),
    ('/**/drive_can_bridge', '/drive_can_bridge', True), ('/*/x', '/a/x', True),
    ('/*/x', '/a/b/x', False), ('/cell/x', '/cell/x', True), ('/cell/x', '/x', False),
    ('x', '/cell/x', False), ('/**/drive_can_bridge', '/other', False)])
def test_duplicate_keys_of_a_node(tmp_path: Path, section: str, node: str, meant: bool) -> None:
    file = tmp_path / 'f.yaml'
    file.write_text(f'{section}:\n  ros__parameters:\n    a.b: 1\n    period: 1\n    period: 2\n',
                    encoding='utf-8')
    found = [(problem.line, problem.key) for problem in unseen_problems([file], node)[0]]
    assert found == ([(5, 'period')] if meant else [])


@pytest.mark.parametrize(('node', 'meant'), [('/drive_can_bridge', True), ('/other', False)])
def test_empty_mapping_of_a_node(tmp_path: Path, node: str, meant: bool) -> None:
    file = tmp_path / 'f.yaml'
    file.write_text('drive_can_bridge:\n  ros__parameters:\n    joint: {}\n    period: 1\n',
                    encoding='utf-8')
    duplicates, garbled = unseen_problems([file], node)
    assert duplicates == []
    found = [(problem.line, problem.key) for problem in garbled]
    assert found == ([(3, 'joint')] if meant else [])


def test_duplicate_keys_of_a_file_that_has_gone(tmp_path: Path) -> None:
    assert unseen_problems([tmp_path / 'gone.yaml'], '/drive_can_bridge') == ([], [])


def test_section_that_stands_twice(tmp_path: Path) -> None:
    file = tmp_path / 'f.yaml'
    section = '/**/drive_can_bridge:\n  ros__parameters: {a: 1}\n'
    file.write_text(section + section, encoding='utf-8')
    found, _ = unseen_problems([file], '/drive_can_bridge')
    assert [(problem.line, problem.key) for problem in found] == [(3, '/**/drive_can_bridge')]
    assert unseen_problems([file], '/other') == ([], [])


def test_a_million_mistakes_are_told_in_as_many_lines_as_anybody_reads(tmp_path: Path) -> None:
    file = tmp_path / 'f.yaml'
    file.write_text('---\n' * 3000, encoding='utf-8')
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_file(file)
    assert len(caught.value.problems) == PROBLEMS_MAX + 1
    assert caught.value.problems[-1].startswith('and ')


@pytest.mark.parametrize('text', [
    ''.join(f'/**/n{number}: {{ros__parameters: {{a: 1}}}}\n' for number in range(3000)),
    f'{"k" * 100_000}: 1\n', f'{HEAD}    buses: {{}}\n    ? {"k" * 100_000}\n    : 1\n',
    HEAD + BUSES.replace('virtual', 'virtual, bitrate: 125000') + '    drives:\n' + ''.join(
        f'      d{number}: {{bus: m, protocol: datamodel_extended, station: {number % 127 + 1}, '
        'profile: datamodel_example, cyclic_request: [speed_setpoint], '
        'cyclic_response: [actual_speed]}\n' for number in range(600))],
    ids=['sections', 'name', 'key', 'drives'])
def test_no_line_has_all_that_a_file_has(tmp_path: Path, text: str) -> None:
    file = tmp_path / 'f.yaml'
    file.write_text(text, encoding='utf-8')
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_file(file)
    assert max(map(len, caught.value.problems)) < len(str(file)) + 3000


def test_names_of_any_nodes_are_not_tried_in_all_ways(tmp_path: Path) -> None:
    file = tmp_path / 'f.yaml'
    file.write_text(f'{"/**" * 300}/x:\n  ros__parameters: {{a: 1, a: 2}}\n', encoding='utf-8')
    assert unseen_problems([file], '/a/b/c/d/y')[0] == []
    assert unseen_problems([file], '/a/b/c/d/x')[0] != []
