# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which parameters the bridge itself uses, by what they address, and so which ones users may write.

A name is not enough: a profile may list one parameter twice, a raw name reaches it as well, and a
double word covers its neighbour. So each family says which *cells* of the drive a parameter
addresses (words of its memory, by whatever marks them), and what shares a cell with the control
word, a setpoint or a map is the bridge's own.
"""

from collections.abc import Callable, Hashable, Sequence
from enum import Enum
from typing import TYPE_CHECKING

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.parameters import Parameter

if TYPE_CHECKING:   # a command that wants to know a role needs no configuration
    from drive_can_bridge.core.configuration import DriveConfiguration

#: index of the mode of operation, which servos are controlled by beside their control word
_MODE = 0x6060
#: cells that a parameter addresses; empty: none that acyclic frames reach
Cells = frozenset[Hashable]


class Role(Enum):
    """What the bridge itself uses a parameter for."""

    CYCLIC = 'cyclic'
    CONTROL = 'control'
    MAP = 'map'


def by_number(parameter: Parameter) -> Cells:
    """Return the cells of a parameter that its number addresses completely."""
    return frozenset() if parameter.number is None else frozenset([parameter.number])


def publish_it(parameter: Parameter) -> Sentence:
    """Return why a setpoint is not written by request."""
    return sentences.sent_cyclically(parameter.name)


def controlled_by(own: Parameter, word: Callable[[], Sentence] = sentences.use_enable) -> Sentence:
    """
    Return why what a drive is controlled by is not written by request.

    :param own: as the bridge writes it.
    :param word: makes the reason for the control word.
    """
    return sentences.bridge_sets_mode() if own.index == _MODE else word()


class Roles:
    """
    The parameters that the bridge itself writes on one drive.

    :param controlled: a control machine looks after the control word.
    :param cells: what a parameter addresses.
    :param maps: what defines for the drive how cyclic telegrams are read.
    :param cyclic_refusal: why a setpoint is not written by request.
    :param built_in: what the bridge controls a drive by, whatever its name in profiles.
    :param refusal: why a parameter that the bridge does not use cannot be written.
    """

    def __init__(self, drive: 'DriveConfiguration', *, controlled: bool,
                 cells: Callable[[Parameter], Cells] = by_number, maps: Cells = frozenset(),
                 cyclic_refusal: Callable[[Parameter], Sentence] = publish_it,
                 refusal: Callable[[Parameter], Sentence] = lambda parameter: NOTHING,
                 built_in: Sequence[Parameter] = ()) -> None:
        from drive_can_bridge.core.process_image import control_word
        self.cells = cells
        self._cyclic_refusal = cyclic_refusal
        self._further_refusal = refusal
        control = control_word(drive, controlled=controlled)
        own = [(Role.CONTROL, each) for each in (*built_in, control) if each is not None]
        own += [(Role.CYCLIC, parameter) for parameter in drive.cyclic_request
                if parameter is not control]
        self._own = [(role, parameter, cells(parameter)) for role, parameter in own]
        self._received = [(parameter, cells(parameter)) for parameter in drive.cyclic_response]
        self._maps = maps

    def owner(self, parameter: Parameter) -> tuple[Role, Parameter] | None:
        """
        Return what the bridge writes a parameter for, and as which parameter.

        The control word goes before setpoints, and those before maps; None: users may write it.
        """
        cells = self.cells(parameter)
        for role, other, others in self._own:
            if parameter == other or cells & others:
                return role, other
        return (Role.MAP, parameter) if cells & self._maps else None

    def role(self, parameter: Parameter) -> Role | None:
        """Return what the bridge uses a parameter for, if users cannot set it for that reason."""
        owner = self.owner(parameter)
        if owner is not None:
            return owner[0]
        cells = self.cells(parameter)
        received = not parameter.writable and any(
            parameter == other or cells & others for other, others in self._received)
        return Role.CYCLIC if received else None

    def write_refusal(self, parameter: Parameter, *, exchanging: bool) -> Sentence:
        """
        Return why users may not write a parameter; '' if they may.

        :param exchanging: the bridge is in exchange with the drive, and needs its maps.
        """
        role, own = self.owner(parameter) or (None, parameter)
        if role is Role.CONTROL:
            return controlled_by(own)
        if role is Role.CYCLIC:
            return self._cyclic_refusal(own)
        if role is Role.MAP and exchanging:
            return sentences.mapping_parameter()
        return self._further_refusal(parameter)
