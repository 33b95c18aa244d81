# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What there is to be seen of bridge and drives at one moment: plain values, ready to be shown."""

from dataclasses import dataclass
import math
import time

from drive_can_bridge.core.parameters import Parameter, Value, ValueKind
from drive_can_bridge.core.session import DriveState

_DECIMALS_MAX = 6
_PAUSE = 0.0001


@dataclass(frozen=True)
class Shown:
    """
    A parameter with its value.

    :param text: value without unit; '' while there is none.
    :param width: characters that the longest possible value takes: columns never move.
    :param strong: the value counts: a setpoint is armed, an actual value is current.
    """

    name: str
    text: str
    unit: str
    width: int
    strong: bool = True


@dataclass(frozen=True)
class Bits:
    """The named bits of a parameter; None while nobody knows."""

    parameter: str
    states: tuple[tuple[str, bool | None], ...]


@dataclass(frozen=True)
class Times:
    """Mean since the start and 99th percentile of the last exchanges, in s."""

    mean: float = math.nan
    p99: float = math.nan


@dataclass(frozen=True)
class Trend:
    """The last values of one quantity, oldest first."""

    name: str = ''
    unit: str = ''
    samples: tuple[float, ...] = ()


@dataclass(frozen=True)
class DriveSnapshot:
    """
    One drive.

    :param answering: it exchanges process data.
    :param place: where it is, ``main, station 1``.
    :param control: state of its control word, '' without control.
    :param advice: while it does not answer: what to look at.
    :param rate: exchanges per second.
    :param trend: of its first physical quantity.
    """

    name: str
    state: DriveState
    answering: bool
    place: str
    control: str
    advice: str
    setpoints: tuple[Shown, ...]
    values: tuple[Shown, ...]
    bits: tuple[Bits, ...]
    rate: float
    exchanges: int
    missed: int
    period_error: Times
    latency: Times
    trend: Trend = Trend()


@dataclass(frozen=True)
class BusSnapshot:
    """One bus; ``load`` in percent."""

    name: str
    interface: str
    bitrate: int
    state: str
    load: float
    frames_sent: str
    frames_received: str
    frames_rejected: str


@dataclass(frozen=True)
class Snapshot:
    """
    Everything.

    :param uptime: s since the start.
    :param processor: share of one core that the process took lately.
    """

    drives: tuple[DriveSnapshot, ...]
    buses: tuple[BusSnapshot, ...]
    uptime: float
    processor: float


def show(parameter: Parameter, value: Value | None, *, strong: bool = True) -> Shown:
    """Write a value the way people read it: as many decimals as it has, bits as hexadecimal."""
    low, high = (parameter.value_from_raw(raw) for raw in parameter.type.raw_range)
    width = max(len(_number(parameter, end)) for end in (low, high))
    text = '' if value is None else _number(parameter, value)
    return Shown(parameter.name, text, parameter.unit, width, strong)


def as_assignment(parameter: Parameter, value: Value) -> str:
    """Write ``actual_speed=12.3 rpm``; integers as they are, for programs to read."""
    text = str(value) if parameter.kind is ValueKind.INTEGER else _number(parameter, value)
    return f'{parameter.name}={text}{f" {parameter.unit}" if parameter.unit else ""}'


def _number(parameter: Parameter, value: Value) -> str:
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if parameter.kind is ValueKind.DOUBLE:
        text = f'{value:.{_decimals(parameter)}f}'
        # what is rounded to nothing has no sign
        return text.removeprefix('-') if not float(text) else text
    if parameter.bits:
        word = parameter.word_from_raw(int(value))
        return f'0x{word:0{parameter.type.bits // 4}X}'
    return str(value)


def _decimals(parameter: Parameter) -> int:
    step = abs(parameter.scale)
    for decimals in range(_DECIMALS_MAX):
        scaled = step * 10 ** decimals
        if scaled >= 0.5 and math.isclose(scaled, round(scaled), rel_tol=1e-6):
            return decimals
    # no round number: three significant digits of a step
    return min(max(0, 2 - math.floor(math.log10(step))), _DECIMALS_MAX)


def give_way() -> None:
    """
    Let other threads have the interpreter; called between the steps of composing a page.

    A page takes some milliseconds, and for five of them Python makes nobody give way who does not
    want to: a cyclic frame would wait. A pause of length zero ends before the other thread is
    awake.
    """
    time.sleep(_PAUSE)
