# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the rest of the program asks of a protocol family.

Configuration checks, the exchange and the ROS side know families only through this interface and
through the row in :mod:`drive_can_bridge.protocols.families`.

The keys that only one family has are a frozen dataclass: the one place that knows type, default,
limits and meaning of a key. JSON Schema and the parameters of the node are made from it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, Field, field, fields
from functools import cached_property
from types import MappingProxyType
from typing import Any, get_args, get_origin, Literal, NamedTuple

from drive_can_bridge.core import complaints
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Route
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.observer import DriveObserver, Emit
from drive_can_bridge.protocols.scanner import Prober, Scanner

_TYPES = {bool: 'boolean', int: 'integer', float: 'number'}
#: several of them, in order
IntegerList = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class FamilyOptions:
    """What stands there for a family that has no keys of its own."""


def option(default: Any, description: str, *, minimum: float | None = None,
           maximum: float | None = None) -> Any:
    """
    Describe a key; the annotation of the field gives its type.

    :param default: None where it depends on the station, see ``Family.make_options``.
    """
    limits = {'minimum': minimum, 'maximum': maximum}
    return field(default=default, metadata={
        'description': description,
        **{key: limit for key, limit in limits.items() if limit is not None}})


def options_schema(options: type[Any]) -> dict[str, Any]:
    """Return the JSON Schema properties of the keys, the family's own before shared ones."""
    ordered = sorted(fields(options), key=lambda entry: entry.name not in options.__annotations__)
    return {entry.name: _schema(entry) for entry in ordered}


def _schema(entry: 'Field[Any]') -> dict[str, Any]:
    description, *limits = entry.metadata.items()
    schema: dict[str, Any] = dict([description])
    if get_origin(entry.type) is Literal:
        schema['enum'] = list(get_args(entry.type))
        schema.update(limits)
    elif entry.type == IntegerList:
        schema.update(type='array', items={'type': 'integer', **dict(limits)})
    else:
        schema['type'] = _TYPES[entry.type]  # type: ignore[index]
        schema.update(limits)
    if entry.default is not None:
        default = entry.default
        schema['default'] = list(default) if isinstance(default, tuple) else default
    return schema


def make_options(options: type[Any], given: Mapping[str, Any]) -> Any:
    """Make the options from values that fit the schema; an integer is accepted for a number."""
    makers = {entry.name: float if entry.type is float else tuple for entry in fields(options)
              if entry.type in (float, IntegerList)}
    return options(**{key: makers[key](value) if key in makers else value
                      for key, value in given.items()})


class Complaint(NamedTuple):
    """
    A problem that a family finds in a drive's configuration.

    :param key: key below the drive (``station``, ``cyclic_request``), or '' for the drive itself.
    :param message: what is wrong and what is allowed.
    """

    key: str
    message: Sentence


def out_of_range(key: str, value: int, least: int, most: int,
                 remark: str = '') -> Iterator[Complaint]:
    """Yield what is wrong with a number that is not within its limits."""
    if not least <= value <= most:
        yield Complaint(key, complaints.value_out_of_range(
            value=value, least=least, most=most, remark=remark))


class Claim(NamedTuple):
    """
    Identifiers that a drive uses on its bus, and what for.

    Two claims collide when some identifier matches both, unless both carry the same non-empty
    ``shared`` mark (a broadcast identifier is shared on purpose).

    :param heard: frames of others on it are for the session; False: the bus counts them, as
        frames that nobody should send.
    :param once: what is shared is sent to all by the exchange of the bus: no other may, too.
    """

    route: Route
    purpose: str
    shared: str = ''
    heard: bool = True
    once: bool = False

    def overlaps(self, other: 'Claim') -> bool:
        """Return whether an identifier exists that both claim."""
        common = self.route.mask & other.route.mask
        return (self.route.extended == other.route.extended
                and (self.route.identifier ^ other.route.identifier) & common == 0
                and not (self.shared and self.shared == other.shared))

    def rivals(self, other: 'Claim') -> bool:
        """Return whether two exchanges would send broadcasts that the drives of both obey."""
        return (self.once and other.once and self.shared == other.shared
                and self.route.extended == other.route.extended)


@dataclass(frozen=True, slots=True)
class ScanEntry:
    """
    What ``scan -o`` writes for a drive of the family.

    :param kind: what it is called, in front of its station.
    :param profile: a shipped one; '': a table of raw numbers, beside the file.
    :param request: in ``cyclic_request`` and, ``response``, in ``cyclic_response``: what all
        drives of the family know.
    """

    kind: str = 'drive'
    profile: str = ''
    request: tuple[str, ...] = ()
    response: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ImportRules:
    """
    What ``profile import`` and ``profile check`` know of the family.

    :param choices: options that change which entries it can carry: one of them has to do.
    :param elements: parameters with a ``number`` may have a ``subindex``.
    :param eds_objects: what an EDS file has if it is of such a drive, and of no other; None: its
        drives have no EDS files.
    :param eds_profile: the shipped profile that says what those objects mean; '': none does.
    """

    choices: tuple[Mapping[str, Any], ...] = ({},)
    elements: bool = True
    eds_objects: tuple[int, ...] | None = None
    eds_profile: str = ''


class ModeKey(NamedTuple):
    """
    The drive key ``mode``.

    :param names: its values, by the numbers that drives have for them.
    :param setpoints: names of the setpoints of all modes in profiles.
    """

    names: Mapping[int, str]
    setpoints: tuple[str, ...]


class FamilyParts(NamedTuple):
    """Makes session, observer, scanner and prober of a family."""

    session: Callable[[DriveConfiguration], Session]
    observer: Callable[[DriveConfiguration, Emit], DriveObserver]
    scanner: Callable[[], Scanner]
    prober: Callable[[DriveConfiguration], Prober]


class Family(ABC):
    """One protocol family."""

    #: value of the drive key ``protocol``
    name: str
    #: has a cyclic service of its own (False: the exchange is emulated by polling)
    cyclic: bool
    #: knows control and status word by itself; profiles have no ``control`` section
    control_built_in: bool = False
    #: names of what is built in and published like the parameters of a profile
    builtin_names: frozenset[str] = frozenset()
    #: bits of the types that its parameters may have
    widths: frozenset[int] = frozenset((16, 32))
    #: the keys that only this family has: a frozen dataclass
    options_type: type[Any] = FamilyOptions
    #: keys that all families have, but whose default is another one here
    drive_defaults: Mapping[str, Any] = MappingProxyType({})
    #: None: there is no such key
    mode_key: ModeKey | None = None
    #: its drives are CANopen nodes, their stations Node-IDs
    on_canopen: bool = False
    #: keys that ``probe`` settles
    probed: tuple[str, ...] = ()
    scan_entry: ScanEntry = ScanEntry()
    import_rules: ImportRules = ImportRules()

    @cached_property
    def options_schema(self) -> dict[str, Any]:
        """JSON Schema properties of the keys that only this family has."""
        return options_schema(self.options_type)

    def make_options(self, station: int, given: Mapping[str, Any]) -> Any:
        """
        Make the options of a drive.

        :param given: values that fit the schema; the others get their defaults.
        """
        return make_options(self.options_type, given)

    @abstractmethod
    def check(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        """Yield everything that this family cannot do with the drive as configured."""

    def check_widths(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        """Yield what the profile has of types that this family does not."""
        allowed = ', '.join(kind.value for kind in ParameterType if kind.bits in self.widths)
        for name, parameter in drive.profile.parameters.items():
            if parameter.type.bits not in self.widths:
                yield Complaint(f'profile.parameters.{name}.type', (
                    complaints.no_such_type(
                        type=parameter.type.value, family=self.name, allowed=allowed)))

    def check_names(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        """Yield what the profile calls like something that is built in."""
        for name, parameter in drive.profile.parameters.items():
            place = f'profile.parameters.{name}'
            for key, taken in ((place, name), *(
                    (f'{place}.bits.{bit}', bit) for bit, _ in parameter.bits)):
                if taken in self.builtin_names:
                    yield Complaint(key, complaints.built_in(name=taken, family=self.name))

    def check_together(self, drives: Sequence[DriveConfiguration],
                       ) -> Iterator[tuple[DriveConfiguration, Complaint]]:
        """Yield what drives of this family on one bus cannot do together, each at its drive."""
        yield from ()

    def warnings(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        """Yield what is allowed but suspicious."""
        yield from ()

    def shortest_period(self, drive: DriveConfiguration, bitrate: int) -> float:
        """
        Return the shortest ``period`` that the exchange fits into, in s; 0: any.

        Polled families have one: the sum of all frame times of a round at this bit rate.
        """
        return 0.0

    @abstractmethod
    def claims(self, drive: DriveConfiguration) -> list[Claim]:
        """Return all identifiers of the drive on its bus, both directions."""

    def reserved(self, drive: DriveConfiguration) -> list[Claim]:
        """Return identifiers that others must keep off, though the bridge does not use them."""
        return []

    def overheard(self, drive: DriveConfiguration) -> list[Route]:
        """
        Return identifiers, each alone, on which another master may command several drives.

        The drive may obey, so that its session hears what others send there; no drive claims them.
        """
        return []

    @abstractmethod
    def bits_per_second(self, drive: DriveConfiguration) -> float:
        """Return the worst-case bus load of the drive's exchange (maximal bit stuffing)."""

    def loads(self, drives: Sequence[DriveConfiguration]) -> list[float]:
        """
        Return ``bits_per_second`` of all drives of this family on one bus, in the same order.

        Families whose drives share frames say here how little that costs.
        """
        return [self.bits_per_second(drive) for drive in drives]

    @abstractmethod
    def raw_parameter(self, drive: DriveConfiguration, name: str) -> Parameter | None:
        """
        Resolve a raw parameter name (``p30``, ``p613.5``, ``x2004.10``).

        :return: an unlisted parameter that reads as an unsigned integer, or None where the name
            is not a raw name of this family.
        """

    def is_command(self, parameter: Parameter) -> bool:
        """
        Return whether a parameter is a command whatever the mode of the drive, and no setting.

        A setpoint of another mode moves the drive as soon as it is in that mode.
        """
        return False

    def supervision(self, drive: DriveConfiguration) -> Parameter | None:
        """
        Return what is not 0 in a drive that faults when telegrams end.

        Who only asks a few questions should know that.
        """
        return None

    def enabled_status(self, drive: DriveConfiguration,
                      ) -> tuple[Parameter, Callable[[int], bool]] | None:
        """Return the parameter that shows whether a drive is enabled, and a test of it."""
        control = drive.profile.control
        status = control and control.status_parameter and drive.profile.parameters.get(
            control.status_parameter)
        if control is None or control.enabled is None or not status:
            return None
        return status, control.enabled.matches

    def scan_keys(self, taken: Collection[int]) -> dict[str, Any]:
        """
        Return further drive keys for the file of a scan.

        :param taken: Node-IDs on the bus.
        """
        return {}

    def profile_remark(self, entries: Iterable[Mapping[str, Any]]) -> str:
        """Return which keys drives need that have a profile of these entries; '' for none."""
        return ''

    # -- who talks and listens --------------------------------------------------------------------

    @abstractmethod
    def parts(self) -> FamilyParts:
        """Import session, observer, scanner, prober: checks of a configuration need none."""

    def make_session(self, drive: DriveConfiguration) -> Session:
        """Make the session of a drive that is alone. Nothing is sent before ``activate``."""
        return self.make_sessions([drive])[0]

    def make_sessions(self, drives: Sequence[DriveConfiguration]) -> list[Session]:
        """Make the sessions of all drives of this family on one bus, in the same order."""
        return [self.parts().session(drive) for drive in drives]

    def make_observers(self, drives: Sequence[DriveConfiguration], emit: Emit,
                       ) -> list[DriveObserver]:
        """
        Make what watches the drives of this family on one bus.

        :param emit: takes every telegram.
        :return: one for each drive, in the same order; then those of frames that are of no drive
            in particular, whose name is ''.
        """
        return [self.parts().observer(drive, emit) for drive in drives]

    def make_scanner(self) -> Scanner:
        """Make the scanner for drives of this family on a bus without a parameter file."""
        return self.parts().scanner()

    def make_prober(self, drive: DriveConfiguration) -> Prober:
        """Make what settles the open keys of a drive by harmless reads."""
        return self.parts().prober(drive)
