# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Drives for people and scripts: parameters with names, units and reasons.

There are two ways to the drives with the same interface: directly on the buses of a parameter
file, and through a running bridge (see :func:`drive_can_bridge.client.open_drives`).

.. code-block:: python

    with open_drives('robot.yaml') as drives:
        outcome = drives['conveyor'].read('ramp_time')['ramp_time']
        print(outcome.value if outcome.ok else outcome.reason)

Whatever depends on the drive itself ends in an *outcome*, one for each name, never
in an exception. Exceptions are for what ends the whole conversation: another master, a lost bus, a
bridge that is gone, all of them :class:`~drive_can_bridge.core.errors.DriveCanError`.

:func:`~drive_can_bridge.client.find_source` gives names before anything is opened, which is what
commands need that have to know which drive is meant:

.. code-block:: python

    find_source(params_file=None, *, namespace=None, nmt_start=False) -> Source
    open_drives(params_file=None, *, only=('*',), namespace=None, nmt_start=False) -> Drives
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Protocol, TYPE_CHECKING

from drive_can_bridge.core import sentences
from drive_can_bridge.core.directory import contradictions, ParameterDirectory
from drive_can_bridge.core.errors import DriveCanError, ValueRefused
from drive_can_bridge.core.parameters import Parameter, Value
from drive_can_bridge.core.requests import FailureKind
from drive_can_bridge.core.roles import Role
from drive_can_bridge.process.critical_sections import finish_first

if TYPE_CHECKING:   # read through a bridge it is not needed
    from drive_can_bridge.core.profile import RestoreTable

#: of a write under way when the conversation ended, and of those that were to follow
NOT_CONFIRMED = sentences.write_not_confirmed()
ENDED_BEFORE = 'ended before'


class Enabled(Enum):
    """Whether a drive may move by command of its master."""

    YES = 'enabled'
    NO = 'not enabled'
    UNKNOWN = 'unknown'


@dataclass(frozen=True, slots=True)
class ReadOutcome:
    """
    The outcome of reading one parameter.

    :param name: as it was asked for.
    :param parameter: None where the name is unknown.
    :param raw: integer read by the parameter's type; None where reading failed.
    :param value: in the unit of the parameter; None where reading failed.
    :param reason: why it failed, in words; '' where it did not.
    :param kind: why it failed, for programs; None where it did not.
    """

    name: str
    parameter: Parameter | None = None
    raw: int | None = None
    value: Value | None = None
    reason: str = ''
    kind: FailureKind | None = None

    @property
    def ok(self) -> bool:
        """Whether there is a value."""
        return self.raw is not None

    @property
    def unheard(self) -> bool:
        """Whether it failed, and no frame of the drive came."""
        return self.kind is not None and self.kind.unheard

    @property
    def absent(self) -> bool:
        """Whether the drive reports that it has no such parameter."""
        return self.kind is FailureKind.ABSENT


@dataclass(frozen=True, slots=True)
class WriteOutcome:
    """
    The outcome of writing one parameter.

    :param ok: acknowledged by the drive, or read back; or sent, where ``reason`` notes that
        nothing more is known (``verify_writes: false``).
    :param reason: why it failed, in words; or that note.
    :param trouble: what ended the conversation during the write: whether the drive
        has the value is unknown; None: nothing.
    :param kind: why it failed, for programs; None where it did not.
    """

    name: str
    ok: bool
    parameter: Parameter | None = None
    reason: str = ''
    trouble: DriveCanError | None = None
    kind: FailureKind | None = None

    @property
    def unheard(self) -> bool:
        """Whether it failed, and no frame of the drive came: it may still have the value."""
        return self.kind is not None and self.kind.unheard

    @classmethod
    def under_way(cls, name: str, parameter: Parameter, trouble: DriveCanError) -> 'WriteOutcome':
        """Return the outcome of a write under way when the conversation ended."""
        return cls(name, False, parameter, NOT_CONFIRMED, trouble, FailureKind.UNAVAILABLE)


@dataclass(frozen=True, slots=True)
class DriveFacts:
    """
    What is known of a drive without asking it.

    :param protocol: name of the family.
    :param profile: name or path, as the configuration has it.
    :param profile_sha256: of the profile's file, hexadecimal.
    :param restore: the ``restore`` section of the profile; None: not known (a bridge of another
        version).
    :param through: full name of the bridge that the drive is reached through; '': directly.
    :param persist_writes: what has no ``storage`` in the profile survives the loss of power.
    """

    name: str
    bus: str
    interface: str
    channel: str
    bitrate: int
    protocol: str
    station: int
    profile: str
    profile_sha256: str
    restore: 'RestoreTable | None'
    through: str = ''
    persist_writes: bool = True


class Drive(ABC):
    """
    One drive: the interface of both ways.

    Calls block until everything is done. They are for one thread.

    :param find_facts: returns what is known of it; called at the first use.
    :ivar name: of the drive in the configuration.
    """

    def __init__(self, name: str, find_facts: Callable[[], DriveFacts],
                 directory: ParameterDirectory) -> None:
        self.name = name
        self._find_facts = find_facts
        self._directory = directory

    def __repr__(self) -> str:
        return f'<Drive {self.name}>'

    @cached_property
    def facts(self) -> DriveFacts:
        """
        What is known of the drive without asking it.

        :raises DriveCanError: its bridge does not answer.
        """
        return self._find_facts()

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """
        The parameters that the profile lists, by name, in its order.

        Limits (``minimum``, ``maximum``) that come through a bridge are those in effect: where the
        profile has none, the range of the type.
        """
        return self._directory.listed

    @property
    def readable_names(self) -> list[str]:
        """
        The names that ``read`` reads when none is given.

        What exists in process data only can be read only while these are received: through a
        bridge, where they are mapped.
        """
        return [name for name, parameter in self.parameters.items() if parameter.readable and (
            parameter.number is not None or parameter.index is not None
            or self.facts.through and not parameter.writable and self.role(name) is Role.CYCLIC)]

    def find(self, name: str) -> Parameter | None:
        """Return a parameter by profile name or raw name; None if there is no such thing."""
        return self._directory.find(name)

    @abstractmethod
    def role(self, name: str) -> Role | None:
        """
        Return what a bridge uses a parameter for itself; None: nothing, or an unknown name.

        What is ``CONTROL`` or ``CYCLIC`` and writable cannot be written here either way; ``MAP``
        only directly.
        """

    def check(self, name: str, value: object) -> str:
        """
        Return why a value cannot be written, without asking the drive; '' if nothing is known.

        Unknown name, read-only, wrong type, out of range, a setpoint, a control word.
        """
        parameter = self.find(name)
        if parameter is None:
            return self._directory.unknown(name)
        refusal = self.write_refusal(name, parameter)
        if refusal:
            return refusal
        try:
            self._directory.raw_from_user(parameter, value)
        except ValueRefused as error:
            return str(error)
        return ''

    def rounded(self, parameter: Parameter, value: Value) -> Value:
        """
        Return the value that the drive holds once one is written: that of the nearest raw step.

        :raises ValueRefused: :meth:`check` says why.
        """
        return parameter.value_from_raw(self._directory.raw_from_user(parameter, value))

    def unnamed(self, name: str, value: Value) -> Parameter | None:
        """Return the listed parameter that names its values, and not this one, if any."""
        return self._directory.unnamed(name, value)

    def contradicted(self, values: Mapping[str, Value]) -> dict[str, str]:
        """
        Return which values cannot be written together, and why: two for one parameter.

        What :meth:`check` refuses is left out.
        """
        items = {}
        for name, value in values.items() if len(values) > 1 else ():
            parameter = self.find(name)
            if parameter is not None and not self.check(name, value):
                items[name] = parameter, self._directory.raw_from_user(parameter, value)
        return {name: reason for name, reason in zip(items, contradictions(list(items.values())))
                if reason}

    def read(self, *names: str,
             told: Callable[[ReadOutcome], object] | None = None) -> dict[str, ReadOutcome]:
        """
        Read parameters: those named, or all readable listed ones.

        :param told: called with each outcome as soon as it is known, in any order.
        :return: one outcome for each name, in the order asked.
        """
        wanted = names or self.readable_names
        found: dict[str, ReadOutcome] = {}
        for outcome in self._read_all(wanted):
            found[outcome.name] = outcome
            if told is not None:
                told(outcome)
        return {name: found[name] for name in wanted}

    def _read_all(self, names: Sequence[str]) -> Iterator[ReadOutcome]:
        """Yield first what cannot be read at all; of the rest, neighbours share frames."""
        asked: list[tuple[str, Parameter]] = []
        for name in dict.fromkeys(names):
            parameter = self.find(name)
            if parameter is not None and parameter.readable:
                asked.append((name, parameter))
            else:
                yield ReadOutcome(
                    name, parameter, kind=FailureKind.INVALID,
                    reason='write-only' if parameter else self._directory.unknown(name))
        asked.sort(key=lambda each: (each[1].number or 0, each[1].subindex or 0))
        yield from self.ask(asked)

    def write(self, values: Mapping[str, Value], *, blind: bool = False,
              told: Callable[[WriteOutcome], object] | None = None) -> dict[str, WriteOutcome]:
        """
        Write parameters one after the other, in the order given, each one verified.

        :param values: in the units of the parameters; raw names take raw integers.
        :param blind: sent without checking whether the drive is there, or has the value already:
            it may receive although its answers get lost.
        :param told: called with each outcome before the next write begins; also with that of one
            under way when the conversation ends.
        :raises KeyboardInterrupt: on Ctrl-C; not before the write under way has its outcome, and
            ``told`` was called with it.
        """
        found = {}
        contradicted = self.contradicted(values)
        for name, value in values.items():
            with finish_first():
                parameter = self.find(name)
                refusal = contradicted.get(name) or self.check(name, value)
                if refusal or parameter is None:
                    outcome = WriteOutcome(
                        name, False, parameter, refusal, kind=FailureKind.INVALID)
                else:
                    outcome = self.put(name, parameter, value, blind=blind)
                found[name] = outcome
                if told is not None:
                    told(outcome)
                if outcome.trouble is not None:
                    raise outcome.trouble
        return found

    @abstractmethod
    def enabled(self) -> Enabled:
        """Return whether the drive is enabled, reading its status where that is possible."""

    @abstractmethod
    def identity(self) -> str:
        """
        Return the drive's identity: ``firmware=10205 serial_number=4711``.

        The parameters in the profile section ``identity``, as far as they can be read; '' where
        there is none.
        """

    # -- what the way to the drive decides, for the methods above ---------------------------------

    @abstractmethod
    def write_refusal(self, name: str, parameter: Parameter) -> str:
        """Return why a parameter cannot be written whatever the value; '' if it can."""

    @abstractmethod
    def ask(self, asked: Sequence[tuple[str, Parameter]]) -> Iterator[ReadOutcome]:
        """Read parameters that can be read; their outcomes come in any order."""

    @abstractmethod
    def put(self, name: str, parameter: Parameter, value: Value, *, blind: bool) -> WriteOutcome:
        """
        Write a value that passed :meth:`check`; without looking first if ``blind``.

        :raises DriveCanError: the conversation has ended, before the value was sent.
        """


class NoDrive(DriveCanError, KeyError):
    """
    There is no drive of this name, or none that matches a pattern.

    :param known: those that there are.
    """

    def __init__(self, name: object, known: Iterable[str]) -> None:
        from drive_can_bridge.core.complaints import hint   # takes its time
        names = list(known)
        super().__init__(sentences.no_drive_there(
            repr(name), ', '.join(names) or 'none', hint(str(name), names)))

    __str__ = Exception.__str__     # KeyError shows it in quotes


class Drives(Mapping[str, Drive]):
    """
    The drives that were opened, by name, in the order of the configuration.

    A context manager: leaving it closes the buses, or leaves the ROS graph.

    :param close: closes everything; called once.
    :ivar warnings: lines that the user should know before anything is written.
    """

    def __init__(self, drives: Mapping[str, Drive], close: Callable[[], object], *,
                 warnings: Sequence[str] = ()) -> None:
        self._drives = dict(drives)
        self._closers = [close]
        self.warnings = tuple(warnings)

    def __getitem__(self, name: str) -> Drive:
        """
        Return a drive.

        :raises NoDrive: none of this name was opened.
        """
        try:
            return self._drives[name]
        except KeyError:
            raise NoDrive(name, self._drives) from None

    def __repr__(self) -> str:
        return f'<Drives {", ".join(self._drives) or "none"}>'

    def __iter__(self) -> Iterator[str]:
        return iter(self._drives)

    def __len__(self) -> int:
        return len(self._drives)

    def close(self) -> None:
        """Close everything."""
        while self._closers:
            self._closers.pop(0)()

    def also_close(self, close: Callable[[], object]) -> None:
        """Add a function that :meth:`close` calls afterwards."""
        self._closers.append(close)

    def __enter__(self) -> 'Drives':
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class DriveSource(Protocol):
    """
    The drives of a file or a bridge: names are known before anything is opened or sent.

    Made by :func:`drive_can_bridge.client.find_source`.

    :ivar listens: opening drives takes a moment.
    """

    listens: bool

    @property
    def names(self) -> Sequence[str]:
        """All drives, in the order of the configuration."""

    def parameter_names(self, drive: str) -> Sequence[str]:
        """Return the names of the listed parameters of a drive."""

    def open(self, names: Sequence[str]) -> Drives:
        """
        Open the drives of these names.

        Directly: acquires the locks, opens their buses, listens for another master for 1.2 s.

        :raises DriveCanError: in use, another master, bus not available, a bridge that is gone.
        """

    def close(self) -> None:
        """Leave the ROS graph, where it was entered. Idempotent."""
