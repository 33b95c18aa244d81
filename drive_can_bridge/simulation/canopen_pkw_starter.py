# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A motor starter with overload protection, and what its registers show.

Not a model of any real controller. It is there so that the registers of a TeSys T LTMR look
alive, belong together and react to what is commanded: an induction motor switched on directly,
with an inrush current, a load current and a thermal image that trips. Which register means what
is partly recollection; docs/protocol_canopen_pkw.md says how far it can be trusted.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
import math

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import ControlTable, Profile
from drive_can_bridge.protocols.canopen_pkw.object_map import register_of
from drive_can_bridge.simulation.control import Operation
from drive_can_bridge.simulation.plant import Plant
from drive_can_bridge.simulation.scales import RawRange
from drive_can_bridge.simulation.status import StatusWord

CONTROL_REGISTER_1 = 704
CONTROL_REGISTER_2 = 705
TRIP_CLASS = 606
FULL_LOAD_RATIO = 652
NODE_ADDRESS = 696

#: bits of control register 1
RUN_FORWARD, RUN_REVERSE, RESET = 1 << 0, 1 << 1, 1 << 3
#: bits of control register 2
CLEAR_ALL, CLEAR_THERMAL_LEVEL, CLEAR_SETTINGS = 1 << 0, 1 << 2, 1 << 3

#: what settings are in a new controller, by register
DEFAULTS = {TRIP_CLASS: 5, FULL_LOAD_RATIO: 33, 653: 33, 682: 0, 695: 0, 704: 0, 705: 0}
#: settings that take only multiples of something, by register
STEPS = {TRIP_CLASS: 5}

#: A; the largest full load current of the controller, and what the motor takes
CONTROLLER_CURRENT = 27.0
LOAD_CURRENT = 6.3
INRUSH_CURRENT = 45.0
#: s
INRUSH_TIME_CONSTANT = 0.4
START_TIME = 2.0
#: the motor may carry this share of its full load current for ever
SERVICE_FACTOR = 1.1
#: thermal image in s, per s of trip class: six times the full load current trips after the class
CLASS_FACTOR = -1.0 / math.log1p(-(SERVICE_FACTOR / 6.0) ** 2)
#: % of the thermal capacity
TRIP_LEVEL, ALARM_LEVEL, RESET_LEVEL = 100.0, 85.0, 75.0
#: longest step of the thermal image, s
STEP = 0.05

MAINS_VOLTAGE = 400.0
MAINS_FREQUENCY = 50.0
POWER_FACTOR = 0.85
#: share by which the mains swing, and how fast (rad/s)
MAINS_SWING = 0.005
MAINS_RATE = 2.0 * math.pi * 0.3

#: trip codes; a code's bit in the trip register is one lower
THERMAL_OVERLOAD, TEST_TRIP = 4, 10
NEVER = 9999


class StarterOperation(Operation):
    """
    Obeys single bits of the control word, unlike drives that know whole words.

    :ivar reverse: the contactor for the other direction is closed.
    """

    def __init__(self, table: ControlTable | None) -> None:
        self.reverse = False
        super().__init__(table)

    def power_on(self) -> None:
        """Begin anew: no trip, off."""
        super().power_on()
        self.enabled = self.reverse = False

    def word_written(self, word: int, now: float) -> None:
        """Obey a control word: run while one run bit is set, reset when its bit appears."""
        before, self._word = self._word or 0, word
        run = word & (RUN_FORWARD | RUN_REVERSE)
        if not run:
            self._blocked = False
        if self.faulted:
            if word & ~before & RESET and self.reset_allowed(now):
                self.faulted = False
            return
        self.enabled = run in (RUN_FORWARD, RUN_REVERSE) and not self._blocked
        self.reverse = run == RUN_REVERSE

    def reset_allowed(self, now: float) -> bool:
        """Tell whether the cause of a trip is gone."""
        return now >= self._cause_ends

    def prolong(self, until: float) -> None:
        """Take note that the cause lasts until some time at least."""
        self._cause_ends = max(self._cause_ends, until)

    def cause_gone(self) -> None:
        """Take note that the cause has been removed."""
        self._cause_ends = -math.inf

    def repair(self) -> None:
        """Clear a trip by hand; the motor stays off until it is commanded again."""
        self.faulted = False
        self.cause_gone()


class Starter:
    """
    The motor behind the contactor: currents and thermal image.

    :ivar current: A, mean of the three phases.
    :ivar thermal: % of the thermal capacity.
    """

    def __init__(self) -> None:
        self.thermal = 0.0
        self.full_load_current = CONTROLLER_CURRENT / 3.0
        self.time_constant = CLASS_FACTOR * 5.0
        self._on_for: float | None = None

    @property
    def current(self) -> float:
        """Mean current of the phases, in A."""
        if self._on_for is None:
            return 0.0
        inrush = INRUSH_CURRENT - LOAD_CURRENT
        return LOAD_CURRENT + inrush * math.exp(-self._on_for / INRUSH_TIME_CONSTANT)

    @property
    def ratio(self) -> float:
        """Current as a share of the full load current."""
        return self.current / self.full_load_current

    @property
    def starting(self) -> bool:
        """The motor was switched on a moment ago."""
        return self._on_for is not None and self._on_for < START_TIME

    @property
    def time_to_trip(self) -> float:
        """Time in s until this current would trip; infinity: never."""
        final = self._final_level
        if final <= TRIP_LEVEL:
            return math.inf
        if self.thermal >= TRIP_LEVEL:
            return 0.0
        return self.time_constant * math.log((final - self.thermal) / (final - TRIP_LEVEL))

    @property
    def time_to_reset(self) -> float:
        """Time in s until a motor that is off has cooled down enough."""
        if self.thermal <= RESET_LEVEL:
            return 0.0
        return self.time_constant * math.log(self.thermal / RESET_LEVEL)

    def settings(self, full_load_percent: float, trip_class: float) -> None:
        """Take the settings of the overload protection."""
        self.full_load_current = max(full_load_percent, 1.0) / 100.0 * CONTROLLER_CURRENT
        self.time_constant = CLASS_FACTOR * max(trip_class, 1.0)

    def switch(self, on: bool) -> None:
        """Close or open the contactor."""
        if not on:
            self._on_for = None
        elif self._on_for is None:
            self._on_for = 0.0

    def advance(self, duration: float) -> bool:
        """
        Let time pass.

        :return: the thermal capacity is used up.
        """
        steps = max(math.ceil(duration / STEP), 1)
        for _ in range(min(steps, 10_000)):
            step = duration / steps
            if self._on_for is not None:
                self._on_for += step
            self.thermal += (self._final_level - self.thermal) * -math.expm1(
                -step / self.time_constant)
            if self._on_for is not None and self.thermal >= TRIP_LEVEL:
                return True
        return False

    @property
    def _final_level(self) -> float:
        """Thermal level that the present current leads to."""
        return TRIP_LEVEL * (self.ratio / SERVICE_FACTOR) ** 2


class StarterPlant(Plant):
    """
    Registers and motor of a controller that the PKW mailbox reaches.

    A profile whose control word is register 704 is that of an LTMR: its read-only registers
    show a :class:`Starter`. Any other profile is played as that of any other drive.

    :param node: node-ID, shown by its register.
    """

    def __init__(self, profile: Profile, *, node: int, volatile: Collection[str] = (),
                 preferred: Sequence[str] = ()) -> None:
        control = profile.control
        word = profile.parameters.get(control.parameter) if control else None
        self.is_starter = word is not None and register_number(word) == CONTROL_REGISTER_1
        self.starter = Starter()
        self._node = node
        self._cause = 0
        self._by_register = {} if not self.is_starter else {
            register_number(p): p.name for p in profile.parameters.values()}
        super().__init__(profile, volatile=volatile, preferred=preferred)
        if self.is_starter:
            self.operation: Operation = StarterOperation(profile.control)
            self._settings_changed()

    # -- what the registers accept ----------------------------------------------------------------

    def allows(self, parameter: Parameter, raw: int) -> bool:
        """Tell whether a register takes a value: within its limits, and one of its steps."""
        if raw != self._range[parameter.name].clamp(raw):
            return False
        step = STEPS.get(register_number(parameter) or 0, 1) if self.is_starter else 1
        return raw % step == 0

    # -- time and events --------------------------------------------------------------------------

    @property
    def trip_code(self) -> int:
        """Code of the trip; 0 without one."""
        return self._cause if self.operation.faulted else 0

    def advance(self, now: float) -> None:
        """Let currents and temperature follow up to now."""
        last = now if self._now is None else self._now
        super().advance(now)
        if not self.is_starter:
            return
        self.starter.switch(self.operation.enabled)
        if self.starter.advance(max(now - last, 0.0)):
            self._cause = THERMAL_OVERLOAD
            self.operation.trip(now)
            self._starter_operation.prolong(now + self.starter.time_to_reset)
            self.starter.switch(False)

    def trip(self, duration: float = 0.0) -> None:
        """Trip as the test function of the controller does; the cause lasts for some seconds."""
        self._cause = TEST_TRIP
        super().trip(duration)
        self.starter.switch(False)

    def power_on(self) -> None:
        """Begin anew after a loss of power; the thermal image is kept."""
        super().power_on()
        self.starter.switch(False)
        if self.is_starter:
            self._settings_changed()

    # -- inside -----------------------------------------------------------------------------------

    @property
    def _starter_operation(self) -> StarterOperation:
        assert isinstance(self.operation, StarterOperation)
        return self.operation

    def _initial(self, parameter: Parameter) -> int:
        default = DEFAULTS.get(register_number(parameter) or 0) if self.is_starter else None
        if default is None or parameter.name == self._control_name:
            return super()._initial(parameter)
        return self._range[parameter.name].clamp(default)

    def _store(self, name: str, raw: int) -> None:
        before = self._raw[name]
        super()._store(name, raw)
        if not self.is_starter:
            return
        if name == self._by_register.get(CONTROL_REGISTER_2):
            self._clear(raw & ~before)
        self._settings_changed()
        self.starter.switch(self.operation.enabled)

    def _clear(self, bits: int) -> None:
        """Obey the clear commands whose bits have appeared."""
        if bits & (CLEAR_ALL | CLEAR_THERMAL_LEVEL):
            self.starter.thermal = 0.0
            self._starter_operation.cause_gone()
        if bits & (CLEAR_ALL | CLEAR_SETTINGS):
            for register in (TRIP_CLASS, FULL_LOAD_RATIO, 653):
                name = self._by_register.get(register)
                if name is not None:
                    self._raw[name] = self._initial(self.parameters[name])

    def _settings_changed(self) -> None:
        self.starter.settings(self._setting(FULL_LOAD_RATIO), self._setting(TRIP_CLASS))

    def _setting(self, register: int) -> int:
        name = self._by_register.get(register)
        return DEFAULTS[register] if name is None else self._raw[name]

    def _source(self, parameter: Parameter) -> Callable[[], int] | None:
        shown = self._shown(parameter) if self.is_starter else None
        if shown is None:
            return super()._source(parameter)
        span = RawRange(parameter, limits=False)
        figure = shown
        return lambda: span.clamp(math.floor(figure() + 0.5))

    def _shown(self, parameter: Parameter) -> Callable[[], float] | None:
        """Return what gives the content of a register; None for a plain one."""
        register = register_number(parameter)
        if register == 455:
            # the profile's own conditions are met in addition, whatever its bits are called
            word = StatusWord(replace(parameter, bits=()), self.control)
            return lambda: word.compose(self._state(), self._status())
        starter = self.starter
        figures: dict[int, Callable[[], float]] = {
            450: lambda: math.ceil(self._wait_time()),
            451: lambda: self.trip_code,
            452: lambda: _bit_of(self.trip_code),
            453: lambda: 0,
            456: lambda: 0,
            457: lambda: 0,
            458: self._outputs,
            459: self._outputs,
            460: lambda: THERMAL_OVERLOAD if self._alarm() else 0,
            461: lambda: _bit_of(THERMAL_OVERLOAD) if self._alarm() else 0,
            462: lambda: 0,
            463: lambda: 0,
            465: lambda: starter.thermal,
            466: lambda: 100.0 * starter.ratio,
            467: lambda: 101.0 * starter.ratio,
            468: lambda: 99.0 * starter.ratio,
            469: lambda: 100.0 * starter.ratio,
            470: lambda: 0,
            471: lambda: 1 if starter.current else 0,
            472: lambda: 32.0 + 0.1 * starter.thermal,
            474: lambda: 100.0 * MAINS_FREQUENCY,
            475: lambda: 10.0 * (100.0 + 0.8 * starter.thermal),
            476: self._voltage,
            477: lambda: 0.998 * self._voltage(),
            478: lambda: 1.002 * self._voltage(),
            479: self._voltage,
            481: lambda: 100.0 * POWER_FACTOR if starter.current else 0,
            482: lambda: self._power(POWER_FACTOR),
            483: lambda: self._power(math.sqrt(1.0 - POWER_FACTOR ** 2)),
            500: lambda: 100.0 * starter.current,
            502: lambda: 101.0 * starter.current,
            504: lambda: 99.0 * starter.current,
            506: lambda: 100.0 * starter.current,
            508: lambda: 0,
            511: lambda: min(starter.time_to_trip, NEVER),
            NODE_ADDRESS: lambda: self._node,
        }
        return None if register is None else figures.get(register)

    def _status(self) -> int:
        """Return system status register 1."""
        operation, ratio = self._starter_operation, self.starter.ratio
        bits = (
            not operation.faulted,
            operation.enabled,
            operation.faulted,
            self._alarm(),
            operation.faulted,
            operation.faulted and operation.reset_allowed(self._now or 0.0),
            True,
            ratio > 0.1,
        )
        word = sum(1 << number for number, wanted in enumerate(bits) if wanted)
        word |= min(math.floor(32.0 * ratio + 0.5), 63) << 8
        return word | (1 << 15 if self.starter.starting else 0)

    def _outputs(self) -> int:
        operation = self._starter_operation
        if not operation.enabled:
            return 0
        return 1 << 1 if operation.reverse else 1 << 0

    def _alarm(self) -> bool:
        return self.starter.thermal >= ALARM_LEVEL

    def _wait_time(self) -> float:
        return self.starter.time_to_reset if self.operation.faulted else 0.0

    def _voltage(self) -> float:
        return MAINS_VOLTAGE * (1.0 + MAINS_SWING * math.sin(MAINS_RATE * (self._now or 0.0)))

    def _power(self, share: float) -> float:
        """Return a power in 0.1 kW."""
        return math.sqrt(3.0) * MAINS_VOLTAGE * self.starter.current * share / 100.0


def register_number(parameter: Parameter) -> int | None:
    """Return the register of a parameter, by its number or by its CANopen address."""
    if parameter.number is not None:
        return parameter.number
    if parameter.index is None:
        return None
    return register_of(parameter.index, parameter.subindex or 0)


def _bit_of(code: int) -> int:
    """Return the bit of a trip code in its register; codes from 17 on stand in the next one."""
    return 1 << code - 1 if 1 <= code <= 16 else 0
