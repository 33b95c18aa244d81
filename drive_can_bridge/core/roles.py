# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Who a drive's parameters belong to, by what they address.

A name says little: a profile may list one parameter twice, a raw name reaches it as well, and a
double word covers its neighbour. So each family says which *cells* of the drive a parameter
addresses (words of its memory, by whatever marks them), and what shares a cell with the control
word, a setpoint or a map is the bridge's own.
"""

from collections.abc import Callable, Hashable, Sequence
from enum import Enum

from drive_can_bridge.core.parameters import Parameter

#: what a parameter addresses; empty: nothing that acyclic frames reach
Cells = frozenset[Hashable]


class Role(Enum):
    """What the bridge itself uses a parameter for."""

    CYCLIC = 'cyclic'
    CONTROL = 'control'
    MAP = 'map'


class Roles:
    """
    What the bridge itself writes on one drive.

    :param cells: what a parameter addresses.
    :param control: the parameter of the control word, if acyclic frames reach it.
    :param cyclic: what is sent cyclically.
    :param maps: what tells the drive how cyclic telegrams are to be read.
    """

    def __init__(self, cells: Callable[[Parameter], Cells], *, control: Parameter | None,
                 cyclic: Sequence[Parameter], maps: Cells = frozenset()) -> None:
        self._cells = cells
        own = [] if control is None else [(Role.CONTROL, control)]
        own += [(Role.CYCLIC, parameter) for parameter in cyclic if parameter is not control]
        self._own = [(role, parameter, cells(parameter)) for role, parameter in own]
        self._maps = maps

    def owner(self, parameter: Parameter) -> tuple[Role, Parameter] | None:
        """
        Return what a parameter is written for by the bridge, and as which parameter.

        The control word goes before setpoints, and those before maps; None: users may have it.
        """
        cells = self._cells(parameter)
        for role, other, others in self._own:
            if parameter == other or cells & others:
                return role, other
        return (Role.MAP, parameter) if cells & self._maps else None
