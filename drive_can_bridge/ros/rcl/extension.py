# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The extension of rclpy, which everything here goes through: none of it is public.

Looked up each time, because another one may stand in its place (tests), and by name only here.
"""

from collections.abc import Iterable
from typing import Any

from rclpy.exceptions import InvalidHandle

from drive_can_bridge.ros.rcl.unfit import Unfit

try:
    from rclpy.impl.implementation_singleton import rclpy_implementation
except ImportError:     # it is somewhere else: so it counts as empty, and other ways are used
    rclpy_implementation = None


class Extension:
    """The parts of rcl in rclpy, by their names there."""

    def __getattr__(self, name: str) -> Any:
        return getattr(rclpy_implementation, name)


extension = Extension()
#: what rcl refuses; RuntimeError is the class above it
RCLError: type[Exception] = getattr(rclpy_implementation, 'RCLError', RuntimeError)
#: what is raised when the thing that is used, or its context, is there no more
GONE = InvalidHandle, RCLError


def lacking(names: Iterable[str]) -> str:
    """Return which member there is not; '': they are all there."""
    try:
        look_for(names)
    except Unfit as error:
        return str(error)
    return ''


def look_for(names: Iterable[str]) -> None:
    """
    Check that members exist.

    :param names: ``Client.take_response``, and the like.
    :raises Unfit: they do not; with the first missing one.
    """
    for name in names:
        found: Any = extension
        for part in name.split('.'):
            try:
                found = getattr(found, part)
            except AttributeError:
                raise Unfit(f'rclpy has no {name} any more') from None
