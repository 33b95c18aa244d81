# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Watching DataModel drives. Frames are those of the manual's examples and the golden vectors."""

from builders import drive
from hypothesis import given, strategies as st
from trace_builders import Witness

from drive_can_bridge.core.record import Record, RecordKind
from drive_can_bridge.protocols.observer import Kind
from drive_can_bridge.trace.sinks import Only


def test_an_exchange() -> None:
    witness = Witness(drive())
    assert witness.hears('003FFFF0#138803E800000000', 100.0) == [
        '0.000000 +0.000 main conveyor > cyclic request: speed_setpoint 500.0 rpm, '
        'torque_limit 100.0 %']
    assert witness.hears('103FFFF0#FA24000500030000', 100.0008) == [
        '0.000800 +0.000 main conveyor < cyclic response: actual_speed -150.0 rpm, '
        'motor_current 0.05 A, status_word 0003h (ready, enabled) [0.8 ms]']
    assert witness.hears('003FFFF0#FFFF000000000000', 100.02) == [
        '0.020000 +0.020 main conveyor > cyclic request: speed_setpoint -0.1 rpm, '
        'torque_limit 0.0 %']
    observed = witness.observed('conveyor')
    assert (observed.exchanges, observed.missed) == (1, 0)
    assert round(observed.latency.mean, 6) == 0.0008
    assert round(observed.period.mean, 6) == 0.02


def test_an_answer_that_never_comes() -> None:
    witness = Witness(drive())
    witness.hears('003FFFF0#0000000000000000', 0.0)
    lost, _ = witness.hears('003FFFF0#0000000000000000', 0.02)
    assert lost == '0.020000 +0.000 main conveyor < cyclic response: LOST: no answer in 20 ms'
    assert witness.waits(0.0599) == []
    assert witness.waits(0.0601) == [
        '0.060000 +0.040 main conveyor < cyclic response: LOST: no answer in 40 ms']
    late, = witness.hears('103FFFF0#0000000000000000', 0.07)
    assert 'cyclic response: actual_speed 0.0 rpm' in late and late.endswith('LATE [50.0 ms]')
    unasked, = witness.hears('103FFFF0#0000000000000000', 0.071)
    assert unasked.endswith('UNASKED')
    observed = witness.observed('conveyor')
    assert (observed.exchanges, observed.missed, observed.late, observed.unasked) == (0, 2, 1, 1)


def test_a_response_too_short_for_its_map() -> None:
    """Also at the beginning of a trace, and where the requests are not in it."""
    witness = Witness(drive())
    short = '103FFFF0#FA240005'
    first, = witness.hears(short, 0.0)
    assert 'MALFORMED' in first and '4 data bytes' in first
    asked = witness.hears('003FFFF0#0000000000000000', 0.02) and witness.hears(short, 0.021)
    assert 'MALFORMED' in asked[0] and '4 data bytes' in asked[0]
    unasked, = witness.hears(short, 0.022)
    assert 'UNASKED' in unasked and '4 data bytes' in unasked


def test_reads_and_writes() -> None:
    witness = Witness(drive())
    # V28, V29, V16, V18 of the golden vectors: P30 and P31 are listed, P36 is not
    assert witness.hears('002001E2#0000000000000000', 0.0) == [
        '0.000000 +0.000 main conveyor > read: ramp_time, maximum_speed']
    assert witness.hears('102001E2#03E807D000000000', 0.002) == [
        '0.002000 +0.000 main conveyor < read: ramp_time 10.00 s, maximum_speed 200.0 rpm '
        '[2.0 ms]']
    assert witness.hears('003001E2#03E807D000000000', 0.01) == [
        '0.010000 +0.000 main conveyor > write: ramp_time 10.00 s, maximum_speed 200.0 rpm']
    assert witness.hears('003001E1#FFFB000000000000', 0.02) == [
        '0.020000 +0.010 main conveyor > write: ramp_time 655.31 s: SUSPICIOUS: EEPROM write '
        '10.0 ms after the last, the drive wants 20 ms']
    assert witness.hears('00300241#0001000000000000', 0.04) == [
        '0.040000 +0.020 main conveyor > write: p36 1']
    assert witness.hears('00300281#0001000000000000', 0.041) == [   # RAM: no gap
        '0.041000 +0.001 main conveyor > write: gain 1']
    assert witness.observed('conveyor').fast_writes == 1
    assert witness.observed('conveyor').requests == 5


def test_a_read_without_an_answer() -> None:
    witness = Witness(drive(parameter_timeout=0.1))
    # it may have been asked before the trace began
    assert witness.hears('102001E2#03E807D000000000', 0.0)[0].endswith('maximum_speed 200.0 rpm')
    witness.hears('002001E1#0000000000000000', 1.0)
    assert witness.hears('102001E2#03E807D000000000', 1.01)[0].endswith('UNASKED')
    assert witness.waits(1.2) == [
        '1.100000 +0.090 main conveyor < read: ramp_time: LOST: no answer']
    assert witness.hears('102001E1#03E8000000000000', 1.3) == [
        '1.300000 +0.200 main conveyor < read: ramp_time 10.00 s: LATE [300.0 ms]']
    assert witness.observed('conveyor').unanswered == 1


def test_malformed() -> None:
    witness = Witness(drive())
    assert 'MALFORMED: 7 data bytes' in witness.hears('003FFFF0#00000000000000', 0.0)[0]
    assert 'MALFORMED: 2 data bytes, 6 needed' in witness.hears('103FFFF0#0001', 0.001)[0]
    assert 'MALFORMED' in witness.hears('103001E2#03E807D000000000', 0.002)[0]   # V45
    assert 'MALFORMED' in witness.hears('002001EF#0000000000000000', 0.003)[0]   # V43
    assert witness.observed('conveyor').malformed == 4


def test_frames_of_nobody_are_shown_in_hex() -> None:
    witness = Witness(drive())
    assert witness.hears('005FFFF0#0001', 5.0) == ['0.000000 +0.000 main 005FFFF0#0001']
    assert witness.hears('3F1#03D1000100000000', 5.5) == [
        '0.500000 +0.000 main 3F1#03D1000100000000']
    assert witness.hears('3F1#03D1000100000000', 5.75) == [
        '0.750000 +0.250 main 3F1#03D1000100000000']
    assert witness.tracer.buses['main'].strays == 3


def test_a_second_master_is_told_where_the_trace_knows_directions() -> None:
    witness = Witness(drive())
    witness.hears('003FFFF0#0000000000000000', 0.0, sent=True)
    witness.hears('103FFFF0#0000000000000000', 0.001, sent=False)
    assert witness.hears('003FFFF0#0000000000000000', 0.01, sent=False)[0].endswith(
        'SUSPICIOUS: sent by another master')


def test_rounds_of_a_polled_drive() -> None:
    witness = Witness(drive('datamodel_standard'))
    for start in (0.0, 0.02):
        witness.hears('3F1#03D1000300000000', start)
        assert witness.hears('7F1#24FA000003000000', start + 0.001)[0].endswith(
            'main conveyor < read: actual_speed -150.0 rpm, motor_current 0.00 A, '
            'status_word 0003h (ready, enabled) [1.0 ms]')
    assert {telegram.kind for telegram in witness.telegrams} == {Kind.CYCLIC}
    # V61: a setpoint is no request of a user; V54: a read of one is
    assert witness.hears('3F1#063200DC05000000', 0.03)[0].endswith(
        '> write: speed_setpoint 150.0 rpm')
    assert witness.telegrams[-1].kind is Kind.CYCLIC
    witness.hears('3F1#03D1000100000000', 0.031)
    assert witness.telegrams[-1].kind is Kind.PARAMETER
    assert witness.waits(0.2) == [
        '0.131000 +0.110 main conveyor < read: actual_speed: LOST: no answer']
    witness.hears('3F1#03D1000300000000', 0.2)
    assert 'LOST' in witness.waits(0.4)[0]
    assert 'LATE' in witness.hears('7F1#0000000000000000', 0.41)[0]
    observed = witness.observed('conveyor')
    assert (observed.exchanges, observed.missed, observed.requests, observed.unanswered) == (
        2, 1, 1, 1)


def test_a_read_of_a_round_stays_one_when_another_read_follows() -> None:
    witness = Witness(drive('datamodel_standard'))
    witness.hears('3F1#03D1000300000000', 0.0)
    witness.hears('3F1#031E000100000000', 0.09)
    assert [line.split('main ')[1] for line in witness.waits(0.3)] == [
        'conveyor < read: actual_speed, motor_current, status_word: LOST: no answer',
        'conveyor < read: ramp_time: LOST: no answer']
    observed = witness.observed('conveyor')
    assert (observed.missed, observed.requests, observed.unanswered) == (1, 1, 1)


def test_only() -> None:
    def said(*only: Only) -> list[str]:
        witness = Witness(drive(), only=set(only))
        found = []
        for text, time in (
                ('003FFFF0#0000000000000000', 0.0), ('103FFFF0#0000000000000000', 0.001),
                ('002001E1#0000000000000000', 0.002), ('003FFFF0#0000000000000000', 0.02),
                ('103FFFF0#0001000000000000', 0.021), ('3F1#00', 0.022),
                ('003FFFF0#0000000000000000', 0.04), ('003FFFF0#0001000000000000', 0.06)):
            found += witness.hears(text, time)
        return [line.split()[0] + line.split()[5] for line in found if 'conveyor' in line]

    assert said(Only.PARAMETERS) == ['0.002000read:']
    assert said(Only.ERRORS) == ['0.060000cyclic']
    assert said(Only.CHANGES) == ['0.000000cyclic', '0.001000cyclic', '0.021000cyclic',
                                  '0.060000cyclic', '0.060000cyclic']
    assert len(said(Only.CHANGES, Only.PARAMETERS)) == 6


@given(st.lists(st.tuples(
    st.one_of(st.sampled_from([0x003FFFF0, 0x103FFFF0, 0x3F1, 0x7F1, 0x002001E1]),
              st.integers(0, 0x1FFFFFFF)),
    st.binary(max_size=8), st.booleans(), st.floats(0, 10), st.sampled_from(RecordKind))))
def test_anything(frames: list[tuple[int, bytes, bool, float, RecordKind]]) -> None:
    witness = Witness(drive(), drive('datamodel_standard', name='lift'))
    for identifier, data, extended, time, kind in frames:
        witness.tracer.take(Record(time, 'can0', identifier, data, extended, kind))
    witness.waits(100.0)
