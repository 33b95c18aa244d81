# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Errors and states in other makers' traces: shown, or counted, not passed over in silence."""

from collections.abc import Callable
from pathlib import Path
from struct import pack
import zlib

import can
import pytest

from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.frame import Record, RecordKind
from drive_can_bridge.protocols.observer import Telegram
from drive_can_bridge.trace.files import read_records
from drive_can_bridge.trace.tracer import Tracer

DATA, REMOTE, FD, ERROR, DESTROYED, STATE = (RecordKind[name] for name in (
    'DATA', 'REMOTE', 'FD', 'ERROR', 'DESTROYED', 'STATE'))


def read(path: Path) -> tuple[list[Record], list[str]]:
    complaints: list[str] = []
    return list(read_records(path, complaints.append)), complaints


def lines_of(records: list[Record]) -> list[str]:
    """Return what `decode` tells of entries, as title and remark."""
    told: list[str] = []

    def take(_: str, telegram: Telegram) -> None:
        told.append(f'{telegram.title}: {telegram.verdict.name}: {telegram.remark}')
    tracer = Tracer(BridgeConfiguration(buses={}, drives={}), take)
    for record in records:
        tracer.take(record)
    return told


#: what the states of PEAK's library mean
HEAVY = 'BUSHEAVY (an error counter reached the upper limit: error-warning or error-passive)'
LIGHT = 'BUSLIGHT (an error counter reached the lower limit)'
#: 1989-01-01 12:00, which is 32509.5 in heads
EPOCH = 599_659_200.0


@pytest.mark.parametrize(('head', 'lines'), [
    ('', ('     1)      100  0705  1  05',
          '     2)      101  FFFFFFFF  4  00 00 00 08 -- -- -- --  BUSHEAVY',
          '     3)      102  0008  4  ERROR 00 19 07 09', '     4)      103  0705  1  RTR')),
    (';$FILEVERSION=1.1\n;$STARTTIME=32509.5\n',
     ('     1)      100.0  Rx         0705  1  05',
      '     2)      101.0  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY',
      '     3)      102.0  Error      0008  4  00 19 07 09',
      '     4)      103.0  Rx         0705  1  RTR')),
    # the ; at the end is PCAN-Explorer 5's
    (';$FILEVERSION=1.2\n;$STARTTIME=32509.5;\n',
     ('     1)      100.000  3  Rx         0705  1  05',
      '     2)      101.000  3  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY',
      '     3)      102.000  3  Error      0008  4  00 19 07 09',
      '     4)      103.000  3  Rx         0705  1  RTR')),
    (';$FILEVERSION=1.3\n;$STARTTIME=32509.5\n',
     ('     1)      100.000 3  Rx        0705 -  1    05',
      '     2)      101.000 3  Warng FFFFFFFF -  4    00 00 00 08  BUSHEAVY',
      '     3)      102.000 3  Error     0008 -  4    00 19 07 09',
      '     4)      103.000 3  Rx        0705 -  1    RTR')),
    (';$FILEVERSION=2.0\n;$STARTTIME=32509.5\n;$COLUMNS=N,O,T,I,d,l,D\n',
     ('      1       100.000 DT     0705 Rx 1  05',
      '      2       101.000 ST          Rx    00 00 00 08',
      '      3       102.000 ER          Rx    08 00 19 07 09',
      '      4       103.000 RR     0705 Rx 1')),
    (';$FILEVERSION=2.1\n;$STARTTIME=32509.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n',
     ('      1       100.000 DT 3      0705 Rx -  1    05',
      '      2       101.000 ST 3         - Rx -  4    00 00 00 08',
      '      3       102.000 ER 3         - Rx -  5    08 00 19 07 09',
      '      4       103.000 RR 3      0705 Rx -  1')),
    (';$FILEVERSION=3.0\n;$STARTTIME=32509.5\n;$COLUMNS=N,O,T,B,I,d,R,V,S,A,r,s,L,D\n',
     ('      1       100.000 DT 3       705 Rx - - - -          - - 1   05',
      '      2       101.000 ST 3         - Rx - - - -          - - 4   00 00 00 08',
      '      3       102.000 ER 3         - Rx - - - -          - - 5   08 00 19 07 09',
      '      4       103.000 RR 3       705 Rx - - - -          - - 1')),
], ids=['1.0', '1.1', '1.2', '1.3', '2.0', '2.1', '3.0'])
def test_errors_and_states_of_peak(head: str, lines: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / 'a.trc').write_text(f'{head};\n' + ''.join(f'{line}\n' for line in lines))
    records, complaints = read(tmp_path / 'a.trc')
    assert complaints == []
    start = EPOCH if 'STARTTIME' in head else 0.0
    assert [each.time - start for each in records] == pytest.approx([0.1, 0.101, 0.102, 0.103])
    assert [(each.kind, each.extended) for each in records] == [
        (DATA, False), (STATE, False), (ERROR, True), (REMOTE, False)]
    assert {each.channel for each in records} == {3 if ' 3 ' in lines[0] else 1}
    assert lines_of(records)[1:3] == [
        f'bus state: SUSPICIOUS: {HEAVY}',
        'error frame: SUSPICIOUS: no acknowledgement while sending, error counters transmit 9, '
        'receive 7']


@pytest.mark.parametrize(('line', 'told'), [
    ('ST 1         - Rx -  4    00 00 00 00', 'bus state: NORMAL: OK'),
    ('ST 1         - Rx -  4    00 00 00 04', f'bus state: SUSPICIOUS: {LIGHT}'),
    ('ST 1         - Rx -  4    00 00 00 10', 'bus state: SUSPICIOUS: BUSOFF (bus-off)'),
    ('ST 1         - Rx -  4    00 04 00 00', 'bus state: SUSPICIOUS: BUSPASSIVE (error-passive)'),
    ('ST 1         - Rx -  4    00 00 00 0A',
     f'bus state: SUSPICIOUS: OVERRUN (frames were lost), {HEAVY}'),
    ('ST 1         - Rx -  4    00 00 40 00', 'bus state: SUSPICIOUS: status 00004000h'),
    ('EC 1         - Rx -  2    02 03', 'bus state: NORMAL: error counters transmit 3, receive 2'),
    ('EC 1         - Rx -  2    00 80',
     'bus state: SUSPICIOUS: error counters transmit 128, receive 0'),
    ('ER 1         - Rx -  5    04 01 0A 02 00',
     'error frame: SUSPICIOUS: stuff error in the data, error counters transmit 0, receive 2'),
    ('ER 1         - Rx -  5    00 00 00 07 60',
     'bus state: SUSPICIOUS: error counters transmit 96, receive 7'),
])
def test_lines_of_peak(line: str, told: str, tmp_path: Path) -> None:
    (tmp_path / 'a.trc').write_text(
        f';$FILEVERSION=2.1\n;$STARTTIME=32509.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n'
        f'      1   1.0 {line}\n')
    records, complaints = read(tmp_path / 'a.trc')
    assert (lines_of(records), complaints) == ([told], [])


HEAD_2_1 = ';$FILEVERSION=2.1\n;$STARTTIME=32509.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n'


def peak(path: Path, head: str, *lines: str) -> tuple[list[Record], list[str]]:
    (path / 'a.trc').write_text(head + ''.join(f'{line}\n' for line in lines))
    return read(path / 'a.trc')


@pytest.mark.parametrize(('head', 'line', 'record'), [
    # a time without a start, and no direction
    ('', '1) 500 0705 1 05', Record(0.5, 1, 0x705, b'\5', False, DATA)),
    (';$FILEVERSION=1.0\n', '1) 500 00000705 0', Record(0.5, 1, 0x705, b'', True, DATA)),
    (';$FILEVERSION=1.1\n;$STARTTIME=32509.5\n', '1) 500.0 Tx 0705 8 RTR',
     Record(EPOCH + 0.5, 1, 0x705, b'', False, REMOTE, True)),
    # more than 8 are no more in a classical frame
    (HEAD_2_1, '1 500.000 DT 2 0705 Tx - 9 01 02 03 04 05 06 07 08',
     Record(EPOCH + 0.5, 2, 0x705, bytes(range(1, 9)), False, DATA, True)),
    # codes of lengths, and lengths
    *((HEAD_2_1, f'1 500.000 {kind} 1 18EFC034 Rx - 9 01 02 03 04 05 06 07 08 09 0A 0B 0C',
       Record(EPOCH + 0.5, 1, 0x18EFC034, bytes(range(1, 13)), True, FD, False))
      for kind in ('FD', 'FB', 'FE', 'BI')),
    (HEAD_2_1.replace('B,I,d,R,L', 'I,d,l'),
     '1 500.000 FD 0500 Tx 12 01 02 03 04 05 06 07 08 09 0A 0B 0C',
     Record(EPOCH + 0.5, 1, 0x500, bytes(range(1, 13)), False, FD, True)),
    # columns in an order of their own, some of them without a meaning here
    (HEAD_2_1.replace('N,O,T,B,I,d,R,L', 'O, N, I, L, T, x'), '500.000 1 0705 2 DT - 01 02',
     Record(EPOCH + 0.5, 1, 0x705, b'\1\2', False, DATA)),
])
def test_frames_of_peak(head: str, line: str, record: Record, tmp_path: Path) -> None:
    records, complaints = peak(tmp_path, head, line, '')
    assert (records, complaints) == ([record], [])


def test_a_state_of_peak_with_columns_in_another_order(tmp_path: Path) -> None:
    records, complaints = peak(tmp_path, ';$FILEVERSION=2.1\n;$COLUMNS=T,I,B,O,L,D\n',
                               'ST - 3 500.000 4 00 00 00 10', 'ER 0705 3 500.000 4 00 00',
                               'XL 100 3')
    assert (lines_of(records), complaints) == (
        ['bus state: SUSPICIOUS: BUSOFF (bus-off)'],
        ['line 5: no entry of a .trc trace', 'passed over: ER (1)'])
    assert [(each.time, each.channel) for each in records] == [(0.5, 3)]


@pytest.mark.parametrize(('line', 'told'), [
    ('1 5.0 DT 1 0705 Rx - 2 05', 'its length is 2, and there are 1 data bytes'),
    ('1 5.0 DT 1 0705 Rx - 1 05 06', 'its length is 1, and there are 2 data bytes'),
    ('1 5.0 FD 1 0705 Rx - 16 05', 'its length is 16, and there are 1 data bytes'),
    ('1 5.0 DT 1 0705 Rx - 1 5', 'no entry of a .trc trace'),
    ('1 5.0 DT 1 07_5 Rx - 1 05', 'no entry of a .trc trace'),
    ('1 5,0 DT 1 0705 Rx - 1 05', 'no entry of a .trc trace'),
    ('1 5.0 DT 1 0705 up - 1 05', 'no entry of a .trc trace'),
    ('1 5.0 DT 1 0905 Rx - 1 05', 'identifier 905h'),
    ('1 5.0 DT 1 2FFFFFFF Rx - 1 05', 'identifier 2FFFFFFFh'),
])
def test_a_damaged_frame_of_peak(line: str, told: str, tmp_path: Path) -> None:
    records, complaints = peak(tmp_path, HEAD_2_1, line, '2 6.0 DT 1 0705 Rx - 1 06')
    assert ([each.data for each in records], complaints) == ([b'\6'], [f'line 4: {told}'])


@pytest.mark.parametrize('columns', [
    '', ';$COLUMNS=N,O,T\n', ';$COLUMNS=N,O,I,d,L,D\n', ';$COLUMNS=N,O,T,I,I,L,D\n',
    ';$COLUMNS=N,O,T,I,d,l,L,D\n', ';$COLUMNS=N,O,T,t,I,L,D\n'])
def test_a_file_of_peak_that_does_not_say_its_columns(columns: str, tmp_path: Path) -> None:
    line = '1 5.0 DT 1 0705 Rx - 1 05'
    records, complaints = peak(tmp_path, f';$FILEVERSION=2.1\n{columns}', line, line, line)
    assert (records, complaints) == ([], [
        f'line {3 if columns else 2}: version 2.1, and no ;$COLUMNS= says where time, type, '
        'identifier and length are', 'passed over: lines without $COLUMNS (2)'])


def test_a_start_of_peak_that_is_none(tmp_path: Path) -> None:
    for start in ('today', 'nan', '1e300'):
        records, complaints = peak(tmp_path, f';$FILEVERSION=1.1\n;$STARTTIME={start}\n',
                                   '1) 500.0 Rx 0705 1 05')
        assert ([each.time for each in records], complaints) == (
            [0.5], [f"line 2: $STARTTIME is not a number of days: '{start}'"])


def test_messages_of_several_frames_are_counted(tmp_path: Path) -> None:
    """PCAN-Explorer's add-in for J1939 puts them together."""
    records, complaints = peak(
        tmp_path, ';$FILEVERSION=1.3\n;$STARTTIME=32509.5\n',
        '1) 5.000 1 Rx 18ECFF23 FF 9 D2 AF AA 88 18 80 01 02 03', '2) 6.000 1 Rx 0705 - 1 06')
    assert ([each.data for each in records], complaints) == (
        [b'\6'], ['passed over: messages of several frames (1)'])


def test_what_peak_has_beside_is_counted(tmp_path: Path) -> None:
    (tmp_path / 'a.trc').write_text(
        ';$FILEVERSION=2.1\n;$STARTTIME=32509.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n'
        '      1   1.0 EV 1  A door was opened\n      2   2.0 EV -  A door was closed\n'
        '      3   3.0 XL 1 100 Tx - 3 03 11 22 33\n      4   4.0 ST 1 - Rx - 4 00\n'
        '      5   5.0 DT 1      0705 Rx -  1    05\n')
    records, complaints = read(tmp_path / 'a.trc')
    assert [each.kind for each in records] == [DATA]
    assert complaints == ['passed over: EV (2), XL (1), ST (1)']


def test_states_of_vector(tmp_path: Path) -> None:
    (tmp_path / 'a.asc').write_text(
        'date Sat Sep 30 15:06:13.191 2017\nbase hex  timestamps absolute\n'
        'internal events logged\n'
        'Begin Triggerblock Sat Sep 30 15:06:13.191 2017\n   0.000000 Start of measurement\n'
        '   0.100000 CAN 1 Status:chip status error passive - TxErr: 132 RxErr: 0\n'
        '   0.100000 CAN 2 Status:chip status error active\n'
        '   0.200000 1  7F1             Rx   d 1 05\n'
        '   0.300000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\n'
        '   0.300000 2  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\n'
        '   0.400000 1  OverloadFrame\n   0.400000 1  ErrorFrame\n'
        '   0.450000 1  J1939TP FEE3p        6    0  0   -   Rx   d 3 23 A0 0F\n'
        '   0.500000 1  7F2             TxRq d 1 06\n   0.600000 CAN 1 Status:chip status busoff\n'
        '   0.700000 12 !?\n// a comment\nEnd TriggerBlock\n')
    records, complaints = read(tmp_path / 'a.asc')
    assert lines_of(records) == [
        'bus state: SUSPICIOUS: chip status error passive - TxErr: 132 RxErr: 0',
        'bus state: NORMAL: chip status error active', ': NORMAL: 7F1#05',
        'error frame: SUSPICIOUS: error without details',
        'bus state: SUSPICIOUS: chip status busoff']
    assert [(round(each.time, 3), each.channel) for each in records] == [
        (0.1, 1), (0.1, 2), (0.2, 1), (0.4, 1), (0.6, 1)]
    assert complaints == ['passed over: Statistic (2), OverloadFrame (1), J1939TP (1), TxRq (1), '
                          'lines of another kind (1)']


# -- .blf -----------------------------------------------------------------------------------------

#: 2020-02-29 12:00:00.5
BEGIN, BEGIN_WORDS = 1_582_977_600.5, (2020, 2, 6, 29, 12, 0, 0, 500)


def an_object(kind: int, content: bytes, *, ticks: int = 0, flags: int = 2,
              version: int = 1) -> bytes:
    header = (pack('<LHHQ', flags, 0, 0, ticks) if version != 2
              else pack('<LBxHQ8x', flags, 0, 0, ticks))
    size = 16 + len(header) + len(content)
    return (b'LOBJ' + pack('<HHLL', 16 + len(header), version, size, kind) + header + content
            + bytes(size % 4))


def container(content: bytes, *, packed: bool = True) -> bytes:
    body = pack('<H6xL4x', 2 if packed else 0, len(content)) + (
        zlib.compress(content) if packed else content)
    return b'LOBJ' + pack('<HHLL', 16, 1, 16 + len(body), 10) + body + bytes(len(body) % 4)


def blf(path: Path, *parts: bytes) -> Path:
    header = b'LOGG' + pack('<L32x8H16x72x', 144, *BEGIN_WORDS)
    assert len(header) == 144
    path.write_bytes(header + b''.join(parts))
    return path


MESSAGE = pack('<HBBL8s', 3, 0, 2, 0x5C6, b'\x0A\x0B')


def test_entries_of_a_logger(tmp_path: Path) -> None:
    path = blf(tmp_path / 'a.blf', container(b''.join((
        an_object(1, MESSAGE, ticks=1_000_000),
        an_object(86, pack('<HBBL8s', 1, 1, 0, 0x80000000 | 0x3FFFF0, b''), ticks=2_000_000,
                  version=2),
        an_object(1, pack('<HBBL8s', 1, 0x80, 8, 0x705, b''), ticks=300, flags=1),
        an_object(100, pack('<HBBLLBBB5x64s', 1, 1, 9, 0x123, 0, 0, 3, 12, bytes(range(12))),
                  ticks=4_000_000),
        an_object(100, pack('<HBBLLBBB5x64s', 1, 0, 1, 0x124, 0, 0, 0, 1, b'\5'), ticks=5_000_000),
        an_object(101, pack('<BBBBLLL16xHBBL', 2, 9, 12, 0, 0x125, 0, 0x1000, 0, 1, 0, 0)
                  + bytes(range(12)), ticks=6_000_000),
        an_object(101, pack('<BBBBLLL16xHBBL', 2, 2, 2, 0, 0x126, 0, 0x80, 0, 1, 0, 0)
                  + b'\1\2', ticks=7_000_000))), packed=False))
    records, complaints = read(path)
    assert complaints == ['passed over: requests to send (1)']
    assert [each._replace(time=round(each.time - BEGIN, 6)) for each in records] == [
        Record(0.001, 3, 0x5C6, b'\x0A\x0B', False, DATA, False),
        Record(0.002, 1, 0x3FFFF0, b'', True, DATA, True),
        Record(0.003, 1, 0x705, b'', False, REMOTE, False),
        Record(0.004, 1, 0x123, bytes(range(12)), False, FD, True),
        Record(0.005, 1, 0x124, b'\5', False, DATA, False),
        Record(0.006, 2, 0x125, bytes(range(12)), False, FD, True)]


def destroyed(flags: int, code: int, number: int, data: bytes) -> bytes:
    return an_object(73, pack('<HHLBBBxLLH2x8s', 2, 0, flags, code, 40, len(data), 0, number, 0,
                              data))


def test_errors_of_a_logger(tmp_path: Path) -> None:
    """Where flags and ECC are 0, python-can wrote an entry, with the classes of SocketCAN."""
    path = blf(tmp_path / 'a.blf', container(
        destroyed(1, 0xA2, 0x5C6, b'\x0B\x41')
        + destroyed(0, 0, 4, bytes.fromhex('0020000000000000'))
        + destroyed(0, 0x22, 0x80000000 | 0x3FFFF0, b'')
        + destroyed(0xE, 0, 0, b'')
        + an_object(2, pack('<HH', 1, 0)) + an_object(31, pack('<HBBL', 1, 136, 0, 0x0C))
        + an_object(104, pack('<HBBLLB3x16x', 1, 0, 97, 0x0D, 0, 0))
        + an_object(3, pack('<HH', 1, 0)) + an_object(4, bytes(20)) + an_object(115, b'')
        + an_object(115, b'') + an_object(1, MESSAGE, version=7)))
    records, complaints = read(path)
    assert lines_of(records) == [
        'error frame: SUSPICIOUS: error of the frame 5C6#0B41',
        'error frame: SUSPICIOUS: error-passive (sending)',
        'error frame: SUSPICIOUS: error of the frame 003FFFF0#',
        'error frame: SUSPICIOUS: error without details',
        'error frame: SUSPICIOUS: error without details',
        'bus state: SUSPICIOUS: error 0000000Ch of the driver, error counters transmit 136, '
        'receive 0',
        'bus state: SUSPICIOUS: error 0000000Dh of the driver, error counters transmit 0, '
        'receive 97']
    assert complaints == ['passed over: objects of type 115 (2), overload frames (1), '
                          'statistics (1), objects with a header of version 7 (1)']


def test_an_object_may_go_on_in_the_next_container(tmp_path: Path) -> None:
    content = b''.join(an_object(1, MESSAGE, ticks=1000 * number) for number in range(50))
    path = blf(tmp_path / 'a.blf', container(content[:777]), container(content[777:1001]),
               container(content[1001:]), an_object(1, MESSAGE))
    records, complaints = read(path)
    assert ([each.data for each in records], complaints) == (51 * [b'\x0A\x0B'], [])


def test_a_container_ends_where_its_packed_bytes_end(tmp_path: Path) -> None:
    """A time in the place of that size, and eight-byte filling, as vblf 0.3.1 writes them."""
    packed = zlib.compress(an_object(1, MESSAGE)).ljust(44, b'\0')
    part = b'LOBJ' + pack('<HHLLLLQ', 32, 1, 76, 10, 2, 0, 259_638) + packed + bytes(4)
    records, complaints = read(blf(tmp_path / 'a.blf', 3 * part))
    assert ([each.data for each in records], complaints) == (3 * [b'\x0A\x0B'], [])


@pytest.mark.parametrize(('damage', 'frames'), [
    (lambda data: data[:-20], range(1, 50)), (lambda data: data[:170], range(50)),
    (lambda data: data[:150], range(1)), (lambda data: data + b'LOBJ', range(50, 51)),
    (lambda data: data + b'no object of any kind', range(50, 51)),
    (lambda data: data[:190] + bytes(9) + data[199:], range(50)),
], ids=['last bytes', 'container', 'its head', 'a head', 'rubbish', 'packed bytes'])
def test_a_cut_file(damage: Callable[[bytes], bytes], frames: range, tmp_path: Path) -> None:
    content = b''.join(an_object(1, MESSAGE, ticks=number) for number in range(50))
    path = blf(tmp_path / 'a.blf', container(content))
    path.write_bytes(damage(path.read_bytes()))
    records, complaints = read(path)
    assert len(records) in frames
    assert complaints == ['the rest cannot be read: it is damaged, or cut']


def test_damage_in_a_container_costs_one_object(tmp_path: Path) -> None:
    whole = an_object(1, MESSAGE)
    path = blf(tmp_path / 'a.blf', container(3 * whole + bytes(len(whole)) + 3 * whole))
    records, complaints = read(path)
    assert (len(records), complaints) == (6, ['48 bytes are damaged'])


def test_an_empty_header_is_no_failure(tmp_path: Path) -> None:
    assert read(blf(tmp_path / 'a.blf')) == ([], [])
    (tmp_path / 'b.blf').write_bytes(b'LOGG')
    assert read(tmp_path / 'b.blf') == ([], ['the rest cannot be read: it is damaged, or cut'])


def test_what_python_can_writes_is_read_alike(tmp_path: Path) -> None:
    path = tmp_path / 'a.blf'
    writer = can.BLFWriter(path)
    for number in range(3000):
        writer.on_message_received(can.Message(
            timestamp=1_700_000_000.0 + 0.001 * number, arbitration_id=number % 0x800,
            is_extended_id=bool(number % 2), is_fd=not number % 5, is_remote_frame=number % 5 == 1,
            is_rx=bool(number % 3), data=b'' if number % 5 == 1 else bytes(number % 9),
            channel=number % 4))
    writer.stop()
    records, complaints = read(path)
    assert complaints == []
    assert [(round(each.time, 5), each.channel, each.identifier, each.data, each.extended,
             each.sent, each.kind) for each in records] == [
        (round(each.timestamp, 5), each.channel + 1, each.arbitration_id, bytes(each.data),
         each.is_extended_id, not each.is_rx,
         FD if each.is_fd else REMOTE if each.is_remote_frame else DATA)
        for each in can.BLFReader(path)]
