# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Values as they are written, histories, rates, whose samples are received, hints."""

import json
import math

from monitor_builders import info, seen, three_drives
import pytest

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Value, ValueKind
from drive_can_bridge.core.text import printable
from drive_can_bridge.monitor.snapshot import columns, History, Rate
from drive_can_bridge.monitor.summary import documents
from drive_can_bridge.monitor.values import ParameterInfo, SamplingPlan

# -- values ---------------------------------------------------------------------------------------

@pytest.mark.parametrize(('told', 'value', 'text'), [
    (info('speed', 'rpm', scale='0.1'), 12.34, '12.3'),
    (info('speed', 'rpm', scale='0.1'), -0.04, '0.0'),
    (info('speed', 'rpm', scale='0.25'), 0.25, '0.25'),
    (info('speed', 'rpm', scale='0.003051757'), 50.0, '50.000'),
    (info('speed', 'rpm', scale='10'), 50.0, '50'),
    (info('speed', 'rpm', scale='nonsense'), 50.0, '50.000'),
    (info('speed', 'rpm', scale='nan'), math.inf, 'inf'),
    (info('count'), -7, '-7'),
    (info('status_word', kind='uint16'), 0x1234, '0x1234'),
    (info('control_word', kind='uint32'), 0x1234, '0x00001234'),
    (ParameterInfo('control_word', ValueKind.INTEGER, facts={'values': '0:disable 1:enable'}), 1,
     '0x0001 enable'),
    (ParameterInfo('flag', ValueKind.BOOL), True, 'true')])
def test_values_have_the_digits_of_their_steps(told: ParameterInfo, value: Value,
                                               text: str) -> None:
    assert told.text(value) == text


@pytest.mark.parametrize(('told', 'width'), [
    (info('speed', 'rpm', scale='0.1'), len('-3276.8')), (info('count'), len('-32768')),
    (info('limit', '%', 'uint16', '0.1'), len('6553.5')),
    (info('status_word', kind='uint16'), len('0xFFFF')),
    (ParameterInfo('flag', ValueKind.BOOL), len('false')),
    (ParameterInfo('what', ValueKind.DOUBLE), 8)])
def test_there_is_room_for_the_longest_value(told: ParameterInfo, width: int) -> None:
    assert told.width == width


@pytest.mark.parametrize(('facts', 'address'), [
    ({'number': '30'}, 'P30'), ({'number': '613', 'subindex': '5'}, 'P613.5'),
    ({'index': '0x2004', 'subindex': '0x06'}, '2004h.06h'),
    ({'number': '455', 'index': '0x2004', 'subindex': '0x06'}, 'P455'), ({}, '')])
def test_parameters_are_named_as_in_manuals(facts: dict[str, str], address: str) -> None:
    assert ParameterInfo('x', facts=facts).address == address


@pytest.mark.parametrize('text', ['1', '0', '2', 'maybe', ''])
def test_a_bool_is_made_of_nothing_else(text: str) -> None:
    flag = ParameterInfo('flag', ValueKind.BOOL)
    assert (flag.parse('true'), flag.parse('off')) == (True, False)
    with pytest.raises(ValueRefused, match=f"^'{text}' is no value: write true or false$"):
        flag.parse(text)


def test_text_is_printable_and_short() -> None:
    assert printable('Grüße, µs') == 'Grüße, µs'
    assert printable('a\tb\x1b[2J\x9b') == 'a\\tb\\x1b[2J\\x9b'
    assert len(printable('x' * 1000)) == 256


# -- histories ------------------------------------------------------------------------------------

def test_a_history_forgets() -> None:
    history = History()
    for second in range(100):
        history.add(float(second), float(second))
    history.add(math.nan, 99.5)
    points = history.points(100.0)
    assert points[0] == (60.0, 40.0)
    assert points[-1] == (1.0, 99.0)


def test_points_fall_into_columns_and_small_gaps_close() -> None:
    points = ((9.9, 1.0), (4.9, 2.0), (1.9, 3.0), (0.0, 4.0))
    assert columns(points, 10.0, 5) == (1.0, 1.0, 2.0, 2.0, 4.0)
    assert columns((), 10.0, 3) == (None, None, None)
    assert columns(((25.0, 1.0),), 10.0, 3) == (None, None, None)


def test_rates_begin_anew_when_a_counter_does() -> None:
    rate = Rate()
    rate.update(100, 1.0)
    assert rate.value == 0.0
    rate.update(150, 2.0)
    assert rate.value == 50.0
    rate.update(150, 2.0)  # the same message once more
    assert rate.value == 50.0
    rate.update(10, 3.0)
    assert rate.value == 0.0


# -- whose samples are received -------------------------------------------------------------------

def test_few_drives_are_all_sampled_all_the_time() -> None:
    plan = SamplingPlan()
    rates = {'/a': 50.0, '/b': 50.0, '/c': 0.0}
    assert all(plan.choose(rates, (), 0.1 * step) == {'/a', '/b', '/c'} for step in range(100))


def test_many_fast_drives_take_turns_within_the_budget() -> None:
    plan = SamplingPlan(budget=1000.0)
    rates = {f'/d{number}': 200.0 for number in range(15)}
    seen_at: dict[str, float] = {}
    for step in range(100):
        chosen = plan.choose(rates, ['/d3'], 0.25 * step)
        assert '/d3' in chosen
        assert sum(rates[name] for name in chosen) <= 1000.0
        seen_at.update(dict.fromkeys(chosen, 0.25 * step))
        if step >= 25:  # everybody is seen every few seconds
            assert len(seen_at) == 15
            assert min(seen_at.values()) >= 0.25 * step - 6.0


def test_a_drive_beyond_the_budget_gets_its_turn_too() -> None:
    plan = SamplingPlan(budget=100.0)
    rates = {'/a': 5000.0, '/b': 5000.0}
    chosen = [plan.choose(rates, (), 2.0 * step) for step in range(4)]
    assert chosen == [{'/a'}, {'/b'}, {'/a'}, {'/b'}]


def test_what_is_looked_at_closely_counts_at_once() -> None:
    plan = SamplingPlan(budget=100.0)
    rates = {'/a': 100.0, '/b': 100.0}
    assert plan.choose(rates, (), 0.0) == {'/a'}
    assert '/b' in plan.choose(rates, ['/b'], 0.1)
    assert plan.choose({}, ['/b'], 0.2) == set()



def test_documents_have_numbers_for_programs() -> None:
    found = {each['drive']: each for each in documents(seen(three_drives()))}
    assert json.loads(json.dumps(list(found.values()))) == list(found.values())
    for name, drive in ((drive.name, drive) for drive in seen(three_drives()).drives):
        assert (found[name]['state'], found[name]['online']) == (drive.state, drive.online)
        assert list(found[name]['values']) == [each.name for each in drive.values]
    values = [each['value'] for drive in found.values() for each in drive['values'].values()]
    assert any(isinstance(value, float) for value in values)
    assert found['/conveyor']['values']['status_word'] == {'value': 3, 'unit': ''}


def test_names_of_values_stand_beside_the_number_and_are_read() -> None:
    told = ParameterInfo('source', ValueKind.INTEGER, facts={
        'type': 'uint16', 'values': '0:terminals 3:panel of the drive'})
    panel = '3 panel of the drive'
    assert [told.text(value) for value in (0, 3, 5)] == ['0 terminals', panel, '5']
    assert told.assignment(3) == f'source={panel}'
    assert [told.parse(text) for text in ('terminals', panel, '3', '5')] == [0, 3, 3, 5]
    assert told.width == len(panel)
    with pytest.raises(ValueRefused):
        told.parse('panel')
