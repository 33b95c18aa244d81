# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The parameter table of a drive type, and how its control and status words are used."""

from dataclasses import dataclass, field

from drive_can_bridge.core.parameters import Parameter


@dataclass(frozen=True)
class StatusPattern:
    """A condition on the status word: ``raw & mask == value``."""

    mask: int
    value: int

    def matches(self, raw: int) -> bool:
        """Return whether a status word fulfils the condition."""
        return raw & self.mask == self.value


@dataclass(frozen=True)
class ControlTable:
    """
    The ``control`` section of a profile.

    :param parameter: name of the parameter that carries the control word.
    :param disable: control word that keeps the drive without torque; sent from the start.
    :param enable: control word that lets it run.
    :param quick_stop: None where the drive has none.
    :param reset_fault: None where the drive has none.
    :param status_parameter: name of the parameter that carries the status word, or None.
    :param running: the drive does not stand still yet; None: the same as ``enabled``.
    :param reaction: there is a fault, but it cannot be reset yet; None: it always can.
    :param braking: a quick stop is under way; None: the status word does not report it.
    """

    parameter: str
    disable: int
    enable: int
    quick_stop: int | None = None
    reset_fault: int | None = None
    status_parameter: str | None = None
    ready: StatusPattern | None = None
    enabled: StatusPattern | None = None
    fault: StatusPattern | None = None
    running: StatusPattern | None = None
    reaction: StatusPattern | None = None
    braking: StatusPattern | None = None


@dataclass(frozen=True, slots=True)
class FaultTable:
    """
    The ``fault`` section of a profile: which fault it is.

    :param parameter: name of the parameter that carries the number.
    :param codes: names of faults, (raw integer, name).
    :param bit: (parameter, mask): reports a fault where there is no control section.
    """

    parameter: str
    codes: tuple[tuple[int, str], ...] = ()
    bit: tuple[str, int] | None = None


@dataclass(frozen=True, slots=True)
class RestoreStep:
    """
    One write around a restored backup: ``word = (word read & ~mask) | bits``.

    :param parameter: name of the parameter.
    :param bits: what to write where the mask has ones.
    :param mask: all ones of the type for a whole value, which needs no reading first.
    """

    parameter: str
    bits: int
    mask: int


@dataclass(frozen=True, slots=True)
class RestoreTable:
    """
    The ``restore`` section of a profile.

    :param before: written in this order before the settings of a backup.
    :param after: written in this order afterwards, whether they were written or not.
    """

    before: tuple[RestoreStep, ...] = ()
    after: tuple[RestoreStep, ...] = ()

    def ends_mode(self, name: str, word: int) -> bool:
        """Return whether a write takes the drive out of the mode for settings."""
        return any(step.parameter == name and word & step.mask == step.bits for step in self.after)


@dataclass(frozen=True)
class Profile:
    """
    The description of a drive type.

    :param name: file name without ``.yaml``.
    :param path: where it was read from.
    :param protocols: the families the drive type speaks.
    :param parameters: the table, in the order of the file, by name.
    :param identity: names of the parameters that identify one drive among others of its type.
    :param sha256: of the file, hexadecimal.
    """

    name: str
    path: str
    description: str
    protocols: tuple[str, ...]
    parameters: dict[str, Parameter] = field(default_factory=dict)
    control: ControlTable | None = None
    identity: tuple[str, ...] = ()
    restore: RestoreTable = RestoreTable()
    fault: FaultTable | None = None
    sha256: str = ''
