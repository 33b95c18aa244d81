# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Bus logging in .mf4 files, as loggers and python-can write it.

asammdf is played by what it hands out: groups, and arrays with a column for each member. Where it
is installed, real files are written and read, too.
"""

from collections import Counter
from datetime import datetime, timezone
from pathlib import Path
import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.frame import DATA, Record, RecordKind
from drive_can_bridge.trace.files import read_records
from drive_can_bridge.trace.measured import read_measured

numpy = pytest.importorskip('numpy')

BEGIN = datetime(2024, 3, 4, 10, tzinfo=timezone.utc)
AT = BEGIN.timestamp()
CUT = 'the rest cannot be read: it is damaged, or cut'
FRAME = ('BusChannel', 'u1'), ('ID', '<u4'), ('IDE', 'u1'), ('DLC', 'u1'), ('DataLength', 'u1')
BYTES = ('DataBytes', '(8,)u1')
PYTHON_CAN = (*FRAME, ('DataBytes', '(64,)u1'), *((name, 'u1') for name in (
    'Dir', 'EDL', 'BRS', 'ESI')))


class Played:
    """What asammdf makes of a file with these groups: kind, columns, entries with their times."""

    def __init__(self, *groups: tuple[str, tuple[Any, ...], dict[float, tuple[Any, ...]]],
                 bus_type: int = 2, fails_at: int | None = None) -> None:
        self.header = SimpleNamespace(start_time=BEGIN)
        self.closed = False
        self._fails_at = fails_at
        self._contents = groups
        self.groups = [SimpleNamespace(
            channel_group=SimpleNamespace(
                flags=6, cycles_nr=len(entries),
                acq_source=SimpleNamespace(source_type=2, bus_type=bus_type)),
            channels=[SimpleNamespace(name=name) for name in (
                'Timestamp', kind, *(f'{kind}.{column[0]}' for column in columns))])
            for kind, columns, entries in groups]

    def get(self, kind: str, number: int, *, record_offset: int, record_count: int,
            raw: bool) -> Any:
        """Return some entries."""
        assert not raw
        if self._fails_at is not None and record_offset + record_count > self._fails_at:
            raise ValueError('not enough data')
        _, columns, entries = self._contents[number]
        some = dict(list(entries.items())[record_offset:record_offset + record_count])
        return SimpleNamespace(
            samples=numpy.array(list(some.values()), numpy.dtype(
                [(f'{kind}.{name}', what) for name, what in columns])),
            timestamps=numpy.array(list(some)))

    def close(self) -> None:
        """Close it."""
        self.closed = True


def read(monkeypatch: pytest.MonkeyPatch, played: Played,
         ) -> tuple[list[Record], list[str], Counter[str]]:
    """Return entries, complaints and what is counted."""
    module = ModuleType('asammdf')
    module.MDF = lambda path: played    # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, 'asammdf', module)
    complaints: list[str] = []
    passed: Counter[str] = Counter()
    records = list(read_measured(Path('a.mf4'), complaints.append, passed))
    assert played.closed
    return records, complaints, passed


def test_frames_of_a_logger_in_the_order_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each kind is a group of its own; channels count from 1 and stay as they are."""
    data = numpy.arange(8)
    records, complaints, passed = read(monkeypatch, Played(
        ('CAN_DataFrame', (*FRAME, BYTES, ('Dir', 'S2')), {
            0.25: (1, 0x701, 0, 1, 1, data, b'Rx'), 0.75: (2, 0x3FFFF0, 1, 8, 8, data, b'Tx')}),
        ('CAN_RemoteFrame', (*FRAME, ('Dir', 'u1')), {0.5: (1, 0x705, 0, 2, 0, 1)})))
    assert records == [
        Record(AT + 0.25, 1, 0x701, b'\0', False, DATA, False),
        Record(AT + 0.5, 1, 0x705, b'', False, RecordKind.REMOTE, True),
        Record(AT + 0.75, 2, 0x3FFFF0, bytes(range(8)), True, DATA, True)]
    assert (complaints, passed) == ([], {})


@pytest.mark.parametrize(('type_', 'classes', 'details'), [
    (0, 0, ''), (1, 0x88, '0000010000000000'), (2, 0x88, '0000020000000000'),
    (3, 0x88, '0000040000000000'), (4, 0x88, '0000000800000000'), (5, 0xA0, '0000000000000000'),
    (77, 0, '')])
def test_errors_of_a_logger_have_a_type(type_: int, classes: int, details: str,
                                        monkeypatch: pytest.MonkeyPatch) -> None:
    records, _, _ = read(monkeypatch, Played(
        ('CAN_ErrorFrame', (('BusChannel', 'u1'), ('ErrorType', 'u1')), {0.5: (2, type_)})))
    assert records == [Record(AT + 0.5, 2, classes, bytes.fromhex(details), False,
                              RecordKind.ERROR)]


def test_a_destroyed_frame_is_no_class_of_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    """python-can takes its identifier for one; 040h would be a bus-off that never was."""
    records, _, _ = read(monkeypatch, Played(
        ('CAN_ErrorFrame', (*FRAME, BYTES, ('ErrorType', 'u1')), {
            0.5: (1, 0x040, 0, 1, 1, numpy.full(8, 5), 3)})))
    assert records == [Record(AT + 0.5, 1, 0x40, b'\5', False, RecordKind.DESTROYED)]


def test_errors_of_python_can_are_classes(monkeypatch: pytest.MonkeyPatch) -> None:
    records, _, _ = read(monkeypatch, Played(
        ('CAN_ErrorFrame', PYTHON_CAN, {
            0.5: (0, 0x040, 1, 8, 8, numpy.zeros(64), 0, 0, 0, 0)})))
    assert records == [Record(AT + 0.5, 0, 0x40, bytes(8), True, RecordKind.ERROR,
                              False)]


def test_bytes_that_are_one_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """A logger's errors have been seen so; python-can's reader ends there."""
    records, complaints, _ = read(monkeypatch, Played(
        ('CAN_ErrorFrame', (*FRAME, ('DataBytes', '<u4'), ('ErrorType', 'u1')), {
            0.5: (1, 0x123, 0, 4, 4, 0x01000000, 1)}),
        ('CAN_DataFrame', (*FRAME, BYTES), {0.75: (1, 0x701, 0, 1, 1, numpy.zeros(8))})))
    assert [(each.kind, each.data) for each in records] == [
        (RecordKind.DESTROYED, b'\0\0\0\1'), (DATA, b'\0')]
    assert complaints == []


def test_fd_and_what_has_no_mark(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without IDE an identifier is one of 29 bits by its mark, or its size."""
    records, _, _ = read(monkeypatch, Played(
        ('CAN_DataFrame', (('ID', '<u4'), ('DataLength', 'u1'), ('DataBytes', '(64,)u1'),
                           ('EDL', 'u1')), {
            0.25: (0x123, 12, numpy.zeros(64), 1), 0.5: (0x123, 1, numpy.zeros(64), 0),
            0.75: (0x80000123, 1, numpy.zeros(64), 0), 0.8: (0x800, 1, numpy.zeros(64), 0)})))
    assert [(each.channel, each.identifier, each.extended, each.kind, each.sent)
            for each in records] == [
        ('', 0x123, False, RecordKind.FD, None), ('', 0x123, False, DATA, None),
        ('', 0x123, True, DATA, None), ('', 0x800, True, DATA, None)]


def test_other_buses_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    records, complaints, passed = read(monkeypatch, Played(
        ('LIN_Frame', (('ID', 'u1'),), {0.5: (1,), 0.75: (2,)}), bus_type=3))
    assert (records, complaints, passed) == ([], [], {'LIN_Frame': 2})
    records, complaints, passed = read(monkeypatch, Played(
        ('CAN_OverloadFrame', (('BusChannel', 'u1'),), {0.5: (1,)})))
    assert (records, passed) == ([], {'CAN_OverloadFrame': 1})


def test_a_damaged_group_is_said_and_the_others_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    many = {0.001 * number: (1, number % 0x700, 0, 1, 1, numpy.zeros(8))
            for number in range(5000)}
    records, complaints, _ = read(monkeypatch, Played(
        ('CAN_DataFrame', (*FRAME, BYTES), many), fails_at=5000))
    assert (len(records), complaints) == (4096, [CUT])
    records, complaints, _ = read(monkeypatch, Played(('CAN_DataFrame', (*FRAME, BYTES), many)))
    assert (len(records), complaints) == (5000, [])


def test_without_the_library_a_sentence_says_what_brings_it(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Also of a file that a logger has left unfinished, as loggers do."""
    monkeypatch.setitem(sys.modules, 'asammdf', None)
    for begin in (b'MDF     4.10    ', b'UnFinMF 4.11    '):
        (tmp_path / 'a.mf4').write_bytes(begin)
        with pytest.raises(DriveCanError, match='needs the Python module asammdf'):
            list(read_records(tmp_path / 'a.mf4', lambda _: None))


def test_real_files_of_python_can(tmp_path: Path) -> None:
    pytest.importorskip('asammdf')
    import can
    path = tmp_path / 'a.mf4'
    writer = can.MF4Writer(path)
    for number, options in enumerate((
            {}, {'is_remote_frame': True, 'dlc': 0}, {'is_error_frame': True, 'is_rx': False},
            {'is_fd': True})):
        writer.on_message_received(can.Message(
            timestamp=writer._start_time + number, arbitration_id=0x123, is_extended_id=False,
            channel=1, **{'data': b'' if 'dlc' in options else b'\1\2', **options}))
    writer.stop()
    complaints: list[str] = []
    records = list(read_records(path, complaints.append))
    assert [(each.kind, each.identifier, each.data, each.channel, each.sent)
            for each in records] == [
        (DATA, 0x123, b'\1\2', 1, False), (RecordKind.REMOTE, 0x123, b'', 1, False),
        (RecordKind.ERROR, 0x123, b'\1\2', 1, True), (RecordKind.FD, 0x123, b'\1\2', 1, False)]
    assert complaints == []
    # cut anywhere: said, never an exception
    whole = path.read_bytes()
    for end in range(16, len(whole), len(whole) // 40):
        path.write_bytes(whole[:end])
        complaints.clear()
        found = list(read_records(path, complaints.append))
        assert complaints or found == records, end
