# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Reading and writing traces: candump's texts, python-can's formats, what is damaged."""

from collections.abc import Callable
from contextlib import closing
from datetime import datetime
from errno import EIO, ENOSPC
import gzip
import io
from pathlib import Path
import re
import sqlite3
import subprocess
import sys

import can
from hypothesis import given, strategies as st
import pytest

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.frame import Record, RecordKind
from drive_can_bridge.trace import files
from drive_can_bridge.trace.candump import format_record, parse_line
from drive_can_bridge.trace.channels import Channels, labels
from drive_can_bridge.trace.files import read_records
from drive_can_bridge.trace.formats import check_writable, UnknownFormat, WRITABLE
from drive_can_bridge.trace.writers import TraceWriter

DATA, ERROR = RecordKind.DATA, RecordKind.ERROR


# as candump writes them (can-utils): log file, log file with direction, screen, screen with -x
@pytest.mark.parametrize(('line', 'record'), [
    ('(1436509052.249713) vcan0 044#2A366C2BBA',
     Record(1436509052.249713, 'vcan0', 0x44, bytes.fromhex('2A366C2BBA'), False)),
    ('(1.5) can0 003FFFF0#05DC000000000000 T',
     Record(1.5, 'can0', 0x3FFFF0, bytes.fromhex('05DC000000000000'), True, DATA, True)),
    ('(1.5) can0 7FF# R', Record(1.5, 'can0', 0x7FF, b'', False, DATA, False)),
    ('(1.5) can0 000003F1#00', Record(1.5, 'can0', 0x3F1, b'\0', True)),
    ('(1.5) can0 123#R', Record(1.5, 'can0', 0x123, b'', False, RecordKind.REMOTE)),
    ('(1.5) can0 123#R8', Record(1.5, 'can0', 0x123, b'', False, RecordKind.REMOTE)),
    ('(1.5) can0 123##1AABB', Record(1.5, 'can0', 0x123, b'\xAA\xBB', False, RecordKind.FD)),
    # the controller is error-passive: no data frame 004h
    ('(1.5) can0 20000004#0020000000000000',
     Record(1.5, 'can0', 4, bytes.fromhex('0020000000000000'), True, ERROR)),
    ('  vcan0  7FF   [2]  11 22', Record(0.0, 'vcan0', 0x7FF, b'\x11\x22', False)),
    (' (1.250000)  can0  RX - -  003FFFF0   [3]  0A 0B 0C',
     Record(1.25, 'can0', 0x3FFFF0, b'\x0A\x0B\x0C', True, DATA, False)),
    (" (1.250000)  can0  TX - -  123   [2]  41 42   'AB'",
     Record(1.25, 'can0', 0x123, b'AB', False, DATA, True)),
    # -t A
    (' (2026-11-21 23:04:38.250000)  can0  RX - -  123   [2]  41 42',
     Record(datetime(2026, 11, 21, 23, 4, 38, 250_000).timestamp(), 'can0', 0x123, b'AB', False,
            DATA, False)),
    (' (2026-11-21 23:04:38.250000)  can0  123   [0]',
     Record(datetime(2026, 11, 21, 23, 4, 38, 250_000).timestamp(), 'can0', 0x123, b'', False)),
    ('  can0  123   [4]  remote request', Record(0.0, 'can0', 0x123, b'', False,
                                                 RecordKind.REMOTE)),
    # times that were filled up with blanks, remarks of tools and people behind a frame
    ('(         0.191254) can0 06314000#40', Record(0.191254, 'can0', 0x6314000, b'\x40', True)),
    ('(    0.5) can0 0E094003#000A   T  answers', Record(
        0.5, 'can0', 0xE094003, b'\0\x0A', True, DATA, True)),
    ('(0.5) can0 0E094003#000A   the body computer asks', Record(
        0.5, 'can0', 0xE094003, b'\0\x0A', True)),
    # candump -8
    ('(1.5) can0 5A1#0011223344556677_9 R', Record(1.5, 'can0', 0x5A1, bytes.fromhex(
        '0011223344556677'), False, DATA, False)),
    ('  can0  5A1   {F}  00 11 22 33 44 55 66 77',
     Record(0.0, 'can0', 0x5A1, bytes.fromhex('0011223344556677'), False)),
    ('(1.5) can0 5A1#R8_B', Record(1.5, 'can0', 0x5A1, b'', False, RecordKind.REMOTE)),
    ('  can0  20000040   [8]  00 00 00 00 00 00 00 00   ERRORFRAME',
     Record(0.0, 'can0', 0x40, bytes(8), True, ERROR)),
])
def test_lines_of_candump(line: str, record: Record) -> None:
    assert parse_line(line) == record
    assert parse_line(f'{line}\n') == record


def test_bytes_that_are_no_text_on_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    given = io.BytesIO(b'\xff\n(1.5) can0 7FF#\n')
    monkeypatch.setattr(sys, 'stdin', io.TextIOWrapper(given, encoding='utf-8'))
    told: list[str] = []
    assert [record.identifier for record in read_records(Path('-'), told.append)] == [0x7FF]
    assert told == ['line 1: neither a line of a candump log nor of its screen']


@pytest.mark.parametrize('line', ['', '   \n'])
def test_nothing(line: str) -> None:
    assert parse_line(line) is None


@pytest.mark.parametrize('line', [
    'x', '(1.0) can0', '(1.0) can0 12#00', '(1.0) can0 -12#00', '(1.0) can0 800#00',
    '(1.0) can0 123#0', '(1.0) can0 123#001122334455667788', '(nan) can0 123#00',
    '(inf) can0 123#00', '(1e30) can0 123#00', '(-1e30) can0 123#00', '(1e30) can0 123#R',
    '(253402300800) can0 123#00', ' (1e30)  can0  RX - -  123   [1]  41',
    '(1.0) can0 123456789#00', '(1.0) can0 123', 'can0 123 [2] 00',
    'can0 123 [x] 00', '(1.0) can0 0-1#00', '(2026-11-31 23:04:38.250000)  can0  123   [0]',
    '(2026-11-21 23:04:38.250000)  123  [0]',
    '(1.0) can0 123#0102_C', 'can0 123 {C} 00',
    '(1.0) can0 123#0102030405060708_8', 'can0 123 {8} 01 02 03 04 05 06 07 08',
    '(2026-11-21  can0  123   [0]', '(', '( 1.0) can0', '( x) can0 123#00',
    # two lines, of which the first has lost its end
    '(1.0) can0 123#00 (1.1) can0 123#01', '(1.0) can0 123#00 can0 123#01',
])
def test_what_is_no_line_of_candump(line: str) -> None:
    with pytest.raises(ValueError):
        parse_line(line)


@given(st.one_of(
    st.text(), st.text('(10.) can#ABCDEFRT[]8'),
    st.builds('({}) {} {}#{} {}'.format, st.floats(), st.text(min_size=1), st.text('0123AF'),
              st.text('0123AFR#'), st.sampled_from(['R', 'T', '', 'x']))))
def test_any_line(line: str) -> None:
    try:
        record = parse_line(line)
    except ValueError:
        return
    if record is not None and record.kind is DATA:
        assert 0 <= record.identifier <= (0x1FFFFFFF if record.extended else 0x7FF)
        assert len(record.data) <= 8


RECORDS = st.builds(
    Record, st.floats(0, 2e9), st.just('can0'), st.integers(0, 0x7FF), st.binary(max_size=8),
    st.booleans(), st.sampled_from([DATA, ERROR]), st.booleans())


@given(RECORDS)
def test_candump_loses_nothing(record: Record) -> None:
    read = parse_line(format_record(record))
    assert read is not None
    assert abs(read.time - record.time) < 1e-5
    expected = record._replace(extended=record.extended or record.kind is ERROR)
    assert read._replace(time=record.time) == expected


TRACE = [
    Record(1700000000.0, 'can0', 0x3FFFF0, bytes.fromhex('05DC000000000000'), True, DATA, True),
    Record(1700000000.001, 'can0', 0x103FFFF0, bytes.fromhex('1122'), True, DATA, False),
    Record(1700000000.02, 'can1', 0x3F1, bytes.fromhex('03D1000100000000'), False, DATA, True),
    Record(1700000000.03, 'can1', 0x7F1, b'', False, DATA, False),
]


@pytest.mark.usefixtures('threads')
@pytest.mark.parametrize('suffix', WRITABLE)
def test_every_format_keeps_the_frames(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f'trace{suffix}'
    one_bus = suffix in ('.csv', '.db')
    writer = TraceWriter(path, ['can0'] if one_bus else ['can0', 'can1'])
    for record in TRACE:
        writer.write(record)
    writer.close()
    complaints: list[str] = []
    found = list(read_records(path, complaints.append))
    assert complaints == []
    assert [(r.identifier, r.data, r.extended, r.kind) for r in found] == [
        (r.identifier, r.data, r.extended, r.kind) for r in TRACE]
    assert [round(r.time - found[0].time, 3) for r in found] == [0.0, 0.001, 0.02, 0.03]
    if not one_bus:     # the others say that they lose this
        assert [r.sent for r in found] == [True, False, True, False]
        assert [r.channel for r in found] == (
            ['can0', 'can0', 'can1', 'can1'] if suffix == '.log' else [1, 1, 2, 2])


def test_a_log_for_wireshark_has_no_directions(tmp_path: Path) -> None:
    """Tshark 4.0 refuses candump's lines that end in R or T."""
    path = tmp_path / 'trace.log'
    writer = TraceWriter(path, ['can0', 'can1'], directions=False)
    for record in TRACE[:2]:
        writer.write(record)
    writer.close()
    assert path.read_text() == ('(1700000000.000000) can0 003FFFF0#05DC000000000000\n'
                                '(1700000000.001000) can0 103FFFF0#1122\n')


def test_what_a_trc_cannot_hold_costs_no_line_each(
        tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / 'trace.trc'
    writer = TraceWriter(path, ['can0', 'can1'])
    for kind in (DATA, ERROR, RecordKind.REMOTE, RecordKind.FD):
        writer.write(TRACE[0]._replace(kind=kind))
    writer.close()
    assert caplog.messages == []
    assert len(list(read_records(path, print))) == 1


def test_formats_that_are_refused() -> None:
    with pytest.raises(UnknownFormat, match='no trace is written with the suffix .pcap'):
        check_writable(Path('a.pcap'), 1)
    with pytest.raises(UnknownFormat, match='does not tell buses apart'):
        check_writable(Path('a.csv'), 2)
    with pytest.raises(UnknownFormat, match='no trace format has the suffix'):
        list(read_records(Path('trace'), print))
    with pytest.raises(FileNotFoundError):
        list(read_records(Path('/nowhere/trace.db'), print))


@pytest.mark.parametrize('suffix', ['.log', '.asc', '.csv', '.trc'])
def test_a_damaged_line_does_not_end_a_text(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f'trace{suffix}'
    writer = TraceWriter(path, ['can0'])
    for _ in range(3):
        for record in TRACE:
            writer.write(record)
    writer.close()
    lines = path.read_text().splitlines()
    place = next(number for number, line in enumerate(lines) if '7F1' in line.upper())
    damaged = lines[place].replace('7F1', 'xyz').replace('7f1', 'xyz')
    lines[place] = damaged
    path.write_text('\n'.join(lines) + '\n')
    complaints: list[str] = []
    found = list(read_records(path, complaints.append))
    assert len(found) == 11
    # a line that the reader for .asc does not take for a frame is a comment to it
    assert len(complaints) == 1


def test_a_packed_text(tmp_path: Path) -> None:
    path = tmp_path / 'trace.log.gz'
    with gzip.open(path, 'wt') as file:
        file.writelines(format_record(record) for record in TRACE)
    assert list(read_records(path, print)) == TRACE
    path.write_bytes(path.read_bytes()[:-10])
    complaints: list[str] = []
    list(read_records(path, complaints.append))
    assert len(complaints) == 1


@pytest.mark.parametrize('suffix', ['.log', '.asc', '.csv', '.trc'])
@pytest.mark.parametrize('damage', [
    lambda data: data[:-10],
    lambda data: data[:len(data) // 2],
    lambda data: data[:len(data) // 2] + bytes(64) + data[len(data) // 2 + 64:],
    lambda data: b'no gzip',
], ids=['no end', 'half', 'other bytes', 'something else'])
def test_a_packed_text_that_is_damaged_ends_there(
        suffix: str, damage: Callable[[bytes], bytes], tmp_path: Path) -> None:
    path = tmp_path / f'trace{suffix}'
    writer = TraceWriter(path, ['can0'])
    for number in range(200):
        for record in TRACE:
            writer.write(record._replace(time=TRACE[0].time + 0.001 * number))
    writer.close()
    packed = tmp_path / f'trace{suffix}.gz'
    packed.write_bytes(damage(gzip.compress(path.read_bytes())))
    complaints: list[str] = []

    def complain(text: str) -> None:
        complaints.append(text)
        assert len(complaints) <= len(TRACE) * 200     # lines of rubbish are told, too
    assert len(list(read_records(packed, complain))) <= len(TRACE) * 200
    assert 'unpacked' in complaints[-1]


def test_a_text_that_cannot_be_read_on_is_an_error(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken(io.StringIO):
        def __next__(self) -> str:
            raise OSError(EIO, 'Input/output error')
    path = tmp_path / 'trace.asc'
    path.touch()
    monkeypatch.setattr(files, '_open_text', lambda path, packed: Broken())
    complaints: list[str] = []

    def complain(text: str) -> None:
        complaints.append(text)
        assert not complaints
    with pytest.raises(OSError, match='Input/output error'):
        list(read_records(path, complain))


@pytest.mark.parametrize('told', ['absolute', 'relative', 'Relative'])
def test_times_of_vector_that_are_told_from_the_last_line(told: str, tmp_path: Path) -> None:
    times = [0.0, 0.01, 0.001, 0.0005, 0.019] if told != 'absolute' else [
        0.0, 0.01, 0.011, 0.0115, 0.0305]
    path = tmp_path / 'trace.asc'
    path.write_text(
        f'date Wed Nov 22 10:20:30.123 am 2023\nbase hex  timestamps {told}\n'
        'internal events logged\n// version 9.0.0\n'
        f'   {times[0]:.6f} Start of measurement\n'
        f'   {times[1]:.6f} 1  7F1             Rx   d 2 01 02\n'
        f'   {times[2]:.6f} 1  xyz             Rx   d x 01 02\n'
        f'   {times[3]:.6f} 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\n'
        f'   {times[4]:.6f} 1  7F1             Rx   d 2 01 02\n')
    complaints: list[str] = []
    found = [record.time for record in read_records(path, complaints.append)]
    assert found == pytest.approx([0.01, 0.0305])
    assert complaints == ['line 7: no entry of a .asc trace', 'passed over: Statistic (1)']


@pytest.mark.parametrize('behind', [0.007, 0.05, 0.7])
def test_the_date_of_a_trace_for_vector_has_its_milliseconds(
        behind: float, tmp_path: Path) -> None:
    """Where they are fewer than 100, python-can's writer leaves out the zeros in front."""
    path = tmp_path / 'trace.asc'
    writer = TraceWriter(path, ['can0'])
    writer.write(TRACE[0]._replace(time=1_700_000_000 + behind))
    writer.close()
    date, = re.findall(r'Begin Triggerblock .*:\d\d(\.\d+) ', path.read_text())
    assert float(date) == pytest.approx(behind, abs=0.001)


def test_the_first_frame_of_vector_may_follow_the_base(tmp_path: Path) -> None:
    path = tmp_path / 'trace.asc'
    path.write_text('base dec  timestamps absolute\n   0.5 1  2033  Rx   d 2 10 20\n')
    record, = read_records(path, print)
    assert (record.identifier, record.data) == (0x7F1, bytes([10, 20]))


def test_the_details_of_candump_behind_an_error_frame_are_no_damage(tmp_path: Path) -> None:
    """As candump -e of can-utils 2023.03 writes them."""
    path = tmp_path / 'screen.txt'
    path.write_text(' (0.5)  can0  20000008   [8]  00 00 04 19 00 00 00 00   ERRORFRAME\n'
                    '\tprotocol-violation{{bit-stuffing-error}{acknowledge-slot}}\n'
                    '\tbus-error\n'
                    ' (0.6)  can0  123   [1]  05\n'
                    '\tbus-error\n')
    complaints: list[str] = []
    assert [each.kind for each in read_records(path, complaints.append)] == [ERROR, DATA]
    assert complaints == ['line 5: neither a line of a candump log nor of its screen']


def screen(*times: float) -> str:
    return ''.join(f' ({time:010.6f})  vcan0  7F1   [1]  0A\n' for time in times)


@pytest.mark.parametrize(('written', 'meant', 'told'), [
    ([0.0, 0.25, 0.25, 0.001, 0.25], [0.0, 0.25, 0.5, 0.501, 0.751], 1),
    ([0.0] + 100 * [0.5], [0.5 * number for number in range(101)], 1),
    # -t z: of two buses one entry may come a little late
    ([0.0, 0.25, 0.5, 0.75], [0.0, 0.25, 0.5, 0.75], 0),
    ([0.01 * number for number in range(20)] + [0.189], [0.01 * number for number in range(20)]
     + [0.189], 0),
    ([0.0], [0.0], 0),
])
def test_times_of_candump_since_the_line_before(
        written: list[float], meant: list[float], told: int, tmp_path: Path) -> None:
    path = tmp_path / 'screen.txt'
    path.write_text(screen(*written))
    complaints: list[str] = []
    assert [each.time for each in read_records(path, complaints.append)] == pytest.approx(meant)
    assert complaints == told * [
        'times are those since the line before (candump -t d): added up']


def vector(path: Path, *lines: str, base: str = 'hex') -> Path:
    path.write_text(f'date Tue May 7 08:00:00.000 am 2024\nbase {base}  timestamps absolute\n'
                    'no internal events logged\n' + ''.join(f'{line}\n' for line in lines))
    return path


@pytest.mark.parametrize(('line', 'record'), [
    ('   0.5 CANFD   1 Rx   1F3x                 0 0 2  2 AA BB   9000  80   200000 0 0 0 0 0',
     (0x1F3, b'\xAA\xBB', True, DATA)),
    ('   0.5 CANFD   1 Tx    1F3   Some_Name     0 0 0  0   9000  80   200040 0 0 0 0 0',
     (0x1F3, b'', False, DATA)),
    ('   0.5 CANFD   1 Rx    1F3                 0 0 4  0   9000  80   200010 0 0 0 0 0',
     (0x1F3, b'', False, RecordKind.REMOTE)),
    ('   0.5 CANFD   1 Rx    1F3                 1 0 9 12 0 1 2 3 4 5 6 7 8 9 A B  9000  80   '
     '303000 0 0 0 0 0', (0x1F3, bytes(range(12)), False, RecordKind.FD)),
])
def test_canfd_lines_of_vector(line: str, record: tuple[object, ...], tmp_path: Path) -> None:
    """Without EDL in the flags (CANoe's .asc), a frame is a classical one."""
    complaints: list[str] = []
    found, = read_records(vector(tmp_path / 'trace.asc', line), complaints.append)
    assert (found.identifier, found.data, found.extended, found.kind) == record
    assert complaints == []


def test_what_is_to_be_sent_is_no_frame_yet(tmp_path: Path) -> None:
    path = vector(tmp_path / 'trace.asc',
                  '   0.5 1  7F1             TxRq d 1 05', '   0.6 1  7F1             Tx   d 1 05')
    assert [(each.time, each.sent) for each in read_records(path, lambda _: None)] == [(0.6, True)]


@pytest.mark.parametrize(('name', 'content', 'told'), [
    ('a.trc', 'Time;ID;Data\n0.5;1F3;05\n', 'of PEAK: its first line is neither a comment'),
    ('a.trc', '\n\nsome text\n', 'of PEAK: its first line is neither a comment'),
    ('a.asc', '<xml/>\n', 'of Vector: it begins with neither "date" nor "base"'),
    ('a.csv', '"Time";"Identifier (hex)";"Format";"Data (hex)"\n"00:00:01";"7F1";"Std";"05 "\n',
     'of python-can: its first line is not "timestamp,arbitration_id,…"'),
    ('a.blf', 'a text', 'of Vector'), ('a.db', 'a text', 'of python-can'),
    ('a.mf4', 'a text', '(ASAM MDF 4)')])
def test_a_file_of_another_kind_is_refused_in_words(
        name: str, content: str, told: str, tmp_path: Path) -> None:
    """One of them is IXXAT's."""
    (tmp_path / name).write_text(content)
    complaints: list[str] = []
    assert list(read_records(tmp_path / name, complaints.append)) == []
    suffix = Path(name).suffix
    assert [each.startswith(f'this is no {suffix} trace {told}') for each in complaints] == [True]


@pytest.mark.parametrize('suffix', ['.asc', '.blf', '.csv', '.db', '.mf4', '.trc', '.log'])
def test_an_empty_file_has_no_frame(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f'trace{suffix}'
    path.touch()
    complaints: list[str] = []
    assert list(read_records(path, complaints.append)) == []
    assert complaints == []


def test_what_is_wrong_in_a_text_has_its_line(tmp_path: Path) -> None:
    path = vector(tmp_path / 'trace.asc', '   0.5 1  7F1             Rx   d 1 05',
                  '   0.6 1  7F1             Rx   d 1 xy',
                  '   0.7 1  7F1             Rx   d 1 06',
                  '   0.8 1  8F1             Rx   d 1 06', '   0.9 1  7F1             Rx   d 1 07')
    complaints: list[str] = []
    assert [each.data[0] for each in read_records(path, complaints.append)] == [5, 6, 7]
    assert complaints == ['line 5: no entry of a .asc trace', 'line 7: identifier 8F1h']
    path = tmp_path / 'trace.trc'
    path.write_text(';$FILEVERSION=1.1\n;$STARTTIME=45000.5\n;\n'
                    '     1)         1.0  Rx         01F3  1  05\n'
                    '     2)         2.0  Rx\n'
                    '     3)         3.0  Rx         01F3  1  zz\n'
                    '     4)         4.0  Rx         01F3  1  06\n')
    complaints.clear()
    assert [each.data[0] for each in read_records(path, complaints.append)] == [5, 6]
    assert complaints == ['line 5: no entry of a .trc trace', 'line 6: no entry of a .trc trace']


def test_an_impossible_entry_does_not_end_a_database(tmp_path: Path) -> None:
    """Twelve bytes are of CAN FD, which python-can 4.6 does not write into a database."""
    path = tmp_path / 'trace.db'
    with closing(sqlite3.connect(path)) as database, database:
        database.execute('CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended '
                         'INTEGER, remote INTEGER, error INTEGER, dlc INTEGER, data BLOB)')
        database.executemany('INSERT INTO messages VALUES (?, ?, ?, 0, 0, 0, ?)', [
            (0.5, 0x1F3, 0, b'\5'), (0.6, 0x1F3, 0, bytes(12)), (0.7, 0x9F3, 0, b''),
            (0.8, 0x1F3, 0, bytes(9)), (None, 0x1F3, 0, b''), (0.9, 0x9F3, 1, None)])
    complaints: list[str] = []
    assert [(each.identifier, len(each.data), each.extended, each.kind)
            for each in read_records(path, complaints.append)] == [
        (0x1F3, 1, False, DATA), (0x1F3, 12, False, RecordKind.FD), (0x9F3, 0, True, DATA)]
    assert complaints[:2] == ['entry 3: identifier 9F3h', 'entry 4: 9 data bytes']
    assert len(complaints) == 3 and complaints[2].startswith('entry 5: ')


def test_an_impossible_entry_does_not_end_a_binary_file(tmp_path: Path) -> None:
    path = tmp_path / 'trace.blf'
    writer = can.BLFWriter(path)
    for identifier in (0x1F3, 0x9F3, 0x1F4):
        writer.on_message_received(can.Message(arbitration_id=identifier, is_extended_id=False))
    writer.stop()
    complaints: list[str] = []
    assert [each.identifier for each in read_records(path, complaints.append)] == [0x1F3, 0x1F4]
    assert complaints == ['entry 2: identifier 9F3h']


@pytest.mark.parametrize(('name', 'lines'), [
    ('a.asc', 'base hex  timestamps absolute\n   0.5 3  1F3  Rx   d 1 05\n'),
    ('a.trc', ';$FILEVERSION=1.3\n;$STARTTIME=45000.5\n;\n'
              '     1)         1.0 3  Rx         01F3  -  1  05\n')])
def test_channels_are_those_of_the_tool_of_the_format(
        name: str, lines: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(lines)
    assert [each.channel for each in read_records(tmp_path / name, print)] == [3]


def test_a_byte_order_mark_costs_nothing(tmp_path: Path) -> None:
    path = tmp_path / 'trace.log'
    path.write_text(''.join(map(format_record, TRACE)), encoding='utf-8-sig')
    assert list(read_records(path, print)) == TRACE


@pytest.mark.parametrize('suffix', [each for each in WRITABLE if each != '.db'])
def test_a_full_disk_is_told_with_the_name_of_the_file(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f'trace{suffix}'
    path.symlink_to('/dev/full')
    writer = TraceWriter(path, ['can0'])
    with pytest.raises(OSError) as raised:
        for record in 4000 * TRACE:
            writer.write(record)
        writer.close()
    assert (raised.value.errno, raised.value.filename) == (ENOSPC, str(path))


#: sqlite takes a limit of the process for a full disk
FULL = """
import pathlib, resource, sys, time
from drive_can_bridge.core.frame import Record
from drive_can_bridge.trace.writers import TraceWriter
path, looking = pathlib.Path(sys.argv[1]), sys.argv[2] == 'looking'
resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))
writer = TraceWriter(path, ['can0'])
try:
    for number in range(5000):
        writer.write(Record(1.0 * number, 'can0', 0x123, bytes(8), False))
    while looking:
        writer.flush()
        time.sleep(0.01)
    writer.close()
except OSError as error:
    print(error.filename, error.strerror)
    if looking:
        try:
            writer.close()
        except OSError:
            pass
"""


@pytest.mark.usefixtures('programs')
@pytest.mark.parametrize('way', ['looking', 'closing'])
def test_a_database_that_cannot_be_written(way: str, tmp_path: Path) -> None:
    path = tmp_path / 'trace.db'
    told = subprocess.run([sys.executable, '-c', FULL, path, way], capture_output=True, text=True,
                          check=True)
    reasons = ('disk I/O error', 'database or disk is full')
    assert told.stdout in (f'{path} {reason}\n' for reason in reasons)
    assert told.stderr == ''


@pytest.mark.usefixtures('threads')
def test_a_database_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / 'trace.db'
    path.write_text('of yesterday')
    for _ in range(2):
        writer = TraceWriter(path, ['can0'])
        for record in TRACE:
            writer.write(record)
        writer.close()
    assert len(list(read_records(path, print))) == len(TRACE)


def bus(name: str, channel: str, interface: str = 'socketcan') -> BusConfiguration:
    return BusConfiguration(name, interface, channel)


@pytest.mark.parametrize(('buses', 'said', 'found'), [
    ([bus('main', 'can0'), bus('aux', 'can1')], ['can0', 'can1'],
     {'main': 'main', 'can0': 'main', 'can1': 'aux', 'can2': None, 1: 'main', 2: 'aux',
      3: None, 0: None}),
    ([bus('can1', 'can0'), bus('can0', 'can1')], ['can1', 'can0'],
     {'can0': 'can0', 'can1': 'can1'}),
    ([bus('main', 'can0'), bus('can0', 'can2')], ['main', 'can2'],
     {'main': 'main', 'can0': 'can0', 'can2': 'can0'}),
    ([bus('a', 'b'), bus('b', '/dev/ttyACM0', 'slcan')], ['a', 'b'],
     {'a': 'a', 'b': 'b', '/dev/ttyACM0': 'b'}),
    # of kvaser: the number of an adapter is no place
    ([bus('a', '0', 'kvaser'), bus('b', '1', 'kvaser')], ['a', 'b'],
     {1: 'a', 2: 'b', '1': 'b'}),
    ([bus('a', 'can0'), bus('b', 'can0')], ['a', 'b'], {'a': 'a', 'b': 'b', 'can0': 'a'}),
])
def test_which_bus_a_trace_means(buses: list[BusConfiguration], said: list[str],
                                 found: dict[str | int, str | None]) -> None:
    """What record calls a bus is that bus; otherwise names come first, then channels."""
    channels = Channels(buses)
    assert {word: each and each.name for word in found
            for each in [channels.find(word)]} == found
    assert list(labels(buses).values()) == said
    assert [Channels(buses).find(word) for word in said] == buses


MAIN = bus('main', 'can0')


@pytest.mark.parametrize(('trace', 'meant'), [
    (['can7'], ['can7']),
    ([''], ['']),
    (['', 'can7'], ['', 'can7']),
    (['can0', 'can7'], ['can0']),
    (['can7', 'can0'], ['can0']),
    (['can7', 'can8', 'main', ''], ['main', '']),
    ([5], [5]),
    ([0], [0]),
])
def test_one_bus_is_one_channel(trace: list[str | int], meant: list[str | int]) -> None:
    channels = Channels([MAIN])
    channels.look_ahead(trace)
    assert [each for each in trace if channels.find(each) is MAIN] == meant


#: what is said of two channels
WHICH = ('the trace has the channels can7, can8; which of them is bus main of the parameter '
         'file? Give --bus main=can7 or --bus main=can8')


def test_of_two_foreign_channels_none_is_taken() -> None:
    with pytest.raises(DriveCanError) as refused:
        Channels([MAIN]).look_ahead(['can7', '', 'can8', 'can7'])
    assert str(refused.value) == WHICH


def test_of_two_numbers_none_is_taken() -> None:
    with pytest.raises(DriveCanError, match='Give --bus main=1 or --bus main=2'):
        Channels([MAIN]).look_ahead([1, 2])


@pytest.mark.parametrize(('meant', 'found', 'told', 'missing'), [
    ({}, {1: 'main', 3: None, 'aux': 'aux'},
     ['channel 1: bus main', 'channel 3: no bus of the parameter file; if it is one, give '
      '--bus main=3 or --bus aux=3'], []),
    ({'main': '3'}, {3: 'main', 2: 'aux', 1: None, 'can0': None},
     ['channel 2: bus aux', 'channel 1: no bus of the parameter file; if it is one, give '
      '--bus aux=1'], []),
    ({'main': 'can1', 'aux': '7'}, {'can1': 'main', 7: 'aux', 1: None, 'aux': None}, [], []),
    ({'aux': 'x'}, {'can1': None}, [], ['aux=x']),
])
def test_what_the_user_says_of_channels(
        meant: dict[str, str], found: dict[str | int, str | None], told: list[str],
        missing: list[str]) -> None:
    lines: list[str] = []
    channels = Channels([MAIN, bus('aux', 'can1')], meant, lines.append)
    for _ in range(2):
        assert {word: each and each.name for word in found
                for each in [channels.find(word)]} == found
    assert lines == told
    assert channels.missing() == missing


@pytest.mark.parametrize(('meant', 'trace', 'told'), [
    ({}, ['can7'], ['channel can7: no bus of the parameter file; if it is one, give '
                    '--bus main=can7 or --bus aux=can7']),
    # whose channel comes later is not meant
    ({}, ['can7', 'can1', ''], ['channel can7: no bus of the parameter file; if it is one, give '
                                '--bus main=can7']),
    ({'main': 'can2'}, ['can7', 'can2'], [
        'channel can7: no bus of the parameter file; if it is one, give --bus aux=can7']),
    ({}, ['can0', 'can7', 'can1'], []),     # every bus is another one
    ({}, ['can0', 'can1'], []),
])
def test_a_name_that_is_left_over(
        meant: dict[str, str], trace: list[str], told: list[str]) -> None:
    channels = Channels([bus('main', 'can0'), bus('aux', 'can1')], meant)
    for each in trace:
        channels.find(each)
    assert channels.left_over() == told


def test_what_the_user_says_of_the_one_bus() -> None:
    channels = Channels([MAIN], {'main': '3'})
    channels.look_ahead([1, 2, 3])
    assert [channels.find(each) for each in (1, 2, 3, '', 'can0')] == [
        None, None, MAIN, None, None]


@pytest.mark.parametrize('second', ['can8', 'can0'])
def test_a_pipe_ends_at_the_second_channel(second: str) -> None:
    """Nobody knew of it when the first was taken; an entry without one makes no difference."""
    channels = Channels([MAIN])
    assert [channels.find(each) for each in ('can7', '', 'can7')] == [MAIN] * 3
    for _ in range(2):
        with pytest.raises(DriveCanError) as refused:
            channels.find(second)
        assert str(refused.value) == WHICH.replace('can8', second)


@given(st.sampled_from(['.log', '.asc', '.csv', '.trc', '.blf', '.db']), st.binary(max_size=300))
def test_any_file(tmp_path_factory: pytest.TempPathFactory, suffix: str, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / f'any_trace{suffix}'   # no folder for each example
    path.write_bytes(content)
    for record in read_records(path, lambda _: None):
        assert isinstance(record, Record)
