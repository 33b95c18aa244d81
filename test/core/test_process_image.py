# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is exchanged with a drive, as parameters in order."""

from builders import CONTROL, drive, GAIN, parameter, SPEED, STATUS, WORD

from drive_can_bridge.core.process_image import ProcessImage

BUILT_IN = parameter('built_in_word', None)


def test_control_word_in_its_slot() -> None:
    image = ProcessImage.of(
        drive(control=CONTROL, request=(WORD, SPEED), response=(STATUS, GAIN)), controlled=True)
    assert image.setpoints == (SPEED,)
    assert image.request == (WORD, SPEED)
    assert image.sample == (STATUS, GAIN)


def test_control_word_without_a_slot_comes_last() -> None:
    image = ProcessImage.of(drive(control=CONTROL, request=(SPEED,)), controlled=True)
    assert image.setpoints == (SPEED,)
    assert image.request == (SPEED, WORD)


def test_control_word_that_nobody_looks_after_is_a_setpoint() -> None:
    for control in (None, CONTROL):
        image = ProcessImage.of(drive(control=control, request=(WORD, SPEED)), controlled=False)
        assert image.setpoints == image.request == (WORD, SPEED)


def test_what_is_built_in_comes_first_and_is_no_setpoint() -> None:
    image = ProcessImage.of(
        drive(request=(SPEED,), response=(GAIN,)), controlled=True, word=(BUILT_IN,),
        status=(STATUS,))
    assert image.setpoints == (SPEED,)
    assert image.request == (BUILT_IN, SPEED)
    assert image.sample == (STATUS, GAIN)
