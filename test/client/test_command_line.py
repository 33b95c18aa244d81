# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the words of a command line may be, and how columns stand."""

from argparse import ArgumentTypeError, Namespace
import math
import os
from pathlib import Path
import shlex
import subprocess
import sys

import pytest

from drive_can_bridge.cli import completion as completion_script
from drive_can_bridge.cli.command import (
    above_zero, bitrate, of_drive, PARAMS_FILE, print_json, whole, WrongUsage)
from drive_can_bridge.cli.drives import by_short_names
from drive_can_bridge.cli.main import EXAMPLES, main, SUBCOMMANDS, understood
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.text import column_lines


@pytest.mark.parametrize('text', ['0', '-1', 'inf', 'nan', 'x', ''])
def test_a_number_above_zero(text: str) -> None:
    with pytest.raises(ArgumentTypeError, match=f'{text}: allowed is a number above 0'):
        above_zero(text)
    assert above_zero('1e-3') == 0.001


@pytest.mark.parametrize('text', ['0', '6', '-1', '1.0', 'x'])
def test_an_integer_within_limits(text: str) -> None:
    with pytest.raises(ArgumentTypeError, match=f'{text}: allowed are 1 to 5'):
        whole(1, 5)(text)
    assert [whole(1, 5)(each) for each in ('1', '5')] == [1, 5]


def test_a_bit_rate() -> None:
    assert [bitrate(text) for text in ('125000', '500k', '1M', '83.3k', '250kbit/s')
            ] == [125_000, 500_000, 1_000_000, 83_300, 250_000]
    for text in ('0', '99', '5g', 'x', '', '-500k', '1e99', '9M'):
        with pytest.raises(ArgumentTypeError, match='allowed are 1000 to 8000000 bit/s'):
            bitrate(text)


def test_an_argument_of_a_drive_that_is_not_there() -> None:
    with pytest.raises(WrongUsage, match="--fault x:late: no drive 'x'; drives: none"):
        of_drive('--fault', 'x:late', BridgeConfiguration(buses={}, drives={}), str)


def test_no_line_has_all_that_a_file_has(tmp_path: Path,
                                         capsys: pytest.CaptureFixture[str]) -> None:
    sections, table = tmp_path / 'many.yaml', tmp_path / 'wide.csv'
    sections.write_text(''.join(f'/drive_{number}:\n  ros__parameters: {{a: 1}}\n'
                                for number in range(2000)), encoding='utf-8')
    assert main(['compare', str(sections), str(sections)]) == 2
    columns = ';'.join(f'column {number}' for number in range(2000))
    table.write_text(f'Nr;Name;{columns}\n1;a\n', encoding='utf-8')
    assert main(['profile', 'import', str(table), '-o', str(tmp_path / 'p.yaml')]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) > 1 and max(map(len, lines)) <= 4000


def test_documents_are_json_whatever_the_values(capsys: pytest.CaptureFixture[str]) -> None:
    print_json({'a': math.nan, 'b': -math.inf, 'c': 1.5, 'd': 'nan'})
    assert capsys.readouterr().out == '{"a": "nan", "b": "-inf", "c": 1.5, "d": "nan"}\n'


@pytest.mark.usefixtures('programs')
@pytest.mark.parametrize('command', [
    ['read'], ['stop', '/nowhere/else/lift'],   # others of this host may hold drives now
    ['monitor']])
def test_what_libraries_of_ros_write_is_no_output_of_ours(
        command: list[str], tmp_path: Path) -> None:
    for module in ('rclpy', 'rcl_interfaces'):     # the first that is imported
        (tmp_path / f'{module}.py').write_text(
            "import os\nos.write(1, b'[RTPS_TRANSPORT_SHM Error]\\n')\n"
            "raise ImportError('no', name='rclpy')\n")
    path = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get('PYTHONPATH')]))
    done = subprocess.run(
        [sys.executable, '-m', 'drive_can_bridge.cli.start', '--json', *command],
        capture_output=True, text=True, env={**os.environ, 'PYTHONPATH': path}, check=False)
    assert (done.returncode, done.stdout) == (1, '')
    assert done.stderr.splitlines()[0] == '[RTPS_TRANSPORT_SHM Error]'


TABLE = """\
name      count  what
a             5
longer  1000000  b"""


def test_columns() -> None:
    lines = column_lines(('name', 'count', 'what'), [('a', '5', ''), ('longer', '1000000', 'b')],
                         numbers=('count',))
    assert '\n'.join(lines) == TABLE


@pytest.mark.parametrize('words', [
    ('backup',), ('record', '--params-file', 'x'), ('scan', '--interface', 'i', '--channel', 'c'),
    ('profile', 'import', 'x'), ('security', 'x')], ids=lambda words: words[0])
@pytest.mark.parametrize('name', ['', '-'])
def test_a_name_that_names_no_file(words: tuple[str, ...], name: str,
                                   capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match='2'):
        main([*words, '-o', name])
    line, = capsys.readouterr().err.splitlines()
    assert line.startswith(f'drive_can {words[0]}')
    assert f'argument -o/--output: {name!r} names no file' in line


def test_a_full_name_says_where_its_bridge_is() -> None:
    def understand(file: str | None, where: str | None,
                   *words: str) -> tuple[list[str], str | None]:
        args = Namespace(params_file=file, namespace=where)
        return by_short_names(args, words), args.namespace
    assert understand(None, None, 'lift', 'l*') == (['lift', 'l*'], None)
    assert understand(None, None, '/lift') == (['lift'], '')
    assert understand(None, None, '/cell/lift', 'cell/hoist') == (['lift', 'hoist'], '/cell')
    assert understand(None, '/cell', 'lift', '/cell/l*') == (['lift', 'l*'], '/cell')
    # no namespace, and a file whose drives have none: said to be no drive, with all there are
    assert understand(None, None, '/c*/lift') == (['/c*/lift'], None)
    assert understand('robot.yaml', None, '/lift') == (['/lift'], None)
    for where, words in (('', ('/cell/lift',)), (None, ('/a/lift', '/b/lift'))):
        with pytest.raises(WrongUsage, match=f'{words[-1]}: is not in namespace /a?, and one '):
            understand(None, where, *words)


@pytest.mark.parametrize('subcommand', SUBCOMMANDS)
def test_each_has_two_examples_that_are_understood(
        subcommand: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match='0'):
        main([subcommand, '--help'])
    told = capsys.readouterr().out
    for example in EXAMPLES[subcommand]:
        assert f'\n  drive_can {example}\n' in told
        _, args = understood(shlex.split(example))
        assert args.subcommand == subcommand


@pytest.mark.parametrize('subcommand', SUBCOMMANDS)
def test_whoever_says_yes_to_everything_may_say_it_everywhere(subcommand: str) -> None:
    for example in EXAMPLES[subcommand]:
        first, *rest = shlex.split(example)
        for words in ([first, '--yes', *rest], [first, *rest, '--yes']):
            assert understood(words)[1].subcommand == subcommand
            assert '--yes' not in getattr(understood(words)[1], 'words', ())
    with pytest.raises(SystemExit, match='2'):
        understood([*shlex.split(EXAMPLES[subcommand][0]), '--yes=no'])


def test_the_file_of_the_environment_stands_for_the_option_where_no_bridge_is_asked(
        monkeypatch: pytest.MonkeyPatch) -> None:
    def file(*words: str) -> str:
        return str(understood(list(words))[1].params_file)
    monkeypatch.setenv(PARAMS_FILE, 'robot.yaml')
    for words in (('probe',), ('record', '-o', 'x.log'), ('decode', 'x.log'), ('simulate',)):
        assert file(*words) == 'robot.yaml'
        assert file(*words, '-p', 'other.yaml') == 'other.yaml'
    for words in (('read',), ('write', 'a=1'), ('backup', '-o', 'x'), ('restore', 'x'),
                  ('compare', 'a', 'b'), ('stop',), ('demo',)):
        assert file(*words) == 'None'
    monkeypatch.setenv(PARAMS_FILE, '')
    with pytest.raises(SystemExit, match='2'):
        understood(['probe'])


@pytest.mark.parametrize('words', [
    ('write', 'conveyor'), ('write', 'conveyor', 'ramp_time'), ('write', 'ramp_time=1', 'x='),
    ('write', 'lift', 'a=1', 'a=2'), ('read', '--namespace', 'a b'), ('read', '--nmt-start'),
    ('compare', 'a'), ('restore', 'a', 'b', 'c')])
def test_wrong_usage_is_told_before_a_bridge_is_looked_for(
        words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'drive_can_bridge.client.local', None)
    try:
        code = main(words)
    except SystemExit as ended:
        code = int(ended.code or 0)
    assert code == 2


def test_options_may_stand_before_the_subcommand(tmp_path: Path,
                                                 capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'wrong.yaml'
    file.write_text('/**/drive_can_bridge: {ros__parameters: {bus: 1}}\n')
    assert main(['validate', '--json', str(file)]) == 1
    told = capsys.readouterr()
    assert main(['--json', 'validate', str(file)]) == 1
    assert capsys.readouterr() == told and told.out.startswith('{"level": "error"')
    for words in (['--json'], ['--jsom', 'validate', 'x'], ['-p', 'robot.yaml']):
        with pytest.raises(SystemExit, match='2'):
            main(words)
    with pytest.raises(SystemExit, match='0'):
        main(['--version', 'validate'])


@pytest.mark.parametrize(('word', 'hint'), [
    ('valdate', ', did you mean validate?'), ('stpo', ', did you mean stop?'), ('x', '')])
def test_a_subcommand_that_is_not_there(word: str, hint: str,
                                        capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match='2'):
        main([word, 'robot.yaml'])
    assert capsys.readouterr() == (
        '', f"drive_can: there is no subcommand '{word}'{hint}; see drive_can --help\n")


def test_completion(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('argcomplete')
    for shell in completion_script.SHELLS:
        assert main(['completion', shell]) == 0
        assert 'drive_can' in capsys.readouterr().out
    with pytest.raises(SystemExit, match='2'):
        main(['completion', 'dos'])
