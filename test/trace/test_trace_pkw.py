# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Watching devices with a PKW mailbox. Frames are those of the protocol notes, node 5."""

from builders import drive, INT16, parameter, RO
from hypothesis import given, strategies as st
from trace_builders import Witness

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.core.record import Record

STATUS = parameter('system_status', 455, access=RO, bits=(('ready', 0), ('on', 1)))
CURRENT = parameter('average_current', 500, type=ParameterType.UINT32, scale=0.01, unit='A',
                    access=RO)
COMMAND = parameter('command', 704)
TEMPERATURE = parameter('temperature', 472, type=INT16, access=RO)


def starter(**options: object) -> DriveConfiguration:
    options.setdefault('response', (STATUS, CURRENT))
    return drive('canopen_pkw', name='pump', station=5, parameter_timeout=0.5,
                 table=(STATUS, CURRENT, COMMAND, TEMPERATURE), request=(), **options)


def with_status(name: str, number: int) -> Witness:
    """Return what watches a device whose rounds read its status and one parameter more."""
    table = (STATUS, parameter(name, number))
    return Witness(drive('canopen_pkw', name='pump', station=5, table=table, request=(),
                         response=table))


def test_a_round() -> None:
    witness = Witness(starter())
    assert witness.hears('505#C701002500000000', 0.0) == [
        '0.000000 +0.000 main pump > read: system_status']
    assert witness.hears('485#C701002583200000', 0.004) == [
        '0.004000 +0.000 main pump < read: system_status 2083h (ready, on) [4.0 ms]']
    witness.hears('505#F40100A600000000', 0.005)
    assert witness.hears('485#F40100A600008403', 0.009)[0].endswith(
        'main pump < read: average_current 9.00 A [4.0 ms]')
    observed = witness.observed('pump')
    assert (observed.exchanges, observed.missed, observed.requests) == (1, 0, 0)
    assert round(observed.latency.mean, 6) == 0.009


def test_requests_of_users() -> None:
    witness = Witness(starter())
    assert witness.hears('505#C00200AA01000000', 0.0)[0].endswith('> write: command 1')
    assert witness.hears('485#C00200AA00000000', 0.01)[0].endswith('< write: command [10.0 ms]')
    witness.hears('505#C701002A34120000', 0.1)
    assert witness.hears('485#C701004E02000106', 0.11)[0].endswith(
        '< write: system_status: REFUSED: 06010002h (write to a read-only object) [10.0 ms]')
    witness.hears('505#0F2700A500000000', 0.2)
    assert witness.hears('485#0F2700CE00000206', 0.21)[0].endswith(
        '< read: p9999: REFUSED: 06020000h (no such register or object) [10.0 ms]')
    witness.hears('505#0420063500000000', 0.3)
    assert witness.hears('485#0420063583200000', 0.31)[0].endswith(
        '< read: x2004.06 8323 [10.0 ms]')
    observed = witness.observed('pump')
    assert (observed.requests, observed.refused) == (4, 2)


def test_a_refusal_is_about_the_newest_request_that_it_fits() -> None:
    """It names the register and the toggle, not the function."""
    witness = Witness(starter())
    for time, request, answer in ((0.0, '505#C701002500000000', '485#C701002583200000'),
                                  (0.1, '505#C70100AA01000000', '485#C70100CE02000106'),
                                  (0.2, '505#C701002A01000000', '485#C701004E02000106')):
        witness.hears(request, time)
        witness.hears(answer, time + 0.01)
    witness.hears('505#C70100A500000000', 0.3)
    witness.hears('485#C70100A583200000', 0.31)
    witness.hears('505#C701002500000000', 0.4)
    assert '< read: system_status: REFUSED' in witness.hears('485#C701004E00000206', 0.41)[0]


def test_what_starts_nothing_is_named() -> None:
    witness = Witness(starter())
    witness.hears('505#C701002500000000', 0.0)
    witness.hears('485#C701002583200000', 0.004)
    assert witness.hears('505#C801002500000000', 0.1)[0].endswith(
        'p456: SUSPICIOUS: the function byte is that of the request before: nothing is started')
    assert witness.waits(10.0) == []
    # a device that took it all the same
    assert '< read: p456: REFUSED' in witness.hears('485#C801004E00000206', 10.1)[0]


def test_silence() -> None:
    witness = Witness(starter())
    witness.hears('505#C701002500000000', 0.0)
    assert witness.waits(1.0) == [
        '0.500000 +0.000 main pump < read: system_status: LOST: no answer']
    observed = witness.observed('pump')
    assert (observed.missed, observed.unanswered) == (1, 0)     # of a round, not of a user
    assert witness.hears('485#C701002583200000', 1.0)[0].endswith('LATE [1000.0 ms]')


def test_a_shared_read_that_is_refused_is_split_from_then_on() -> None:
    witness = with_status('second', 456)
    witness.hears('505#C701002600000000', 0.0)
    witness.hears('485#C701004E00000206', 0.004)
    witness.hears('505#C70100A500000000', 0.005)
    witness.hears('485#C70100A500000000', 0.009)
    witness.hears('505#C801002500000000', 0.01)
    witness.hears('485#C801002500000000', 0.014)
    assert witness.observed('pump').exchanges == 1
    assert witness.observed('pump').missed == 0


def test_a_shared_read_that_is_answered_completes_a_round() -> None:
    witness = with_status('second', 456)
    witness.hears('505#C701002600000000', 0.0)
    witness.hears('485#C701002683200000', 0.004)
    assert witness.observed('pump').exchanges == 1


def test_a_refusal_spoils_the_round_however_it_goes_on() -> None:
    witness = with_status('other', 500)
    witness.hears('505#C701002500000000', 0.0)
    witness.hears('485#C701004E00000206', 0.004)
    witness.hears('505#F40100A500000000', 0.005)
    witness.hears('485#F40100A500000000', 0.009)
    assert (witness.observed('pump').exchanges, witness.observed('pump').missed) == (0, 0)


def test_a_write_without_an_answer_is_no_missed_round() -> None:
    witness = Witness(starter())
    witness.hears('505#C701002500000000', 0.0)
    witness.hears('505#C70100AA01000000', 0.1)
    assert len(witness.waits(0.59)) == 1
    assert witness.observed('pump').missed == 1
    witness.hears('505#C701002500000000', 0.595)
    assert [line[-9:] for line in witness.waits(0.61)] == ['no answer']
    assert witness.observed('pump').missed == 1, 'of the read alone'


def test_the_node() -> None:
    witness = Witness(starter())
    assert witness.hears('000#0105', 0.0) == ['0.000000 +0.000 main pump > NMT: start node 5']
    assert witness.hears('000#8200', 0.0) == [
        '0.000000 +0.000 main > NMT: reset communication all nodes']
    assert witness.hears('705#00', 1.0)[0].endswith(
        'pump < boot-up: SUSPICIOUS: the device has started')
    assert witness.hears('705#05', 2.0)[0].endswith('pump < heartbeat: operational')
    assert 'SUSPICIOUS: 8130h (life guard' in witness.hears('085#3081110000000000', 3.0)[0]
    assert witness.hears('085#0000000000000000', 4.0)[0].endswith('emergency: no error')
    assert 'MALFORMED' in witness.hears('705#0505', 5.0)[0]


def test_another_layout() -> None:
    witness = Witness(starter(layout='word_be'))
    assert witness.hears('505#01C7250000000000', 0.0)[0].endswith('> read: system_status')
    assert witness.hears('485#01C7250020830000', 0.0)[0].endswith('2083h (ready, on) [0.0 ms]')


@given(st.lists(st.tuples(st.sampled_from([0x505, 0x485, 0x705, 0x085, 0x000]),
                          st.binary(max_size=8), st.floats(0, 10))))
def test_anything(frames: list[tuple[int, bytes, float]]) -> None:
    witness = Witness(starter())
    for identifier, data, time in frames:
        witness.tracer.take(Record(time, 'can0', identifier, data, False))
    witness.waits(100.0)
