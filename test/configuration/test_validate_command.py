# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can validate`` as a user runs it, and the front end around it."""

from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
import json
import os
from pathlib import Path
import re
import signal
import subprocess
import sys

from configuration_builders import changed, FILE, write
from extent import some
import pytest
from transcripts import replayed, shown, stories

import drive_can_bridge
from drive_can_bridge.cli import main as front_end
from drive_can_bridge.compiled import build
from drive_can_bridge.process.beginning import SIGNALS

ROOT = Path(drive_can_bridge.__file__).resolve().parents[1]
STORIES = stories(__file__, 'validate.yaml')
LINE = (r'\w+: bus main \(\w+ \S+\), \w+, station [0-9]+, profile \w+, period [0-9.]+ ms, '
        r'request \[[\w, ]*\], response \[[\w, ]+\], load [0-9.]+ %')
NO_KEY = 'the adapter for slcan does not name'
BESIDE_DEEP = {'f.yaml': FILE + '/other:\n  ros__parameters:\n    a:\n     ',
               'table.yaml': 'protocols: [cannord]\nparameters:\n '}
EXAMPLES = sorted(path.name for path in (ROOT / 'config').glob('*.yaml'))
ENVIRONMENT = {**os.environ, 'PYTHONPATH': os.pathsep.join(
    filter(None, (str(ROOT), os.environ.get('PYTHONPATH'))))}


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command in this process; ``system/`` starts the executable."""
    with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
        try:
            code = front_end.main(arguments)
        except SystemExit as end:  # how argparse ends
            code = int(str(end.code))
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), err.getvalue())


@pytest.mark.parametrize('story', STORIES)
def test_lines(story: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write(Path())

    def step(step: str) -> list[str]:
        verb, _, rest = step.partition(' ')
        if verb == 'validate':
            done = run(verb, *rest.split())
            errors = done.stderr.replace(str(ROOT), '…')
            return shown(done.stdout.splitlines(), errors.splitlines(), done.returncode)
        file, _, text = rest.partition(' ')
        if verb == 'change':
            Path('f.yaml').write_text(changed(Path('f.yaml').read_text(), *rest.split(' => ')))
        elif verb == 'write':
            Path(file).write_text(json.loads(text))
        elif verb == 'copy':
            Path(json.loads(text)).write_text(Path(file).read_text())
        elif verb == 'pipe':
            Path(file).unlink(missing_ok=True)
            os.mkfifo(file)
        elif verb == 'enlarge':
            os.truncate(file, 5 << 20)
        elif verb == 'nest':
            nest = json.loads(text)
            Path(file).write_text(BESIDE_DEEP[file] + nest * (200_000 // len(nest)))
        return []
    assert replayed(STORIES[story], step) == STORIES[story]


def test_a_long_channel_is_cut(tmp_path: Path) -> None:
    path = write(tmp_path, changed(FILE, 'channel: demo', f'channel: {100_000 * "x"}'))
    done = run('validate', str(path))
    assert done.returncode == 0
    assert f'(virtual {247 * "x"}…)' in done.stdout
    assert max(map(len, done.stdout.splitlines())) < 500


@pytest.mark.parametrize(('arguments', 'program'), [
    ([], ''), (['validat', 'a'], ''), (['--nothing'], ''), (['validate'], ' validate'),
    (['validate', 'a', 'b'], ' validate'), (['validate', '--nothing', 'a'], ' validate'),
    (['validate', 'a', '--a\nb'], ' validate'), (['simulate'], ' simulate'),
    (['simulate', '--params-file'], ' simulate'), (['profile', 'show'], ' profile show'),
    (['monitor', '--namespace', 'no-name'], ' monitor'), (['monitor', 'something'], ' monitor'),
    (['monitor', '--speed'], ' monitor'), (['panel', '--namespace', 'no-name'], ' panel'),
    (['panel', '--port', '70000'], ' panel'), (['panel', '--port', 'x'], ' panel'),
    (['panel', 'something'], ' panel')])
def test_wrong_usage(arguments: list[str], program: str) -> None:
    done = run(*arguments)
    assert done.returncode == 2
    assert done.stdout == ''
    line, = done.stderr.splitlines()
    assert re.fullmatch(f'drive_can{program}: .+; see drive_can{program} --help', line)


def test_version_and_help() -> None:
    assert run('--version').stdout == (
        f'drive_can {drive_can_bridge.__version__} ({build()})\n')
    done = run('--help')
    assert done.returncode == 0
    for name in ('validate', 'simulate', 'demo'):
        assert f'\n  {name} ' in done.stdout


@pytest.mark.parametrize('name', EXAMPLES)
def test_shipped_examples(name: str) -> None:
    file = ROOT / 'config' / name
    done = run('validate', str(file))
    assert done.returncode == 0
    for line in done.stderr.splitlines():   # each python-can names the keys of its adapters itself
        assert NO_KEY in line
    text = file.read_text(encoding='utf-8')
    drives = re.findall(r'^      (\w+):', text[text.index('\n    drives:'):], re.MULTILINE)
    lines = done.stdout.splitlines()
    assert [line.split(':')[0] for line in lines] == drives
    for line in lines:
        assert re.fullmatch(LINE, line)


@pytest.mark.usefixtures('programs')
def test_needs_neither_ros_nor_a_bus_library(tmp_path: Path) -> None:
    code = ('import sys\n'
            'class Block:\n'
            '    def find_spec(self, name, path=None, target=None):\n'
            '        if name.split(".")[0] in ("can", "rclpy", "rich", "serial"):\n'
            '            raise ModuleNotFoundError(name, name=name)\n'
            'sys.meta_path.insert(0, Block())\n'
            'from drive_can_bridge.cli.main import main\n'
            f'sys.exit(main(["validate", {str(write(tmp_path))!r}]))\n')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          env=ENVIRONMENT, check=False)
    assert done.returncode == 0
    assert len(done.stdout.splitlines()) == 2
    assert done.stderr == ('warning: python-can is not installed: interfaces and adapter keys are '
                           'unchecked\n')


@pytest.mark.usefixtures('programs')
def test_reader_that_went_away(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, 'w') as gone:
        done = subprocess.run(
            [sys.executable, '-m', 'drive_can_bridge.cli.main', 'validate', str(write(tmp_path))],
            stdout=gone, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT, check=False)
    # all is checked, and right
    assert (done.returncode, done.stderr) == (0, '')


@pytest.mark.usefixtures('programs')
def test_reader_who_has_seen_enough(tmp_path: Path) -> None:
    trace = tmp_path / 'long.log'
    trace.write_text('(1.0) can0 123#00\n' * 20_000)
    with subprocess.Popen(
            [sys.executable, '-m', 'drive_can_bridge.cli.main', 'decode', str(trace),
             '--params-file', str(write(tmp_path))], stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, env=ENVIRONMENT) as decoding:
        assert decoding.stdout is not None and decoding.stderr is not None
        assert b'123#00' in decoding.stdout.readline()
        decoding.stdout.close()
        assert (decoding.wait(), decoding.stderr.read()) == (0, b'')


@pytest.mark.usefixtures('programs')
@pytest.mark.parametrize(('there', 'closed'), some([
    (True, '>&-'), (True, '2>&-'), (False, '2>&-'), (False, '>&-'), (True, '>&- 2>&-'),
    (False, '>&- 2>&-')], 2))
def test_outputs_that_are_closed(there: bool, closed: str, tmp_path: Path) -> None:
    file = write(tmp_path) if there else tmp_path / 'absent.yaml'
    done = subprocess.run(
        f'exec {sys.executable} -m drive_can_bridge.cli.start validate {file} {closed}',
        shell=True, stdin=subprocess.DEVNULL, capture_output=True, text=True,
        env=ENVIRONMENT, check=False)
    assert done.returncode == (0 if there else 1)
    assert 'internal error' not in done.stdout + done.stderr


@pytest.mark.usefixtures('programs')
@pytest.mark.parametrize(('encoding', 'subcommand'), some([
    ('ascii', 'scan'), ('latin-1', 'scan'), ('latin-1', 'simulate'), ('ascii', 'simulate')], 2))
def test_terminals_that_lack_characters(encoding: str, subcommand: str) -> None:
    done = subprocess.run(
        [sys.executable, '-m', 'drive_can_bridge.cli.main', subcommand, '--help'],
        capture_output=True, env={**ENVIRONMENT, 'PYTHONIOENCODING': encoding}, check=False)
    assert (done.returncode, done.stderr) == (0, b'')
    assert b'\\u2026' in done.stdout


@pytest.mark.parametrize(('error', 'code', 'line'), [
    (ValueError('odd'), 1, ': internal error, please report it: ValueError: odd'),
    (ModuleNotFoundError('no', name='rclpy'), 1,
     ': this needs a Python module that is not installed: rclpy'),
    (OSError(28, 'No space left on device'), 1, ': No space left on device'),
    (OSError('odd'), 1, ': odd'),
    (KeyboardInterrupt(), 130, ' validate: interrupted'),
])
def test_never_a_traceback(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
                           error: BaseException, code: int, line: str) -> None:
    def fail(*_: object, **more: object) -> int:
        raise error

    monkeypatch.setattr(front_end, '_run', fail)
    assert front_end.main(['validate'] if code == 130 else []) == code
    assert capsys.readouterr() == ('', f'drive_can{line}\n')


def test_an_interrupt_is_how_the_endless_ones_end(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: object, **more: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(front_end, '_run', stop)
    for endless in (['simulate'], ['record'], ['decode', '--live']):
        assert front_end.main(endless) == 0


@pytest.fixture
def handlers(foreground: None) -> Iterator[None]:
    """Have the handlers of signals put back."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures('handlers')
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize('words', ['simulate', 'record', 'decode --live', 'read --watch=1'])
def test_they_end_so_by_a_signal_and_when_their_terminal_is_closed(
        monkeypatch: pytest.MonkeyPatch, words: str, number: int) -> None:
    def stop(*_: object, **more: object) -> int:
        if signal.getsignal(number) is not signal.SIG_DFL:
            signal.raise_signal(number)
        return 3
    monkeypatch.setattr(front_end, '_run', stop)
    monkeypatch.setattr(sys, 'argv', ['drive_can', *words.split()])
    assert front_end.main() == 0
    signal.raise_signal(signal.SIGTERM)     # all is done


@pytest.mark.usefixtures('handlers')
def test_a_terminal_that_is_not_to_matter_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    def go_on(*_: object, **more: object) -> int:
        signal.raise_signal(signal.SIGHUP)
        return 3
    signal.signal(signal.SIGHUP, signal.SIG_IGN)    # as nohup has it
    monkeypatch.setattr(front_end, '_run', go_on)
    monkeypatch.setattr(sys, 'argv', ['drive_can', 'record'])
    assert front_end.main() == 3


@pytest.mark.parametrize(('old', 'new', 'key', 'line'), [
    ('main:\n', '"a b":\n', 'buses.a b', 5),
    ('    autostart: true\n', '    <<: 1\n', '<<', 3),
])
def test_json_names_any_key(tmp_path: Path, old: str, new: str, key: str, line: int) -> None:
    file = tmp_path / 'part: 7: f.yaml'
    file.write_text(changed(changed(FILE, 'profile: table', 'profile: datamodel_example'),
                            old, new))
    found = [json.loads(each) for each in run('validate', '--json', str(file)).stdout.splitlines()]
    assert (str(file), line, key) in [
        (each['file'], each['line'], each['key']) for each in found]
    assert not any(each['message'].startswith(key) for each in found)
