# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The checked configuration, as the rest of the program receives it.

Times are seconds. Everything in here has passed every check and is not checked again. A
joint has SI units: angles in rad, speeds in rad/s; effort stays in the profile's unit.
"""

from dataclasses import dataclass, field
from enum import Enum
import math
from typing import Any

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.core.text import printable


@dataclass(frozen=True)
class BusConfiguration:
    """
    One CAN bus.

    :param interface: python-can interface name.
    :param channel: as the interface wants it; digits stay a string unless given as an integer.
    :param bitrate: bit/s.
    :param adapter: which one it is, by its name in docs/adapters.md; '': as can be seen.
    :param reconnect_period: s between attempts to open a lost bus.
    :param trace_seconds: s that the flight recorder keeps; 0: it is off.
    :param trace_directory: where its traces go; '': the default.
    :param trace_files: how many of them are kept.
    :param options: every other key, handed to python-can as it is.
    """

    name: str
    interface: str
    channel: str | int
    bitrate: int = 125_000
    adapter: str = ''
    reconnect_period: float = 1.0
    trace_seconds: float = 0.0
    trace_directory: str = ''
    trace_files: int = 20
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def place(self) -> str:
        """The bus as shown to people, printable: ``slcan /dev/ttyACM0``."""
        return printable(f'{self.interface} {self.channel}')

    @property
    def wire(self) -> str:
        """Equal for two entries that are certainly the same bus; an option may name an adapter."""
        return f'{self.interface} {self.channel} {sorted(self.options.items())}'


@dataclass(frozen=True)
class JointConfiguration:
    """
    The ``joint`` section of a drive: which parameters are a joint's quantities.

    The ``…_factor`` fields convert a physical value in the profile's unit into the joint's SI
    value: ``si = value * factor`` (gear ratio, pole pairs and unit are in it).

    :param continuous: the axis turns on and on, and its position counter wraps: true: at the width
        of its type; a number: after so many raw steps.
    """

    name: str
    position: str | None = None
    velocity: str | None = None
    effort: str | None = None
    position_command: str | None = None
    velocity_command: str | None = None
    effort_command: str | None = None
    gear_ratio: float = 1.0
    pole_pairs: int = 1
    continuous: bool | int = False
    #: parameter name -> factor, for every parameter named above
    factors: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class DriveConfiguration:
    """
    One drive on a bus.

    :param cyclic_request: parameters sent each cycle, in slot order (control word included where
        the configuration lists it).
    :param cyclic_response: parameters received each cycle, in slot order.
    :param options: the keys that only this protocol family has: its own frozen dataclass.
    :param profile_key: the profile as the configuration names it.
    """

    name: str
    bus: str
    protocol: str
    station: int
    profile: Profile
    period: float = 0.02
    cyclic_request: tuple[Parameter, ...] = ()
    cyclic_response: tuple[Parameter, ...] = ()
    missed_limit: int = 3
    command_timeout: float = 0.5
    rearm_immediate: bool = False
    parameter_timeout: float = 0.1
    parameter_retries: int = 2
    verify_writes: bool = True
    control_timeout: float = 2.0
    joint: JointConfiguration | None = None
    options: Any = None
    profile_key: str = ''


@dataclass(frozen=True)
class BridgeConfiguration:
    """
    Everything one bridge process does.

    :param joint_state_rate: Hz of the message with all joints; 0: there is none.
    :param memory_limit_mb: MB beside what is in use when the bridge becomes active; 0: no limit.
    :param warnings: readable lines about what is allowed but suspicious (bus load over 70 %,
        a key that the adapter does not know).
    :param standard: parameters of ROS itself that stand beside ours, as they were read.
    """

    autostart: bool = True
    diagnostics_period: float = 1.0
    joint_state_rate: float = 50.0
    memory_limit_mb: int = 1024
    buses: dict[str, BusConfiguration] = field(default_factory=dict)
    drives: dict[str, DriveConfiguration] = field(default_factory=dict)
    profile_directories: tuple[str, ...] = ('',)
    warnings: tuple[str, ...] = ()
    standard: dict[str, Any] = field(default_factory=dict)


class JointQuantity(Enum):
    """A quantity of a joint."""

    POSITION = 'position'
    VELOCITY = 'velocity'
    EFFORT = 'effort'


#: an electrical frequency; divided by the pole pairs it is a speed of the shaft
ELECTRICAL_FREQUENCY = 'Hz'

_FACTORS: dict[JointQuantity, dict[str, float]] = {
    JointQuantity.POSITION: {
        'rad': 1.0,
        'deg': math.pi / 180.0,
        'rev': 2.0 * math.pi,
    },
    JointQuantity.VELOCITY: {
        'rad/s': 1.0,
        'deg/s': math.pi / 180.0,
        'rpm': 2.0 * math.pi / 60.0,
        ELECTRICAL_FREQUENCY: 2.0 * math.pi,
    },
}


def convertible_units(quantity: JointQuantity) -> tuple[str, ...]:
    """Return the units that convert; empty for effort, where every unit passes as it is."""
    return tuple(_FACTORS.get(quantity, ()))


def si_factor(quantity: JointQuantity, unit: str, *, gear_ratio: float = 1.0,
              pole_pairs: int = 1) -> float | None:
    """
    Return the factor from a motor's value in ``unit`` to the joint's SI value.

    :param unit: unit as written in the profile.
    :param gear_ratio: motor turns per turn of the joint; not zero, negative reverses.
    :param pole_pairs: of the motor; only an electrical frequency is divided by them.
    :return: the factor, or None where the unit does not convert.
    """
    if quantity is JointQuantity.EFFORT:
        return 1.0
    factor = _FACTORS[quantity].get(unit)
    if factor is None:
        return None
    if unit == ELECTRICAL_FREQUENCY:
        factor /= pole_pairs
    return factor / gear_ratio
