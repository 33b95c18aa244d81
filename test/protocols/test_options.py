# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The keys of a family as a dataclass, and what is made from it."""

from dataclasses import dataclass, FrozenInstanceError
from typing import Literal

import pytest

from drive_can_bridge.protocols.family import FamilyOptions, make_options, option, options_schema


@dataclass(frozen=True, slots=True)
class Shared(FamilyOptions):
    gap: float = option(0.5, 's of silence.', minimum=0.1, maximum=2)


@dataclass(frozen=True, slots=True)
class Own(Shared):
    order: Literal['high', 'low'] = option('high', 'Which comes first.')
    count: int = option(3, 'How many.', minimum=1)
    loud: bool = option(False, 'Or not.')
    place: int = option(None, 'Depends on the station.', maximum=9)


def test_schema() -> None:
    assert options_schema(Own) == {
        'order': {'description': 'Which comes first.', 'enum': ['high', 'low'],
                  'default': 'high'},
        'count': {'description': 'How many.', 'type': 'integer', 'minimum': 1, 'default': 3},
        'loud': {'description': 'Or not.', 'type': 'boolean', 'default': False},
        'place': {'description': 'Depends on the station.', 'type': 'integer', 'maximum': 9},
        'gap': {'description': 's of silence.', 'type': 'number', 'minimum': 0.1, 'maximum': 2,
                'default': 0.5}}
    assert list(options_schema(Own)) == ['order', 'count', 'loud', 'place', 'gap']
    assert options_schema(FamilyOptions) == {}


def test_values() -> None:
    made = make_options(Own, {'gap': 1, 'order': 'low', 'place': 4})
    assert made == Own(gap=1.0, order='low', place=4)
    assert repr(made.gap) == '1.0'
    assert (made.count, made.loud) == (3, False)
    with pytest.raises(FrozenInstanceError):
        made.count = 4
    with pytest.raises(TypeError):
        make_options(Own, {'gab': 1})
