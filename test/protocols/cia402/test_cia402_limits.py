# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Mapped objects exist, and limits that are sent are in effect, or the drive is not driven."""

from collections.abc import Callable
from typing import Any

import pytest
from saying import says
from servo_builders import Axis, MODE_TARGETS, POSITION, TORQUE_LIMIT
from stacks import AcceptsAnything, ChecksMapping, DropsLimit, FourBytes

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import DriveState, MappingDiffered, Noted

LIMIT = (0x6072, 0)
#: what the drive holds before anything is sent: the same as is sent first; or something else
SAME, OTHER = (1000).to_bytes(2, 'little'), (300).to_bytes(2, 'little')
READ = '605#4072600000000000'


def limited(make: Any = DropsLimit, content: bytes | None = SAME, **options: Any) -> Axis:
    """Have an axis with a torque limit, which the drive holds as given; None: it has none."""
    objects = {} if content is None else {LIMIT: content}
    options.setdefault('mode', 'csv')
    return Axis(make=make, objects=objects, request=(MODE_TARGETS['csv'], TORQUE_LIMIT),
                **options)


def found_differing(axis: Axis) -> Any:
    assert axis.session.state is DriveState.MAPPING_DIFFERS, axis.session.offline_advice
    return axis.talk.events(MappingDiffered)[-1].text


def bounds(axis: Axis, value: float) -> None:
    """Command the limit, the second setpoint."""
    axis.talk.commands(1, value, axis.now)


class TestObjects:

    @pytest.mark.parametrize('make', [AcceptsAnything, ChecksMapping])
    @pytest.mark.parametrize('mapping', ['configure', 'verify'])
    def test_one_that_the_drive_lacks(self, make: Any, mapping: str) -> None:
        axis = limited(make, None, mapping=mapping).start().live(3.0)
        assert found_differing(axis) == says(
            'of_object', what='torque_limit (6072h.00h)', why=says('no_such_object'))
        assert 'torque_limit (6072h.00h): no such object' in axis.session.offline_advice
        assert not any(text.startswith(('000#', '205#')) for text in axis.take())
        axis.drive.objects[LIMIT] = SAME    # it was another drive
        if mapping == 'configure':
            axis.live(1.5)
            assert axis.session.online

    def test_no_such_sub_index_is_none_either(self) -> None:
        axis = limited()
        axis.drive.instead = {'40726000': '8072600011000906'}
        axis.start()
        assert found_differing(axis) == says('of_object', why=says('no_such_object'))

    @pytest.mark.parametrize('code', ['01000106', '22000008', '00000108'])
    def test_any_other_refusal_proves_nothing(self, code: str) -> None:
        axis = limited()
        axis.drive.instead = {'40726000': '80726000' + code}
        axis.enabled()
        bounds(axis, 30.0)
        axis.live(2.0)
        assert axis.session.state is DriveState.NOT_ARMED
        assert not axis.session.error

    def test_assume_does_not_look(self) -> None:
        axis = limited(AcceptsAnything, None, mapping='assume').start()
        assert READ not in axis.take()

    @pytest.mark.parametrize(('make', 'fits'), [(AcceptsAnything, False), (FourBytes, True)])
    def test_sizes_count_where_the_status_word_has_its_own(self, make: Any, fits: bool) -> None:
        axis = Axis(make=make, objects={(0x6064, 0): b'\1\0'})
        if make is FourBytes:
            axis.drive.objects[0x6064, 0] = bytes(4)
        axis.start()
        assert axis.session.online is fits
        if not fits:
            assert found_differing(axis) == says(
                'of_object', what='position (6064h.00h)',
                why=says('other_length', length=2, listed='int32'))

    def test_all_that_is_missing_is_named(self) -> None:
        axis = limited(AcceptsAnything, None, response=(POSITION,))
        del axis.drive.objects[0x6064, 0]
        axis.start()
        text = found_differing(axis)
        assert 'torque_limit (6072h.00h)' in text and 'position (6064h.00h)' in text


class TestLimits:

    def test_one_in_effect_is_read_before_the_drive_is_enabled_and_behind_a_change(self) -> None:
        axis = limited(AcceptsAnything).enabled()
        axis.live(2.0)
        assert READ not in axis.take()
        for value in (30.0, 40.0, 50.0):
            bounds(axis, value)
            axis.live(1.0)
        assert axis.take().count(READ) == 1     # the first change shows it
        assert axis.session.state is DriveState.NOT_ARMED and not axis.session.error

    def test_the_first_look_comes_behind_a_sync_and_before_000f(self) -> None:
        axis = limited(AcceptsAnything)
        axis.activate()
        while not axis.session.online:
            axis.live(0.001)
        axis.asks(ControlAction.ENABLE)
        sent = axis.take()
        first = sent.index('080#')
        assert first < sent.index(READ, first) < next(
            place for place, text in enumerate(sent) if text.startswith('205#0F00'))

    def test_enable_waits_for_it(self) -> None:
        axis = limited(AcceptsAnything)
        hold: list[bool] = []
        takes = axis.drive.takes
        axis.drive.takes = lambda sent: (   # type: ignore[method-assign]
            [] if hold and str(sent) == READ else takes(sent))
        axis.activate()
        while '000#0105' not in [text for _, text in axis.log]:
            axis.live(0.001)
        hold.append(True)
        axis.live(0.3)
        assert axis.session.online
        (action, success, message), = axis.asks(ControlAction.ENABLE, 2.5)
        assert (action, success) == ('enable', False)
        assert 'torque_limit (6072h.00h) has not been read back yet' in message
        assert 0x0F not in axis.drive.told
        assert axis.take().count(READ) > 10     # silence is asked again
        hold.clear()
        axis.live(0.5)
        assert axis.asks(ControlAction.ENABLE) == [('enable', True, 'operation enabled')]

    @pytest.mark.parametrize('transmission', ['sync', 'event'])
    def test_one_that_stays_what_it_was_is_not_driven(self, transmission: str) -> None:
        axis = limited(DropsLimit, OTHER, transmission=transmission,
                       mode='csv' if transmission == 'sync' else 'pv')
        if transmission == 'event':
            send_by_timer(axis)
        axis.start()
        axis.live(1.0)
        assert found_differing(axis) == says(
            'limit_without_effect', what='torque_limit (6072h.00h)', shown='30 %', sent='100 %')
        axis.take()
        axis.live(5.0)      # looked at again, and still the same: it is left alone
        assert not any(text.startswith(('000#', '205#')) for text in axis.take())
        axis.drive.objects[LIMIT] = (400).to_bytes(2, 'little')
        axis.drive.__class__ = AcceptsAnything
        axis.live(1.5)
        assert axis.session.online

    def test_it_has_half_a_second(self) -> None:
        axis = limited(Slow, OTHER).enabled()
        axis.drive.late = 45        # cycles
        bounds(axis, 50.0)
        axis.live(1.0)
        assert not axis.session.error
        assert axis.drive.objects[LIMIT] == (500).to_bytes(2, 'little')

    def test_found_while_it_is_enabled(self) -> None:
        axis = limited(DropsLimit).enabled().commands(0.0, 100.0)
        axis.live(0.1)
        assert axis.session.state is DriveState.ONLINE
        bounds(axis, 30.0)
        axis.live(0.4)
        assert axis.session.state is DriveState.ONLINE
        axis.live(0.3)
        error, = axis.talk.events(Noted)
        assert error.error and error.text == says('limit_in_vain', why=says(
            'limit_without_effect', shown='100 %', sent='30 %'))
        assert axis.session.error == error.text
        assert axis.session.state is DriveState.NOT_ARMED
        axis.take()
        axis.commands(0.0, 100.0)       # nothing arms any more
        axis.live(0.1)
        assert {text for text in axis.take() if text.startswith('205#')} == {
            '205#0F00000000002C01'}
        axis.live(3.0)                  # it is not switched off for that
        assert axis.drive.state == axis.drive.ENABLED
        assert axis.asks(ControlAction.DISABLE) == [('disable', True, 'ready to switch on')]
        assert found_differing(axis) == says('limit_without_effect')

    def test_the_next_enable_is_refused(self) -> None:
        axis = limited(DropsLimit).enabled()
        bounds(axis, 30.0)
        axis.live(0.7)
        assert axis.session.services.control_refusal(ControlAction.ENABLE) == says('limit_in_vain')
        assert not axis.session.services.control_refusal(ControlAction.DISABLE)

    def test_a_change_that_was_taken_back_shows_nothing(self) -> None:
        axis = limited(DropsLimit).enabled()
        bounds(axis, 30.0)
        axis.live(0.2)
        bounds(axis, 100.0)
        axis.live(2.0)
        assert not axis.session.error
        bounds(axis, 30.0)
        axis.live(0.7)
        assert axis.session.error

    def test_one_that_is_changed_all_the_time(self) -> None:
        axis = limited(DropsLimit).enabled()
        for step in range(100):
            bounds(axis, 30.0 + 0.1 * step)
            axis.live(0.01)
        assert axis.session.error

    def test_a_third_value_is_a_warning(self) -> None:
        axis = limited(Clamps, OTHER).enabled()
        axis.live(1.0)
        assert axis.session.warning == says(
            'limit_otherwise', what='torque_limit (6072h.00h)', shown='80 %', sent='100 %')
        assert axis.asks(ControlAction.ENABLE) == [('enable', True, 'operation enabled')]
        bounds(axis, 90.0)
        axis.live(1.0)
        assert not axis.session.error
        assert axis.session.warning == says('limit_otherwise', shown='80 %', sent='90 %')
        bounds(axis, 50.0)
        axis.live(1.0)
        assert not axis.session.warning

    def test_lost_answers_are_asked_for_again(self) -> None:
        axis = limited(DropsLimit).enabled()
        bounds(axis, 30.0)
        takes: Callable[..., Any] = axis.drive.takes
        axis.drive.takes = lambda sent: (   # type: ignore[method-assign]
            [] if str(sent) == READ else takes(sent))
        axis.live(3.0)
        assert not axis.session.error
        del axis.drive.takes    # type: ignore[method-assign]
        axis.live(0.3)
        assert axis.session.error


class Clamps(AcceptsAnything):
    """Takes no limit above 80 %."""

    def write(self, index: int, subindex: int, content: bytes) -> None:
        if index == 0x6072:
            content = min(int.from_bytes(content, 'little'), 800).to_bytes(2, 'little')
        super().write(index, subindex, content)


class Slow(AcceptsAnything):
    """Takes a limit some cycles after it came."""

    late = 0

    def _apply(self) -> None:
        kept = self.objects.get(LIMIT)
        super()._apply()
        if self.late and kept is not None:
            self.late -= 1
            self.objects[LIMIT] = kept


def send_by_timer(axis: Axis) -> None:
    """Have the drive answer each RPDO at once, as its event timer would a little later."""
    axis.drive.objects[0x1800, 5] = bytes(2)
    takes = axis.drive.takes

    def answer(sent: Any) -> Any:
        found = takes(sent)
        return found or axis.drive.responses(255, 254) if sent.identifier == 0x205 and (
            axis.drive.operational) else found
    axis.drive.takes = answer   # type: ignore[method-assign]
