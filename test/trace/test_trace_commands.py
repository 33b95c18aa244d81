# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can record`` and ``drive_can decode``, as a user runs them."""

from collections.abc import Callable, Iterator
import errno
import json
import os
from pathlib import Path
import sys

from asked_bus import drive_can
from builders import frame
import pytest
from transcripts import replayed, shown, stories
from world import World

from drive_can_bridge.cli import record

STORIES = stories(__file__, 'commands.yaml')
FILE = """
/**/drive_can_bridge:
  ros__parameters:
    buses:
      main: {{interface: virtual, channel: {channel}, bitrate: 500000}}
    drives:
      conveyor: {{bus: main, protocol: datamodel_extended, station: 1, profile: datamodel_example,
                 cyclic_request: [speed_setpoint, torque_limit],
                 cyclic_response: [actual_speed, motor_current, status_word]}}
"""
#: how the file of a recording is called that has no other
ALONE = 'the only file'
TRACE = """(1700000000.000000) can0 003FFFF0#138803E800000000 T
(1700000000.001000) can0 103FFFF0#FA24000500030000 R
(1700000000.010000) can0 002001E1#0000000000000000 T
(1700000000.020000) can0 003FFFF0#138803E800000000 T
(1700000000.021000) can0 103FFFF0#FA24000500030000 R
(1700000000.030000) can0 20000004#0020000000000000
(1700000000.040000) can0 003FFFF0#000003E800000000 T
(1700000000.050000) can0 123#00 R
(1700000000.200000) can0 003FFFF0#000003E800000000 T
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / 'bridge.yaml'
    path.write_text(FILE.format(channel=f'trace_{tmp_path.name}'))
    return path


@pytest.fixture
def trace(tmp_path: Path) -> Path:
    path = tmp_path / 'trace.log'
    path.write_text(TRACE)
    return path


@pytest.fixture
def pictures(programs: None, threads: None) -> None:
    """Skip where none can be drawn; the first time on a machine, fonts are looked for."""
    pytest.importorskip('matplotlib')


@pytest.mark.parametrize('story', STORIES)
def test_lines(story: str, file: Path, capsys: pytest.CaptureFixture[str],
               monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(file.parent)
    written = {file.name: file.read_text(), 'trace.log': TRACE}

    def step(step: str) -> list[str]:
        first, *words = step.split()
        if first == 'trace':
            Path(words[0]).write_text(TRACE)
        elif first == 'frames':
            Path(words[0]).write_text(''.join('({}) can0 {} {}\n'.format(*word.split('_'))
                                              for word in words[1:]))
        elif first == 'write':
            Path(words[0]).write_text(json.loads(step.split(maxsplit=2)[2]))
        elif first == 'link':
            Path(words[0]).symlink_to(words[1])
        elif first == 'files':
            return [' '.join(sorted(os.listdir()))]
        elif first == 'show':
            return Path(words[0]).read_text().splitlines()
        elif first == 'unchanged':
            return [str(all(Path(name).read_text() == written[name] for name in words))]
        else:
            code = drive_can(first, *words, '--params-file', file.name)
            out, err = capsys.readouterr()
            return shown(out.splitlines(), err.replace(file.parent.name, '…').splitlines(), code)
        return []
    assert replayed(STORIES[story], step) == STORIES[story]


@pytest.mark.usefixtures('pictures')
def test_what_is_said_of_one_drive(file: Path, trace: Path, tmp_path: Path,
                                   capsys: pytest.CaptureFixture[str]) -> None:
    text = file.read_text()
    file.write_text(text + text[text.index('      conveyor'):].replace(
        'conveyor', 'lift').replace('station: 1', 'station: 2'))
    assert drive_can('decode', trace, '--summary', '--json', '--drive', 'l*',
                     '--params-file', file) == 0
    assert [(each.get('drive'), each.get('bus')) for each in map(
        json.loads, capsys.readouterr().out.splitlines())] == [('lift', None), (None, 'main')]
    assert drive_can('decode', trace, '--summary', '--drive', 'l*', '--params-file', file) == 0
    assert 'conveyor' not in capsys.readouterr().out
    picture = tmp_path / 'values.svg'
    for chosen, code, told in (
            ('conveyor', 0, ''), ('lift', 1, 'none of these values is in the trace\n'),
            ('x*', 1, 'none of these values is in the trace\n')):
        assert drive_can('decode', trace, '--plot', picture, '--drive', chosen,
                         '--params-file', file) == code
        assert capsys.readouterr().err.endswith(told)
    assert 'conveyor.actual_speed' in picture.read_text()


@pytest.mark.usefixtures('pictures')
def test_a_picture_on_a_full_disk(file: Path, trace: Path, tmp_path: Path,
                                  capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / 'values.svg'
    picture.symlink_to('/dev/full')
    assert drive_can('decode', trace, '--params-file', file, '--plot', picture) == 1
    assert capsys.readouterr() == ('', f'drive_can decode: {picture}: No space left on device\n')


def test_a_format_whose_module_is_not_there(file: Path, trace: Path,
                                             monkeypatch: pytest.MonkeyPatch,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, 'asammdf', None)
    wrong = trace.with_suffix('.mf4')
    wrong.write_bytes(b'MDF     4.10    ')
    assert drive_can('decode', wrong, '--params-file', file) == 1
    assert capsys.readouterr() == (
        '', f'drive_can decode: {wrong}: .mf4 needs the Python module asammdf '
        '(pip install asammdf)\n')


@pytest.mark.usefixtures('pictures')
def test_plot(file: Path, trace: Path, tmp_path: Path) -> None:
    picture = tmp_path / 'values.png'
    assert drive_can('decode', '--params-file', file, '--plot', picture,
                     'conveyor.actual_speed', 'conveyor.speed_setpoint', trace) == 0
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert drive_can('decode', trace, '--params-file', file, '--plot', picture) == 0


def test_a_trace_does_not_write_on_the_terminal(file: Path, trace: Path,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    """Names of channels come from whoever made the trace."""
    known = TRACE.replace('can0', 'main')
    trace.write_text(f'{known}(1700000000.300000) ma\x1b[31min{"n" * 300} 123#00\n')
    assert drive_can('decode', trace, '--params-file', file) == 0
    line = capsys.readouterr().out.splitlines()[-1]
    *when, channel, shown = line.split()
    assert (when, shown) == (['0.300000', '+0.000'], '123#00') and len(line) < 300
    assert channel.startswith('ma\\x1b[31minnn') and channel.endswith('n…')


@pytest.fixture
def talker(bench: World, tmp_path: Path) -> Iterator[Callable[[float], None]]:
    """Let somebody talk on the bus of the parameter file, for so many s."""
    clock, wire = bench.clock, bench.wires.of(f'trace_{tmp_path.name}')

    def talk(seconds: float) -> None:
        end = clock.now() + seconds

        def run() -> None:
            while clock.now() < end:
                for text in ('003FFFF0#138803E800000000', '103FFFF0#FA24000500030000'):
                    clock.wait(clock.now() + 0.002)
                    wire.carry(frame(text))
        clock.worker(run, 'talker').start()
    yield talk


def understood(lines: list[str]) -> list[str]:
    """Return what was said, without times."""
    return sorted({line.split(' ', 2)[2].split(' [')[0] for line in lines})


def test_record_then_decode(talker: Callable[[float], None], file: Path, tmp_path: Path,
                            capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / 'out.log'
    talker(2.0)
    assert drive_can('record', '-o', output, '--params-file', file, '--seconds', '0.5') == 0
    said = capsys.readouterr().out
    assert said.startswith('main: ') and said.endswith(f': {output}\n')
    assert drive_can('decode', output, '--params-file', file) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 200 and all(' main conveyor ' in line for line in lines)
    assert drive_can('decode', '--live', '--params-file', file, '--seconds', '0.5') == 0
    assert understood(capsys.readouterr().out.splitlines()) == understood(lines)


def test_a_trace_is_whole_although_its_terminal_has_gone(
        talker: Callable[[float], None], file: Path, tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def gone(*_: object) -> int:
        raise OSError(errno.EIO, 'Input/output error')

    def closed(_: object) -> None:
        monkeypatch.setattr(sys.stderr, 'write', gone)
        raise KeyboardInterrupt
    output = tmp_path / 'out.asc'
    talker(5.0)
    monkeypatch.setattr(sys.stderr, 'isatty', lambda: True)
    looks: list[Callable[[object], None]] = [record._Rotating.look, closed]
    monkeypatch.setattr(record._Rotating, 'look', lambda own: looks.pop(0)(own))
    assert drive_can('record', '-o', output, '--params-file', file) == 0
    assert output.read_text().splitlines()[-1] == 'End TriggerBlock'
    assert capsys.readouterr().out.startswith('main: ')


def test_record_in_files_of_limited_size(talker: Callable[[float], None], file: Path,
                                         tmp_path: Path, capsys: pytest.CaptureFixture[str],
                                         ) -> None:
    output = tmp_path / 'out.log'
    talker(3.0)
    assert drive_can('record', '-o', output, '--params-file', file, '--seconds', '2.5',
                     '--rotate', '0.001', '--json') == 0
    assert not output.exists()
    written = sorted(tmp_path.glob('out_00?.log'))
    assert len(written) >= 2
    document = json.loads(capsys.readouterr().out)
    assert (document['file'], document['files']) == (str(written[-1]), len(written))


def test_all_parts_of_a_recording_are_replaced(talker: Callable[[float], None], file: Path,
                                               tmp_path: Path, capsys: pytest.CaptureFixture[str],
                                               ) -> None:
    for number in (0, 1, 2, 2026):
        (tmp_path / f'out_{number:03d}.log').write_text('of yesterday')
    talker(1.0)
    assert drive_can('record', '-o', tmp_path / 'out.log', '--params-file', file,
                     '--seconds', '0.3', '--rotate', '1') == 0
    assert capsys.readouterr().out.endswith(f'{tmp_path}/out_000.log is {ALONE}\n')
    # what has another number is nobody's part
    assert sorted(each.name for each in tmp_path.glob('*.log')) == ['out_000.log', 'out_2026.log']
    assert 'yesterday' not in (tmp_path / 'out_000.log').read_text()


def test_no_file_is_begun_for_a_bus_that_fell_silent(
        talker: Callable[[float], None], file: Path, tmp_path: Path,
        capsys: pytest.CaptureFixture[str]) -> None:
    talker(0.5)
    assert drive_can('record', '-o', tmp_path / 'out.log', '--params-file', file, '--seconds',
                     '3.5', '--rotate', '0.00001') == 0
    files = sorted(tmp_path.glob('out_*.log'))
    assert files and all(each.stat().st_size for each in files)
    said = ALONE if len(files) == 1 else f'the last of {len(files)} files'
    assert capsys.readouterr().out.endswith(f': {files[-1]} is {said}\n')


@pytest.mark.parametrize(('name', 'code', 'told'), [
    ('out.csv', 0, 'warning: .csv does not keep its direction; .log does'),
    ('out.xyz', 2, 'no trace is written with the suffix .xyz')])
def test_record_says_what_a_format_loses(bench: World, file: Path, tmp_path: Path, name: str,
                                         code: int, told: str,
                                         capsys: pytest.CaptureFixture[str]) -> None:
    assert drive_can('record', '-o', tmp_path / name, '--params-file', file, '--seconds',
                     '0.1') == code
    assert told in capsys.readouterr().err


def test_record_needs_a_bus(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'bridge.yaml'
    file.write_text(FILE.format(channel='x').replace('virtual', 'slcan').replace(
        'channel: x', 'channel: /dev/absent'))
    before = tmp_path / 'out.log'
    before.write_text('of yesterday')
    assert drive_can('record', '-o', before, '--params-file', file) == 1
    assert '/dev/absent' in capsys.readouterr().err
    assert before.read_text() == 'of yesterday'
