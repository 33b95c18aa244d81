# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the words of a command line may be, and how columns stand."""

from argparse import ArgumentTypeError

import pytest

from drive_can_bridge.cli.arguments import above_zero, of_drive, whole
from drive_can_bridge.cli.command import WrongUsage
from drive_can_bridge.cli.main import main
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


def test_an_argument_of_a_drive_that_is_not_there() -> None:
    with pytest.raises(WrongUsage, match="--fault x:late: no drive 'x'; drives: none"):
        of_drive('--fault', 'x:late', BridgeConfiguration(buses={}, drives={}), str)


def test_columns() -> None:
    assert column_lines(('name', 'count', 'what'), [('a', '5', ''), ('longer', '1000000', 'b')],
                        numbers=('count',)) == [
        'name      count  what', 'a             5', 'longer  1000000  b']


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
