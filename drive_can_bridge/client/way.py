# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The interface of a way to a running bridge: through ROS, or past it on this host."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from drive_can_bridge.core.parameters import Value

#: the value of a parameter of a node; None: none, or of another type
Found = Value | str | tuple[str, ...] | None


class Described(NamedTuple):
    """
    A node's description of a parameter.

    :ivar facts: ``key=value`` pairs in one line.
    :ivar minimum: None: unlimited.
    """

    name: str
    text: str
    facts: str
    minimum: float | None
    maximum: float | None


class Way(Protocol):
    """
    A way to the drives of a bridge, or of all bridges of one namespace.

    Nodes are given by their full names. Every request may raise :class:`.NoAnswer`.
    """

    @property
    def bridge_of(self) -> Mapping[str, str]:
        """Return the full name of the bridge of each drive, in the order of the configuration."""

    def get(self, node: str, names: Sequence[str]) -> Sequence[Found]:
        """Return values of parameters; fewer where a bridge does not know one of them."""

    def describe(self, node: str, names: Sequence[str]) -> Sequence[Described]:
        """Return the descriptions of parameters of a drive."""

    def listed(self, node: str) -> Sequence[str]:
        """Return the names of the parameters that a drive lists."""

    def set(self, node: str, name: str, value: Value) -> tuple[bool, str]:
        """Set a parameter of a drive; return whether it was, and why not, or a note."""

    def condition(self, drive: str, *, age: float, patience: float) -> Mapping[str, str]:
        """
        Return the facts of the diagnostics of a drive; none: there are none.

        :param age: s that they may have; else newer ones are waited for, so much longer:
        :param patience: s.
        """

    def close(self) -> None:
        """Close it. Idempotent."""
