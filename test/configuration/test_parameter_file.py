# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Reading parameter files: structure, sections, lines; everything that rcl refuses or garbles."""

from pathlib import Path

from configuration_builders import at, FILE, load, local, PROFILE
import pytest
from saying import says

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.configuration.parameter_file import read_parameter_file, unseen_problems
from drive_can_bridge.configuration.problems import PROBLEMS_MAX
from drive_can_bridge.configuration.profiles import read_profile
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.core.messages import Sentence

HEAD = '/**/drive_can_bridge:\n  ros__parameters:\n'
BUSES = '    buses: {m: {interface: virtual}}\n'


def refusal(folder: Path, text: str) -> list[Sentence]:
    """Return what is wrong with a file that no bridge is configured from."""
    path = folder / 'f.yaml'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(ConfigurationError) as caught:
        configuration_from_file(path)
    return local(folder, caught.value.problems)


def read(folder: Path, text: str | bytes) -> tuple[object, list[Sentence]]:
    path = folder / 'f.yaml'
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    tree, problems = read_parameter_file(path)
    return (None if tree is None else tree.data,
            local(folder, [problem.text for problem in problems]))


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
    *(f'{top}:\n  ros__parameters:\n{BUSES}' for top in (
        '/**/drive_can_bridge', 'drive_can_bridge', '/drive_can_bridge', '/ns/drive_can_bridge',
        '/**', '"**"', '"*"', '/*', '/*/drive_can_bridge', '/a/b_2/other_name')),
    f'/ns:\n  a:\n    ros__parameters: {{x: 1}}\n  b:\n    ros__parameters:\n  {BUSES}',
    '\ufeff' + HEAD + BUSES, (HEAD + BUSES).replace('\n', '\r\n'), '---\n' + HEAD + BUSES + '...',
    '%YAML 1.1\n---\n' + HEAD + BUSES, 'x:\n  ros__parameters: {a: 1}\n---\n' + HEAD + BUSES,
    HEAD + BUSES + 'x:\n  ros__parameters: {a.b: 1, a.b: 2}\n', (HEAD + BUSES).encode('utf-16'),
])
def test_what_is_fine(tmp_path: Path, text: str | bytes) -> None:
    assert read(tmp_path, text) == ({'buses': {'m': {'interface': 'virtual'}}}, [])


@pytest.mark.parametrize('name', ['/*drive_can_bridge', '/**drive_can_bridge', '/*x/drive_*'])
def test_half_a_name_and_a_star(tmp_path: Path, name: str) -> None:
    text = f'{name}:\n  ros__parameters: {{buses: {{m: {{interface: virtual}}}}}}\n'
    data, problems = read(tmp_path, text)
    assert data == {'buses': {'m': {'interface': 'virtual'}}}
    assert problems == [at(f'f.yaml:2: {name}', 'no_node_name', name=name)]


CASES = [
    # what rcl refuses
    ('    a: *x\n',
     [at('f.yaml:4: a', 'alias', why=' (rcl refuses the file)')]),
    ('    a: {b: &x 1, <<: *x}\n',
     [at('f.yaml:4: a.<<', 'alias', why=' (rcl refuses the file)')]),
    ('    a:\n    b: 1\n',
     [at('f.yaml:4: a', 'no_value', why=' (rcl refuses the file)')]),
    ('    a: !!str\n    b: 1\n',
     [at('f.yaml:4: a', 'no_value', why=' (rcl refuses the file)')]),
    ('    a: {b}\n',
     [at('f.yaml:4: a.b', 'no_value', why=' (rcl refuses the file)')]),
    ('    a: [1, 2.0]\n',
     [at('f.yaml:4: a', 'mixed_list', value=2.0, kind='a number', first='an integer')]),
    ('    a:\n      - x\n      - y\n      - 5\n',
     [at('f.yaml:6: a', 'mixed_list', value=True, kind='a bool', first='a string'),
      at('f.yaml:7: a', 'mixed_list', value=5, kind='an integer', first='a string')]),
    ('    a: [1, *x]\n',
     [at('f.yaml:4: a', 'alias', why=' (rcl refuses the file)')]),
    ('    a: [x, {b: 2}]\n',
     [at('f.yaml:4: a', 'nested_list')]),
    ('    "": 1\n',
     [at('f.yaml:4: ', 'empty_key')]),
    ('    ? [a]\n    : 1\n',
     [at('f.yaml:4: ', 'no_key', kind='a list or mapping')]),
    ('    a:\n      ? {b: 1}\n      : {c: 2}\n',
     [at('f.yaml:5: a', 'no_key', kind='a list or mapping')]),
    ('    a:\n      *x : 1\n',
     [at('f.yaml:5: a', 'no_key', kind='an alias')]),
    ('x:\n  a: 1\n',
     [at('f.yaml:5: x/a', 'no_mapping_refused', hint=says('allowed', words='ros__parameters'))]),
    # one line, and not one for everything below it
    ('x:\n  ros_parameters: {a: 1, b: {c: 2}}\n',
     [at('f.yaml:5: x/ros_parameters', 'misspelt', allowed='ros__parameters')]),
    ('x:\n',
     [at('f.yaml:4: x', 'no_mapping_refused',
         hint=says('allowed_below', entry='ros__parameters'))]),
    ('x y:\n  ros__parameters: {a: 1}\n',
     [at('f.yaml:5: x y', 'no_node_name', name='x y')]),
    ('//x:\n  ros__parameters: {a: 1}\n',
     [at('f.yaml:5: //x', 'no_node_name', name='//x')]),
    ('x:\n  ros__parameters: {a: [1, x]}\n',
     [at('f.yaml:5: a', 'mixed_list', value='x', kind='a string', first='an integer')]),
    ('ros__parameters: {a: 1}\n',
     [at('f.yaml:4: ros__parameters', 'no_node_name_above', entry='ros__parameters')]),
    ('[a, b]: {}\n',
     [at('f.yaml:4: yaml', 'key_no_node_name')]),
    # what rcl garbles
    ('    a: {b: {}, c: 1}\n',
     [at('f.yaml:4: a.b', 'garbling_mapping')]),
    ('    a.b: 1\n',
     [at('f.yaml:4: a.b', 'dots')]),
    ('    a:\n      b.c: {d: 1}\n',
     [at('f.yaml:5: a.b.c', 'dots')]),
    ('    a: 1\n    b: 2\n    a: 3\n',
     [at('f.yaml:6: a', 'duplicate_key', first=4)]),
    ('    a: {b: 1}\n    a: {c: 1}\n',
     [at('f.yaml:5: a', 'duplicate_key', first=4)]),
    ('    a: "x\\0y"\n',
     [at('f.yaml:4: a', 'nul')]),
    ('    "a\\0": 1\n',
     [at('f.yaml:4: ', 'key_with_nul')]),
    ('/**/drive_can_bridge:\n  ros__parameters: {a: 1}\n',
     [at('f.yaml:4: /**/drive_can_bridge', 'duplicate_key', first=1)]),
    ('  a: 1\n',
     [at('f.yaml:4: /**/drive_can_bridge/a', 'beside_parameters', entry='ros__parameters'),
      at('f.yaml:4: /**/drive_can_bridge/a', 'no_mapping_refused',
         hint=says('allowed', words='ros__parameters'))]),
    ('x:\n  ros__parameterss: {a: 1}\n',
     [at('f.yaml:5: x/ros__parameterss', 'misspelt', allowed='ros__parameters')]),
    ('x:\n  ros__parameters: []\n',
     [at('f.yaml:5: x/ros__parameters', 'no_parameters')]),
    ('---\ntext\n',
     [at('f.yaml:5: yaml', 'no_mapping', entry='ros__parameters')]),
]


@pytest.mark.parametrize(('tail', 'expected'), CASES)
def test_problem(tmp_path: Path, tail: str, expected: list[str]) -> None:
    data, problems = read(tmp_path, HEAD + BUSES + tail)
    assert problems == expected
    assert isinstance(data, dict)
    assert data['buses'] == {'m': {'interface': 'virtual'}}


@pytest.mark.parametrize(('tail', 'line', 'what'), [
    ('    a: b: c\n', 4, 'mapping values are not allowed in this context'),
    ('    a: "open\n    b: 1\n', 4, 'found unexpected end of stream (a quote is not closed)'),
    # where it begins, not where it is noticed
    ('    drives\n    a: 1\n', 4, "could not find expected ':'"),
    ('    a:\n      b: 1\n   c: 1\n', 6, 'did not find expected key'),
    ('    a: [1\n    b: 1\n', 4,
     "did not find expected ',' or ']' (a bracket is not closed, or a comma is missing)"),
    ('    a: @x\n', 4, 'found character that cannot start any token'),
])
def test_broken_yaml(tmp_path: Path, tail: str, line: int, what: str) -> None:
    pytest.importorskip('yaml._yaml', reason='the wording is that of libyaml')
    assert read(tmp_path, HEAD + BUSES + tail) == (
        None, [at(f'f.yaml:{line}: yaml', 'indented_like_no_key' if what.endswith('key') else
                  'not_yaml', what=what)])


@pytest.mark.parametrize(('tail', 'found'), [
    *((tail.encode(), at('f.yaml:4: yaml', 'tab'))
      for tail in ('  \ta: 1\n', '\ta: 1\n', '    \ta: 1\n')),
    (b'    a: \xff\xfe\n', says('not_yaml', file='f.yaml')),
])
def test_bytes_that_are_no_text(tmp_path: Path, tail: bytes, found: says) -> None:
    assert read(tmp_path, (HEAD + BUSES).encode() + tail) == (None, [found])


@pytest.mark.parametrize(('text', 'found'), [
    ('', {}), ('# nothing\n', {}), ('{}\n', {}),
    ('x:\n  ros__parameters: {a: 1}\n', {'names': 'x'}),
    ('x: {ros__parameters: {}}\n/y/z: {ros__parameters: {a: 1}}\n', {'names': 'x, /y/z'}),
])
def test_no_section_of_a_bridge(tmp_path: Path, text: str, found: dict[str, str]) -> None:
    assert read(tmp_path, text) == (None, [
        at('f.yaml:1: buses', 'no_section_of' if found else 'no_section', **found)])


def test_section_whose_buses_are_misspelled(tmp_path: Path) -> None:
    """It is meant for the bridge: then the problem can be told where it is."""
    lines = refusal(tmp_path, (
        'drive_can_bridge:\n  ros__parameters:\n    busses: {main: {channel: c0}}\n'
        '    drives: {lift: {station: 1}}\n'))
    assert at('f.yaml:3: buses', 'missing', allowed='a mapping') in lines
    assert at('f.yaml:3: busses', 'unknown_key', hint=says('did_you_mean', word='buses')) in lines


@pytest.mark.parametrize('key', ['use_sim_time', 'start_type_description_service'])
def test_standard_switches_are_bools(tmp_path: Path, key: str) -> None:
    text = f'{HEAD}    {key}: no way\n    buses: {{main: {{interface: virtual, channel: c0}}}}\n'
    assert refusal(tmp_path, text) == [
        at(f'f.yaml:3: {key}', 'wrong_type', value='no way', kind='a string')]


def test_several_sections_of_bridges(tmp_path: Path) -> None:
    text = HEAD + BUSES + '/b/drive_can_bridge:\n  ros__parameters:\n' + BUSES
    assert read(tmp_path, text) == (None, [
        at('f.yaml:6: buses', 'second_section', section='/b/drive_can_bridge',
           first='/**/drive_can_bridge')])


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
        at('f.yaml:10: c.d', 'dots'),
        at('f.yaml:8: a', 'value_and_keys')]


def warned(folder: Path, text: str) -> list[Sentence]:
    """Return what is suspicious about a file in which nothing is wrong; no bridge gets an a."""
    path = folder / 'f.yaml'
    path.write_text(text, encoding='utf-8')
    tree, problems = read_parameter_file(path)
    assert tree is not None and problems == [] and 'a' not in tree.data
    return local(folder, [each.text for each in tree.warnings])


@pytest.mark.parametrize(('top', 'fits'), [
    ('/**/drive_can_bridge', True), ('/**', True), ('/ns/drive_can_bridge', True),
    ('/**/drive_can_brige', False), ('conveyors', False), ('/cell/other', False)])
def test_a_name_that_only_a_renamed_bridge_has(tmp_path: Path, top: str, fits: bool) -> None:
    assert warned(tmp_path, f'{top}:\n  ros__parameters:\n{BUSES}') == ([] if fits else [
        at(f'f.yaml:3: {top}', 'other_node_name', usual='drive_can_bridge')])


@pytest.mark.parametrize(('head', 'section', 'told'), [
    *((head, section, told) for head in ('/**/drive_can_bridge', '/**') for section, told in (
        ('/cell/drive_can_bridge', True), ('/*/drive_can_bridge', True), ('/camera', False),
        ('/cell/camera', False), ('/**/other', False))),
    # another bridge
    ('/a/drive_can_bridge', '/b/drive_can_bridge', False)])
def test_section_for_another_namespace(tmp_path: Path, head: str, section: str,
                                       told: bool) -> None:
    text = f'{head}:\n  ros__parameters:\n{BUSES}{section}:\n  ros__parameters:\n    a: 1\n'
    assert warned(tmp_path, text) == ([at(
        f'f.yaml:6: {section}', 'other_namespace', node='/drive_can_bridge')] if told else [])


@pytest.mark.parametrize(('drive', 'problem'), [
    ('profile: ', at('f.yaml:11: drives.x.profile', 'no_value', why=' (rcl refuses the file)')),
    ('pro.file: 1', at('f.yaml:11: drives.x.pro.file', 'dots'))])
def test_what_nobody_can_read_elsewhere_is_not_missing(tmp_path: Path, drive: str,
                                                       problem: says) -> None:
    assert refusal(tmp_path, (
        f'{HEAD}    buses: {{m: {{interface: virtual, channel: c}}}}\n/**:\n  ros__parameters:\n'
        '    drives:\n      x:\n        bus: m\n        station: 1\n'
        f'        protocol: datamodel_extended\n        {drive}\n')) == [problem]


def test_buses_are_named_in_the_order_of_the_file(tmp_path: Path) -> None:
    names = ['zeta', 'alpha', 'omega', 'beta', 'main']
    lines = refusal(tmp_path, f'{HEAD}    buses:\n' + ''.join(
        f'      {name}: 1\n' for name in names) + '    drives: {x: {bus: quite_another}}\n')
    assert says('unknown', name='quite_another',
                hint=says('allowed', words=', '.join(names))) in lines


def test_a_profile_is_no_parameter_file(tmp_path: Path) -> None:
    assert read(tmp_path, PROFILE) == (None, [
        at('f.yaml:1: yaml', 'is_profile', entry='ros__parameters')])


def test_a_parameter_file_is_no_profile(tmp_path: Path) -> None:
    path = tmp_path / 'f.yaml'
    path.write_text(FILE, encoding='utf-8')
    assert [problem.text for problem in read_profile(path).problems] == [
        says('is_parameter_file', file=str(path), line=1, key='yaml')]


def test_dotted_buses_still_mark_the_section(tmp_path: Path) -> None:
    assert read(tmp_path, HEAD + '    buses.main.interface: virtual\n')[1] == [
        at('f.yaml:3: buses.main.interface', 'dots')]


def unseen(folder: Path, text: str, node: str) -> tuple[list[tuple[int, str]], ...]:
    """Return line and key of what a node finds in a file: duplicates, and what is garbled."""
    file = folder / 'f.yaml'
    file.write_text(text, encoding='utf-8')
    return tuple([(problem.line, problem.key) for problem in found]
                 for found in unseen_problems([file], node))


@pytest.mark.parametrize(('section', 'node', 'meant'), [
    ('drive_can_bridge', '/drive_can_bridge', True), ('/**', '/a/b', True), ('/**', '/b', True),
    ('/**/drive_can_bridge', '/cell/drive_can_bridge', True),
    ('/**/drive_can_bridge', '/drive_can_bridge', True), ('/*/x', '/a/x', True),
    ('/*/x', '/a/b/x', False), ('/cell/x', '/cell/x', True), ('/cell/x', '/x', False),
    ('x', '/cell/x', False), ('/**/drive_can_bridge', '/other', False),
    # not tried in all the ways in which stars may stand for names
    ('/**' * 300 + '/x', '/a/b/c/d/x', True), ('/**' * 300 + '/x', '/a/b/c/d/y', False)])
def test_what_a_node_finds_in_its_section(tmp_path: Path, section: str, node: str,
                                          meant: bool) -> None:
    text = (f'{section}:\n  ros__parameters:\n    a.b: 1\n    period: 1\n    period: 2\n'
            '    joint: {}\n')
    duplicates, garbled = unseen(tmp_path, text, node)
    assert duplicates == [(5, 'period')] * meant
    assert garbled == [(6, 'joint')] * meant


def test_section_that_stands_twice(tmp_path: Path) -> None:
    text = 2 * '/**/drive_can_bridge:\n  ros__parameters: {a: 1}\n'
    assert unseen(tmp_path, text, '/drive_can_bridge')[0] == [(3, '/**/drive_can_bridge')]
    assert unseen(tmp_path, text, '/other') == ([], [])
    assert unseen_problems([tmp_path / 'gone.yaml'], '/drive_can_bridge') == ([], [])


def test_a_million_mistakes_are_told_in_as_many_lines_as_anybody_reads(tmp_path: Path) -> None:
    lines = refusal(tmp_path, '---\n' * 3000)
    assert len(lines) == PROBLEMS_MAX + 1
    assert lines[-1] == says('more', count=3000 - PROBLEMS_MAX)


@pytest.mark.parametrize('text', [
    ''.join(f'/**/n{number}: {{ros__parameters: {{a: 1}}}}\n' for number in range(3000)),
    f'{"k" * 100_000}: 1\n', f'{HEAD}    buses: {{}}\n    ? {"k" * 100_000}\n    : 1\n',
    HEAD + BUSES.replace('virtual', 'virtual, bitrate: 125000') + '    drives:\n' + ''.join(
        f'      d{number}: {{bus: m, protocol: datamodel_extended, station: {number % 127 + 1}, '
        'profile: datamodel_example, cyclic_request: [speed_setpoint], '
        'cyclic_response: [actual_speed]}\n' for number in range(600))],
    ids=['sections', 'name', 'key', 'drives'])
def test_no_line_has_all_that_a_file_has(tmp_path: Path, text: str) -> None:
    assert max(map(len, refusal(tmp_path, text))) < 3000


def test_what_a_bridge_finds_out_by_itself_may_stand_in_a_file(tmp_path: Path) -> None:
    """``ros2 param dump`` writes it."""
    found = ('        identity: a=1\n        profile_sha256: 0a\n        restore: "{}"\n'
             '        setpoints: ""\n        commanders: "[]"\n')
    text = FILE.replace('    buses:\n', '    bridges: [/drive_can_bridge]\n    buses:\n')
    text = text.replace('        station: 1\n', f'        station: 1\n{found}')
    assert list(load(tmp_path, text).drives) == ['conveyor', 'lift']


def test_nested_too_deep(tmp_path: Path) -> None:
    assert read(tmp_path, HEAD + BUSES + '    a: ' + '{a: ' * 5000 + '1' + '}' * 5000)[1] == [
        says('too_deep', levels=32)]
