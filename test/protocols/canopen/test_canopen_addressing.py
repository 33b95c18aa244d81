# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Objects of a CANopen node, by the names that they have where no profile names them."""

import pytest

from drive_can_bridge.protocols.canopen.addressing import name_of_object, object_of_name


@pytest.mark.parametrize(('name', 'place'), [
    ('x2004.10', (0x2004, 0x10)), ('xA.0', (0xA, 0)), ('x20040.1', None), ('x2004.100', None),
    ('X2004.10', None), ('x2004', None), ('p455', None)])
def test_names_of_objects(name: str, place: tuple[int, int] | None) -> None:
    assert object_of_name(name) == place
    if place is not None:
        assert object_of_name(name_of_object(*place)) == place
