# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What is behind the registers of a simulated drive, whatever protocol it speaks.

A family chooses a plant when a drive is made; its maker may bring another one:
``Simulation(configuration, plants={'lift': MyPlant})``, for instance derived from
:class:`~.motor_plant.MotorPlant`.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.simulation.control import Operation


class Refusal(Enum):
    """Why a write is refused, where a protocol can say so; one kind is acknowledged instead."""

    READ_ONLY = 'read-only'
    OUT_OF_RANGE = 'out of range'
    CROSSED = 'minimum above maximum'
    FORBIDDEN = 'a scripted fault'
    TOO_EARLY = 'another parameter has to be written first'
    UNTOLD = 'nobody is told, the value stays'


class Plant(Protocol):
    """
    A motor, or whatever a drive moves. Time is an argument and never runs backwards.

    :ivar operation: the operating state.
    :ivar volatile: names of further parameters that a loss of power resets.
    """

    operation: Operation
    volatile: Collection[str] = ()

    def initial(self, parameter: Parameter) -> int:
        """Return what a new drive has in a register, where its limits allow it."""

    def source(self, parameter: Parameter) -> Callable[[], int] | None:
        """Return what computes a read-only register; None: it is plain memory."""

    def refusal(self, parameter: Parameter, raw: int) -> Refusal | None:
        """Say why a register does not take a value within its limits now; None: it does."""

    def written(self, name: str, before: int, raw: int) -> None:
        """React to a register that was written."""

    def advance(self, now: float) -> None:
        """Move up to now, and let the clock of the operating state go with it."""

    def power_off(self) -> None:
        """Note that power is lost."""

    def power_on(self) -> None:
        """Begin anew; the registers have what EEPROM kept."""


@dataclass(frozen=True, slots=True)
class Mechanics:
    """
    What a motor of a simulated drive has to carry, and how exactly its position is measured.

    :param load: share of the rated torque with which a weight pulls it backwards. Without torque,
        and without a brake, it sinks, at full load with a tenth of its rated speed.
    :param noise: raw steps by which a measured position is off at most, either way.
    :param brake: 1: closed whenever there is no torque.
    """

    load: float = 0.0
    noise: int = 0
    brake: int = 0

    @classmethod
    def parse(cls, text: str) -> 'Mechanics':
        """
        Read ``load=0.3,noise=1,brake=1``; what is left out is 0.

        :raises ValueRefused: says what is allowed.
        """
        highest = {'load': 1.0, 'noise': 100, 'brake': 1}
        given: dict[str, float] = {}
        for part in text.split(','):
            key, _, value = map(str.strip, part.partition('='))
            try:
                given[key] = type(highest[key])(value)
                # not a number is neither below nor above
                if not 0 <= given[key] <= highest[key]:
                    raise ValueError
            except (KeyError, ValueError):
                allowed = ', '.join(f'{name}=0…{most:g}' for name, most in highest.items())
                raise ValueRefused(f"'{part.strip()}' is not possible; allowed: {allowed}",
                                   ) from None
        return cls(**given)  # type: ignore[arg-type]  # each has the type of its range
