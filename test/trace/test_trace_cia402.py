# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Watching drives of CiA 402: PDOs and SYNC, SDO in the frames of the golden vectors, node 4."""

from builders import drive, INT32, parameter, RO
from hypothesis import given, strategies as st
from trace_builders import Witness

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.core.record import Record

TARGET = parameter('target_velocity', None, index=0x60FF, subindex=0, type=INT32, unit='rpm')
ACTUAL = parameter('actual_velocity', None, index=0x606C, subindex=0, type=INT32, access=RO,
                   unit='rpm')
POSITION = parameter('position', None, index=0x6064, subindex=0, type=INT32, access=RO)
CODE = parameter('fault_code', None, index=0x603F, subindex=0, type=ParameterType.UINT16,
                 access=RO)


def axis(**options: object) -> DriveConfiguration:
    keys = {'response': (ACTUAL,), 'period': 0.01, 'mode': 'csv', **options}
    return drive('cia402', name='axis', station=4, parameter_timeout=0.1,
                 table=(TARGET, ACTUAL, POSITION, CODE), request=(TARGET,), **keys)


def test_an_exchange() -> None:
    witness = Witness(axis())
    assert witness.hears('204#0F00E8030000', 0.0) == [
        '0.000000 +0.000 main axis > cyclic request: control_word 15, target_velocity 1000 rpm']
    assert witness.hears('080#', 0.0001)[0].endswith('main > SYNC: all nodes')
    line, = witness.hears('184#3712E7030000', 0.002)
    assert 'axis < cyclic response: status_word 1237h' in line
    assert 'actual_velocity 999' in line
    assert line.endswith('(operation enabled) [1.9 ms]')
    observed = witness.observed('axis')
    assert (observed.exchanges, observed.missed) == (1, 0)


def test_all_pdos_make_an_exchange() -> None:
    witness = Witness(axis(response=(ACTUAL, POSITION), response_pdos=(1, 3)))
    witness.hears('204#0F0000000000', 0.0)
    witness.hears('080#', 0.0)
    witness.hears('184#371200000000', 0.001)
    assert witness.observed('axis').exchanges == 0
    assert witness.hears('384#10270000', 0.002)[0].endswith('position 10000 [2.0 ms]')
    assert witness.observed('axis').exchanges == 1
    # the next one lacks one of them
    witness.hears('204#0F0000000000', 0.01)
    witness.hears('080#', 0.01)
    witness.hears('184#371200000000', 0.011)
    witness.hears('204#0F0000000000', 0.02)
    assert any('LOST' in line for line in witness.hears('080#', 0.02))
    observed = witness.observed('axis')
    assert (observed.exchanges, observed.missed) == (1, 1)


def test_a_sync_that_follows_nothing_asks_for_nothing() -> None:
    witness = Witness(axis())
    for cycle in range(5):
        witness.hears('080#', 0.01 * cycle)
    assert witness.waits(1.0) == []
    assert witness.observed('axis').missed == 0


def test_exchanges_that_nobody_asks_for() -> None:
    witness = Witness(axis(mode='pv', transmission='event', period=0.02))
    for cycle in range(3):
        witness.hears('184#371200000000', 0.02 * cycle)
    assert witness.observed('axis').exchanges == 3
    witness.waits(0.5)
    observed = witness.observed('axis')
    assert (observed.missed, round(observed.period.mean, 6)) == (1, 0.02)


def test_objects() -> None:
    witness = Witness(axis())
    assert witness.hears('604#4061600000000000', 0.0)[0].endswith('axis > read: x6061.00')
    assert witness.hears('584#4F61600000000000', 0.001)[0].endswith(
        '< read: x6061.00 0 [1.0 ms]')
    assert witness.hears('604#4064600000000000', 0.1)[0].endswith('> read: position')
    assert witness.hears('584#43646000F0D8FFFF', 0.101)[0].endswith('< read: position -10000 '
                                                                   '[1.0 ms]')
    assert witness.hears('604#2B001803E8030000', 0.2)[0].endswith('> write: x1800.03 1000')
    assert witness.hears('584#6000180300000000', 0.203)[0].endswith('< write: x1800.03 [3.0 ms]')
    witness.hears('604#23001A0120006460', 0.3)
    assert witness.hears('584#80001A0141000406', 0.301)[0].endswith(
        '< write: x1a00.01: REFUSED: 06040041h (object cannot be mapped to a PDO) [1.0 ms]')
    witness.hears('604#4005100000000000', 0.4)
    assert witness.waits(0.6)[0].endswith('LOST: no answer')
    assert witness.hears('604#8005100000000405', 0.6)[0].endswith(
        '> abort: x1005.00 (05040000h (SDO protocol timed out))')
    assert witness.hears('584#2000000000000000', 0.7)[0].split('MALFORMED')[1] == (
        ': SDO command 20h is no answer that was asked for')
    observed = witness.observed('axis')
    assert (observed.requests, observed.refused, observed.unanswered) == (5, 1, 1)


def test_a_name_by_segments() -> None:
    witness = Witness(axis())
    witness.hears('604#4008100000000000', 0.0)
    assert witness.hears('584#410810001A000000', 0.001)[0].endswith('< read: x1008.00 [1.0 ms]')
    for request, answer in (('60', '0054696E79204E6F'), ('70', '106465202D204D65'),
                            ('60', '00676120446F6D61')):
        assert witness.hears(f'604#{request}00000000000000', 0.01) == []
        assert witness.hears(f'584#{answer}', 0.011) == []
    assert witness.hears('604#7000000000000000', 0.02) == []
    assert witness.hears('584#15696E7320210000', 0.021)[0].endswith(
        "< read: x1008.00 ('Tiny Node - Mega Domains !')")
    assert witness.observed('axis').unanswered == 0


def test_what_nodes_and_bridge_say() -> None:
    witness = Witness(axis())
    assert witness.hears('000#0104', 0.0)[0].endswith('axis > NMT: start node 4')
    assert witness.hears('704#00', 0.1)[0].endswith('SUSPICIOUS: the device has started')
    assert witness.hears('704#05', 0.2)[0].endswith('axis < heartbeat: operational')
    assert witness.hears('77F#05', 0.3)[0].endswith('main > heartbeat: of the bridge: operational')
    assert '8130h (life guard or heartbeat error)' in witness.hears(
        '084#3081110000000000', 0.4)[0]
    assert witness.hears('204#0F00', 0.5)[0].split('MALFORMED')[1].startswith(': PDO 1 with 2')


@given(st.lists(st.tuples(
    st.sampled_from((0x000, 0x080, 0x084, 0x184, 0x204, 0x384, 0x584, 0x604, 0x704, 0x77F)),
    st.binary(max_size=8), st.integers(0, 30))))
def test_understands_anything(frames: list[tuple[int, bytes, int]]) -> None:
    witness = Witness(axis(response=(ACTUAL, POSITION), response_pdos=(1, 3)))
    now = 0.0
    for identifier, data, pause in frames:
        now += pause / 1000.0
        witness.tracer.take(Record(now, 'can0', identifier, data, False))
    witness.waits(now + 10.0)
    assert len(witness.telegrams) >= sum(
        identifier not in (0x584, 0x604) for identifier, _, _ in frames)
