# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which parameters of a drive are settings: what a backup holds, and a restored one brings back.

Setpoints, the control word, and what process data alone carry, are none: no command writes them.
Neither are the bits that the profile's section ``restore`` sets and clears: they say in which mode
a drive is, not how it is set up. No file brings them back; a mode that a drive was left in is
ended. A parameter with such bits comes last, as its other bits are written with them.
"""

from dataclasses import dataclass

from drive_can_bridge.client.drive import Drive
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import RestoreStep, RestoreTable
from drive_can_bridge.core.roles import Role


@dataclass(frozen=True, slots=True)
class ModeBits:
    """
    What a restored backup does to a parameter that has bits of a mode.

    :param mask: those bits.
    :param at_end: what they are afterwards.
    :param ended: those of them in which a drive is left that was not taken out of the mode: set
        before, and otherwise afterwards.
    """

    mask: int
    at_end: int
    ended: int = 0

    def to_write(self, found: int, wanted: int) -> int:
        """
        Return the word that a drive is to have in the end.

        :param found: what it has: also the result where it has the setting and is not in the mode.
        :param wanted: in the backup.
        """
        word = wanted & ~self.mask | self.at_end
        return word if (found ^ word) & (~self.mask | self.ended) else found

    def is_over(self, raw: int) -> bool:
        """Tell whether a drive is not in the mode."""
        return not (raw ^ self.at_end) & self.ended


def mode_bits(table: RestoreTable | None) -> dict[str, ModeBits]:
    """Return the bits that belong to modes, by parameter."""
    found: dict[str, ModeBits] = {}
    for step in (*table.before, *table.after) if table is not None else ():
        known = found.get(step.parameter, ModeBits(0, 0))
        at_end = known.at_end & ~step.mask | step.bits
        found[step.parameter] = ModeBits(
            known.mask | step.mask, at_end, known.ended | (known.at_end ^ at_end) & known.mask)
    return found


def modes_of(drive: Drive) -> tuple[str, ...]:
    """Return the names of the parameters that tell whether a drive was left in a mode."""
    found = [drive.find(name) for name, bits in mode_bits(drive.facts.restore).items()
             if bits.ended]
    return tuple(parameter.name for parameter in found
                 if parameter is not None and parameter.readable and parameter.writable)


def is_whole(step: RestoreStep | ModeBits, parameter: Parameter) -> bool:
    """Tell whether all bits of a parameter are meant."""
    return step.mask == parameter.word_from_raw(-1)


def is_setting(drive: Drive, name: str) -> bool:
    """Tell whether a parameter is a setting of a drive."""
    parameter = drive.find(name)
    if parameter is None or not (parameter.readable and parameter.writable):
        return False
    if parameter.number is None and parameter.index is None:
        return False
    bits = mode_bits(drive.facts.restore).get(name)
    return (drive.role(name) not in (Role.CONTROL, Role.CYCLIC)
            and not (bits is not None and is_whole(bits, parameter)))


def settings_of(drive: Drive) -> tuple[str, ...]:
    """Return the names of all settings, in the order in which they are written back."""
    return in_order(drive, [name for name in drive.parameters if is_setting(drive, name)])


def in_order(drive: Drive, names: list[str]) -> tuple[str, ...]:
    """Sort names as the profile has them, then raw ones; what has bits of a mode comes last."""
    bits = mode_bits(drive.facts.restore)
    order = {name: place for place, name in enumerate(drive.parameters)}
    return tuple(sorted(names, key=lambda name: (name in bits, order.get(name, len(order)))))
