# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a drive was told last."""

from builders import INT16, INT32, parameter, UINT16
from hypothesis import given, strategies as st

from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.core.process_image import LastSent

KINDS = (INT16, UINT16, INT32, ParameterType.UINT32, ParameterType.BOOL)


def sent(count: int = len(KINDS)) -> LastSent:
    return LastSent([parameter(f'q{place}', place + 1, type=kind)
                     for place, kind in enumerate(KINDS[:count])])


@given(st.integers(-2**15, 2**16 - 1), st.integers(-2**31, 2**32 - 1))
def test_words_and_raw_integers_are_taken_alike(word: int, wide: int) -> None:
    last = sent()
    last.take((word, word, wide, wide, word))
    assert last.raws == tuple(
        each.raw_from_word(each.word_from_raw(value)) for each, value in
        zip(last.parameters, (word, word, wide, wide, word)))


def test_some_of_them() -> None:
    last = sent(3)
    assert last.raws == (None, None, None)
    last.take((0xFFFF,), 1)
    assert (last.raws, last.times) == ((None, 0xFFFF, None), [0, 1, 0])
    last.take((0xFFFF, 7))
    assert (last.raws, last.times) == ((-1, 7, None), [1, 2, 0])
    last.clear()
    assert last.raws == (None, None, None)


def test_the_same_tuple_until_something_changes() -> None:
    last = sent(2)
    last.take((1, 2))
    before = last.raws
    last.take((1, 2))
    assert last.raws is before
    assert last.times == [2, 2]
    last.take((3,), 1)
    assert last.raws == (1, 3)
