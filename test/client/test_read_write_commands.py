# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can read`` and ``write`` on the buses of a file: words, tables, JSON, exit codes."""

from collections.abc import Callable, Iterator
from functools import partial
import io
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any

from builders import frame
from client_builders import a_world, CONVEYOR, LIFT, parameter_file, stranger, World
import pytest
from transcripts import replayed, shown, stories

from drive_can_bridge.cli.main import main
from drive_can_bridge.client import open_drives
from drive_can_bridge.client.direct import DirectDrive
from drive_can_bridge.client.drive import WriteOutcome
from drive_can_bridge.core import sentences

#: why nobody is asked
REFUSED = {
    'used': 'bus main: drive lift is used by process {} ',
    'master': 'bus main: another master talks to drive lift (3F2#1E00); end it first\n',
}
STORIES = stories(__file__, 'commands.yaml')
pytestmark = pytest.mark.usefixtures('bench')

Run = Callable[..., tuple[int, list[str], str]]


@pytest.fixture
def world(tmp_path: Path, bench: object) -> Iterator[World]:
    """Return two drives."""
    with a_world(tmp_path, conveyor=CONVEYOR, lift=LIFT) as made:
        yield made


@pytest.fixture
def run(world: World, capsys: pytest.CaptureFixture[str]) -> Run:
    """Run a command on the file; return exit code, lines, and standard error."""
    def started(command: str, *words: str, file: Path | None = None) -> tuple[int, list[str], str]:
        capsys.readouterr()
        code = main([command, *words, '--params-file', str(file or world.file)])
        told = capsys.readouterr()
        return code, told.out.splitlines(), told.err
    return started


def test_no_option_is_abbreviated(run: Run) -> None:
    with pytest.raises(SystemExit) as ended:    # a drive might be called so one day
        run('read', 'conveyor', 'ramp_time', '--js')
    assert ended.value.code == 2


def interrupt(patch: pytest.MonkeyPatch) -> None:
    """Have Ctrl-C typed during the first write."""
    put = DirectDrive.put

    def interrupted(*args: Any, **options: Any) -> WriteOutcome:
        patch.setattr(DirectDrive, 'put', put)
        signal.raise_signal(signal.SIGINT)
        return put(*args, **options)
    patch.setattr(DirectDrive, 'put', interrupted)


@pytest.mark.usefixtures('foreground')
@pytest.mark.parametrize('story', STORIES)
def test_lines(story: str, run: Run, world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    def step(step: str) -> list[str]:
        first, *words = step.split()
        if first in ('read', 'write'):
            code, lines, errors = run(first, *words)
            return shown(lines, errors.splitlines(), code)
        if first == 'frames':
            return [str(len(world.seen()))]
        if first == 'behind':
            seen, then = map(frame, words)
            world.wire.watchers.append(lambda each: world.send(then) if each == seen else None)
            return []
        if first == 'interrupted':
            interrupt(monkeypatch)
            return []
        drive = world.drives[words[0]]
        if first == 'set':
            drive.set_value(words[1], float(words[2]))
        elif first == 'fault':
            drive.fault(words[1])
        else:
            return [' '.join(str(drive.value(name)) for name in words[1:])]
        return []
    assert replayed(STORIES[story], step) == STORIES[story]


def test_options_stand_anywhere(run: Run, world: World, capsys: pytest.CaptureFixture[str],
                                ) -> None:
    file = ('--params-file', str(world.file))
    for words in (['read', *file, 'conveyor', '--json', 'ramp_time'],
                  ['read', 'conveyor', *file, 'ramp_time', '--json'],
                  ['read', '--json', 'conveyor', 'ramp_time', *file]):
        capsys.readouterr()
        assert main(words) == 0
        assert json.loads(capsys.readouterr().out)['name'] == 'ramp_time'


def test_the_drive_may_be_left_out_where_there_is_one(run: Run, tmp_path: Path) -> None:
    with a_world(tmp_path, conveyor=CONVEYOR) as single:
        assert run('read', 'ramp_time', file=single.file)[0] == 0
        assert run('write', 'ramp_time=1.5', file=single.file)[0] == 0
        assert single.drives['conveyor'].value('ramp_time') == 1.5


@pytest.mark.parametrize(('text', 'value'), [
    ('2', 2.0), ('2.5', 2.5), ('25e-1', 2.5), ('.5', 0.5), ('+1', 1.0), ('0x10', 16.0),
    ('1_0', None), ('010', None), ('\uff12', None), ('true', None), ('1e400', None), ('2 ', None),
    ('2,5', None), ('much', None)])
def test_numbers_are_written_as_in_files(run: Run, world: World, text: str,
                                         value: float | None) -> None:
    world.drives['conveyor'].set_value('ramp_time', 3.25)
    code, lines, _ = run('write', 'conveyor', f'ramp_time={text}')
    assert (code, world.drives['conveyor'].value('ramp_time')) == (
        (1, 3.25) if value is None else (0, value))
    if value is None:
        assert f'wrong type: {text!r},' in lines[1]


def test_a_mode_is_the_bridges_whatever_is_written(run: Run, tmp_path: Path) -> None:
    axis = {'bus': 'main', 'protocol': 'cia402', 'station': 7, 'profile': 'cia402_servo',
            'mode': 'pv', 'cyclic_request': ['target_velocity']}
    with a_world(tmp_path, axis=axis) as single:
        for text in ('csv', '9', 'fast'):
            code, lines, _ = run('write', 'axis', f'mode={text}', file=single.file)
            assert code == 1 and f'not written: {sentences.bridge_sets_mode()}' in lines[1]
        assert sentences.bridge_sends_word() in run(
            'write', 'axis', 'x6040.0=6', file=single.file)[1][1]


@pytest.mark.parametrize(('name', 'text', 'value'), [
    ('p30', '100', 1.0), ('p30', '0x64', 1.0), ('p30', '1_0', None), ('p30', '0o17', None),
    ('p30', '1.0', None), ('p30', '\u0661', None), ('brake_enabled', 'true', 1),
    ('brake_enabled', 'false', 0), ('brake_enabled', '1', None), ('brake_enabled', '0', None),
    ('brake_enabled', 'maybe', None)])
def test_integers_and_bools_are_written_as_in_files(run: Run, world: World, name: str, text: str,
                                                    value: float | None) -> None:
    before = world.drives['conveyor'].value(name)
    code, _, _ = run('write', 'conveyor', f'{name}={text}')
    assert (code, world.drives['conveyor'].value(name)) == (
        (1, before) if value is None else (0, value))


def test_a_wrong_file(run: Run, tmp_path: Path) -> None:
    file = parameter_file(tmp_path, {'conveyor': {**CONVEYOR, 'station': 500}})
    code, lines, errors = run('read', file=file)
    assert (code, lines) == (1, [])
    assert f'{file}:' in errors and 'drives.conveyor.station' in errors
    code, _, errors = run('read', file=tmp_path / 'nothing.yaml')
    assert code == 1
    assert len(errors.splitlines()) == 1


def test_in_use(run: Run, world: World) -> None:
    with open_drives(world.file):
        code, lines, errors = run('write', 'lift', 'ramp_time=2')
    assert (code, lines) == (1, [])
    assert errors.startswith(REFUSED['used'].format(os.getpid()))


def test_another_master_ends_it(run: Run, tmp_path: Path) -> None:
    with a_world(tmp_path, conveyor=CONVEYOR, lift=LIFT) as own:
        with stranger(own, frame('3F2#1E00'), after=0.4):
            code, lines, errors = run('read', 'conveyor', file=own.file)
    assert (code, lines) == (1, [])
    assert errors == REFUSED['master']


# -- completion -----------------------------------------------------------------------------------

def typed(line: str) -> dict[str, str]:
    """Return the environment in which a shell asks what to propose."""
    return {'_ARGCOMPLETE': '1', 'COMP_LINE': line, 'COMP_POINT': str(len(line)),
            '_ARGCOMPLETE_IFS': '\n', '_ARGCOMPLETE_SUPPRESS_SPACE': '1'}


@pytest.fixture
def completions(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], list[str]]:
    """Return what would be proposed to a shell."""
    argcomplete = pytest.importorskip('argcomplete')
    # file descriptors 8 and 9 are the shell's, and somebody else's here
    monkeypatch.setattr(argcomplete.CompletionFinder, '_init_debug_stream', lambda _: None)
    monkeypatch.setattr(argcomplete.io, 'debug_stream', io.StringIO())

    def ask(line: str) -> list[str]:
        with monkeypatch.context() as asking, io.StringIO() as answer:
            for name, value in typed(line).items():
                asking.setenv(name, value)
            asking.setattr(argcomplete, 'autocomplete', partial(
                argcomplete.CompletionFinder(), exit_method=sys.exit, output_stream=answer))
            with pytest.raises(SystemExit, match='0'):
                main([])
            return [word.strip() for word in answer.getvalue().split('\n') if word.strip()]
    return ask


def test_completion(tmp_path: Path, completions: Callable[[str], list[str]]) -> None:
    file = parameter_file(tmp_path, {'conveyor': CONVEYOR, 'lift': LIFT})
    start = f'drive_can read --params-file {file} '
    assert {'conveyor', 'lift'} <= set(completions(start))
    assert completions(f'{start}conveyor ram') == ['ramp_time']
    assert 'lift' not in completions(f'{start}conveyor ')
    assert completions(f'{start.replace("read", "write")}lift maxi') == ['maximum_speed=']
    assert {'read', 'record'} <= set(completions('drive_can re'))
    assert completions(f'{start.rstrip()}x conv') == []


@pytest.mark.usefixtures('programs')
def test_a_shell_is_answered_by_its_descriptor(tmp_path: Path) -> None:
    pytest.importorskip('argcomplete')
    file = parameter_file(tmp_path, {'conveyor': CONVEYOR})
    near, far = os.pipe()
    script = (f'import os; os.dup2({far}, 8); os.dup2(2, 9); '
              'from drive_can_bridge.cli.start import main; main()')
    process = subprocess.run(
        [sys.executable, '-c', script], pass_fds=[far], capture_output=True,
        env={**os.environ, **typed(f'drive_can read --params-file {file} conveyor ram')})
    os.close(far)
    with open(near, encoding='utf-8') as answer:
        assert answer.read().split() == ['ramp_time']
    assert process.stdout == b''
