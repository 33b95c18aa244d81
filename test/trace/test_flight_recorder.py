# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The ring that keeps the last seconds, and the recorder that writes them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import tracemalloc

from builders import frame
import pytest
from waiting import clock, pause, wait_for
from world import World

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.frame import Record, RecordKind
from drive_can_bridge.trace import flight
from drive_can_bridge.trace.files import read_records
from drive_can_bridge.trace.flight import BLOCK, FlightRecorder, Ring

REQUEST, ANSWER = frame('003FFFF0#05DC000000000000'), frame('7F1#2211')


def test_a_ring_gives_back_what_it_was_given() -> None:
    kept = Ring(10.0)
    kept.note(REQUEST, 100.0, True)
    kept.note(ANSWER, 100.001, False)
    kept.note_error(4, bytes.fromhex('0020000000000000'), 100.0005)
    kept.note_error(0x40, b'', 100.002)
    assert list(kept.entries(0.0, 'can0', 1000.0)) == [
        Record(1100.0, 'can0', 0x3FFFF0, REQUEST.data, True, RecordKind.DATA, True),
        Record(1100.0005, 'can0', 4, bytes.fromhex('0020000000000000'), True, RecordKind.ERROR),
        Record(1100.001, 'can0', 0x7F1, b'\x22\x11', False, RecordKind.DATA, False),
        Record(1100.002, 'can0', 0x40, b'', True, RecordKind.ERROR),
    ]
    assert [record.time for record in kept.entries(100.0008, '', 0.0)] == [100.001, 100.002]


def test_a_ring_forgets_what_is_too_old() -> None:
    kept = Ring(2.0)
    for step in range(20 * BLOCK):
        kept.note(REQUEST, 0.001 * step, True)
    times = [record.time for record in kept.entries(0.0, '', 0.0)]
    last = 0.001 * (20 * BLOCK - 1)
    assert times[-1] == last
    assert last - 2.0 - 0.002 * BLOCK <= times[0] <= last - 2.0
    assert len(times) == round((last - times[0]) / 0.001) + 1


def test_a_ring_has_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flight, '_BLOCKS_MAX', 3)
    kept = Ring(1e9)
    for step in range(10 * BLOCK):
        kept.note(REQUEST, float(step), True)
    assert len(list(kept.entries(0.0, '', 0.0))) <= 3 * BLOCK


def test_what_is_read_stays_while_frames_come() -> None:
    kept = Ring(1.0)
    for step in range(100):
        kept.note(REQUEST, 0.001 * step, True)
    reading = kept.entries(0.0, '', 0.0)
    for step in range(100, 10 * BLOCK):
        kept.note(ANSWER, 0.001 * step, False)
    assert [record.identifier for record in reading] == [0x3FFFF0] * 100


def test_a_frame_leaves_nothing_behind() -> None:
    kept = Ring(60.0)
    kept.note(REQUEST, 0.0, True)
    ours = [tracemalloc.Filter(True, str(path)) for path in (flight.__file__, __file__)]
    tracemalloc.start()
    try:
        for step in range(BLOCK - 10):
            kept.note(REQUEST, float(step), True)
        # other threads of this process go on meanwhile
        left = tracemalloc.take_snapshot().filter_traces(ours).statistics('filename')
        assert sum(each.size for each in left) < 1000
    finally:
        tracemalloc.stop()


#: what is said of traces
TOLD = {
    'trace': 'bus main: trace of conveyor offline, 2 frames of the last 10 s: {}',
    'end': 'bus main: the recording has ended',
    'silence': 'bus main: not a single frame in the last 10 s',
    'no place': 'bus main: no trace of asked: Not a directory: ',
    'defect': 'bus main: no trace of asked: ValueError broken: ',
}


class Recording:
    """A recorder of one bus, what it says, and its traces."""

    def __init__(self, folder: Path, **keys: object) -> None:
        self.folder = folder
        self.said: list[str] = []
        self.complained: list[str] = []
        bus = BusConfiguration('main', 'virtual', 'x', **{  # type: ignore[arg-type]
            'trace_seconds': 10.0, **keys})
        self.recorder = FlightRecorder([bus], folder, self.said.append, self.complained.append,
                                       clock())
        kept = self.recorder.ring('main')
        assert kept is not None
        self.ring: Ring = kept

    def hear(self, text: str = '003FFFF0#05DC000000000000') -> None:
        self.ring.note(frame(text), clock().now(), True)

    @property
    def traces(self) -> list[Path]:
        return sorted(self.folder.glob('*.log'))

    def save(self) -> tuple[str, str]:
        answers: list[tuple[str, str]] = []
        self.recorder.save('main', 'asked', lambda *answer: answers.append(answer))
        wait_for(lambda: answers, 'an answer')
        return answers[0]


@contextmanager
def recording(folder: Path, **keys: object) -> Iterator[Recording]:
    made = Recording(folder, **keys)
    try:
        yield made
    finally:
        made.recorder.close()


def test_a_trace_has_what_came_before_and_after(bench: World, tmp_path: Path) -> None:
    with recording(tmp_path / 'traces') as made:
        made.ring.note(frame('111#'), clock().now() - 60.0, True)    # too long ago
        made.hear('222#01')
        made.recorder.trigger('main', 'conveyor offline')
        made.hear('333#02')
        wait_for(lambda: made.said, 'a trace')
        path, = made.traces
        assert path.name.startswith('main_20') and path.name.endswith('Z_conveyor_offline.log')
        records = list(read_records(path, pytest.fail))
        assert [record.identifier for record in records] == [0x222, 0x333]
        assert all(0.0 < 1e-9 * clock().stamp() - record.time < 2.0 for record in records)
        assert made.said == [TOLD['trace'].format(path)]


def test_one_trace_in_ten_seconds_but_for_those_that_are_asked_for(
        bench: World, tmp_path: Path) -> None:
    with recording(tmp_path) as made:
        made.hear()
        made.recorder.trigger('main', 'lift fault')
        wait_for(lambda: made.said, 'a trace')
        made.recorder.trigger('main', 'again')
        saved = [made.save() for _ in range(2)]
        assert saved == [(str(path), '') for path in made.traces[1:]]
        assert [path.name.partition('Z_')[2] for path in made.traces] == [
            'lift_fault.log', 'asked.log', 'asked.log']


def test_a_failure_does_not_take_over_within_ten_seconds_of_another(
        bench: World, tmp_path: Path) -> None:
    with recording(tmp_path) as made:
        made.hear()
        made.recorder.trigger('main', 'lift fault')
        wait_for(lambda: made.said, 'a trace')
        answers: list[str] = []
        made.recorder.save('main', 'asked', lambda path, _: answers.append(path))
        made.recorder.trigger('main', 'again', rank=3)
        wait_for(lambda: answers, 'an answer')
        assert answers[0].endswith('_asked.log')


def test_a_failure_has_its_trace_whoever_has_asked_for_one(
        bench: World, tmp_path: Path) -> None:
    with recording(tmp_path, trace_seconds=0.5) as made:
        asked = clock().now()
        made.hear('111#')
        assert made.save()[0]
        made.hear('222#')
        made.recorder.trigger('main', 'lift fault')
        path, _ = made.save()       # the same one
        assert clock().now() < asked + flight.SPACING
        assert path.endswith('_lift_fault.log') and made.traces[1:] == [Path(path)]
        assert [record.identifier for record in read_records(made.traces[1], pytest.fail)] == [
            0x222], 'what came before the failure'


def test_a_failure_takes_over_a_trace_that_is_asked_for(bench: World, tmp_path: Path) -> None:
    answers: list[tuple[str, str]] = []
    with recording(tmp_path, trace_seconds=0.5) as made:
        made.hear('111#')
        made.recorder.save('main', 'asked', lambda *answer: answers.append(answer))
        pause(0.6 * flight.AFTERMATH)
        made.recorder.trigger('main', 'lift fault')
        failed = clock().now()
        while not answers:
            made.hear('222#')
            pause(0.01)
        (path, _), = answers
        assert path.endswith('_lift_fault.log')
        records = list(read_records(Path(path), pytest.fail))
        wall = 1e-9 * clock().stamp() - clock().now()
        # what the caller wanted is in it, and the second that follows the failure
        assert records[0].identifier == 0x111
        assert records[-1].time - wall > failed + 0.9 * flight.AFTERMATH
        assert len(made.traces) == 1


def test_a_failure_does_not_wait_for_a_trace_that_somebody_asked_for(
        bench: World, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(flight, '_STEP', 1)
    monkeypatch.setattr(flight, '_PAUSE', 0.01)
    buses = [BusConfiguration(name, 'virtual', name, trace_seconds=10.0)
             for name in ('main', 'other')]
    told: list[str] = []
    recorder = FlightRecorder(buses, tmp_path, told.append, told.append, bench.clock)
    try:
        for name, count in (('main', 200), ('other', 2)):
            kept = recorder.ring(name)
            assert kept is not None
            for _ in range(count):
                kept.note(REQUEST, clock().now(), True)
        recorder.save('main', 'asked', lambda *_: None)
        wait_for(lambda: list(tmp_path.glob('*.part')), 'the beginning of a trace')
        recorder.trigger('other', 'lift fault')
        wait_for(lambda: len(told) == 2, 'two traces')
    finally:
        recorder.close()
    assert [text.split(':')[0] for text in told] == ['bus other', 'bus main']
    assert [text.split(',')[0].rpartition(' of ')[2] for text in told] == ['lift fault', 'asked']


def test_the_gravest_reason_names_the_trace(bench: World, tmp_path: Path) -> None:
    with recording(tmp_path) as made:
        made.hear()
        made.recorder.trigger('main', 'lift offline', rank=1)
        made.recorder.trigger('main', 'bus lost', rank=2)
        made.recorder.trigger('main', 'pump offline', rank=1)
        wait_for(lambda: made.said, 'a trace')
        assert made.traces[0].name.endswith('_bus_lost.log')


def test_nothing_heard_nothing_written(bench: World, tmp_path: Path) -> None:
    with recording(tmp_path) as made:
        assert made.save() == ('', TOLD['silence'])
        assert not list(tmp_path.iterdir())
        made.hear()
        assert made.save()[0]


def test_who_asks_for_a_trace_at_the_end_is_answered(bench: World, tmp_path: Path) -> None:
    with recording(tmp_path) as made:
        made.hear()
    assert made.save() == ('', TOLD['end'])
    assert not made.traces


def test_first_and_newest_are_kept(bench: World, monkeypatch: pytest.MonkeyPatch,
                                   tmp_path: Path) -> None:
    numbers = iter(range(100))
    monkeypatch.setattr(flight.time, 'strftime',
                        lambda *_: f'20260101T0000{next(numbers):02d}Z')
    (tmp_path / 'main_20250101T000000Z_of_another_run.log').write_text('')
    (tmp_path / 'main_2_20250101T000000Z_of_another_bus.log').write_text('')
    with recording(tmp_path, trace_files=8) as made:
        for _ in range(12):
            made.hear()
            made.save()
        found = [path.name[20:24] if path.name.startswith('main_2026') else path.name
                 for path in made.traces]
        kept = [int(path.name.split('T0000')[1][:2]) for path in made.traces
                if path.name.startswith('main_2026')]
        assert kept == [0, 1, 2, 3, 4, 9, 10, 11], found
        assert (tmp_path / 'main_2_20250101T000000Z_of_another_bus.log').exists()
        assert len(made.traces) == 9


def test_the_end_of_the_bridge_writes_what_is_wanted(bench: World, tmp_path: Path) -> None:
    with recording(tmp_path) as made:
        made.hear()
        made.recorder.trigger('main', 'fatal')
        begun = clock().now()
        made.recorder.close()
        assert clock().now() - begun < flight.AFTERMATH
        assert len(made.traces) == 1


def test_a_place_that_cannot_be_written(bench: World, tmp_path: Path) -> None:
    blocked = tmp_path / 'file'
    blocked.write_text('')
    with recording(tmp_path, trace_directory=str(blocked / 'below')) as made:
        made.hear()
        path, refusal = made.save()
        assert not path and refusal in made.complained
        assert refusal.startswith(TOLD['no place'])


def test_whatever_fails_who_asks_is_answered(
        bench: World, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def broken(record: Record) -> str:
        raise ValueError('broken')

    with recording(tmp_path) as made:
        made.hear()
        with monkeypatch.context() as defect:
            defect.setattr(flight, 'format_record', broken)
            path, refusal = made.save()
        assert not path and made.complained == [refusal]
        assert refusal.startswith(TOLD['defect'])
        assert not list(tmp_path.iterdir())
        made.hear()
        path, refusal = made.save()     # by the same thread
        assert made.traces == [Path(path)] and not refusal


def test_buses_that_are_not_recorded(bench: World, tmp_path: Path) -> None:
    with recording(tmp_path) as made:
        made.recorder.trigger('other', 'whatever')
        assert made.recorder.ring('other') is None
