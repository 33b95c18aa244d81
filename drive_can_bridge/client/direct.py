# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The direct way to drives: on the buses of a parameter file, while no bridge has them.

The sessions only *serve* (see :meth:`.Session.serve`): nothing is sent but the acyclic frames of
the submitted requests. What only a master sends to a drive of these buses, and was not
sent by this process, ends the conversation. A drive that is not there costs a few time-outs, not
one for each parameter: while its presence is unknown (at the beginning, and after a
request of which nothing was answered), it is greeted by single reads before anything else. What
did not answer when its node was to be started is not greeted again at once.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
import sys
import threading

from drive_can_bridge.client.drive import (
    Drive, DriveFacts, Drives, Enabled, ReadOutcome, WriteOutcome)
from drive_can_bridge.clock import Clock
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import (
    BridgeConfiguration, BusConfiguration, DriveConfiguration)
from drive_can_bridge.core.directory import ParameterDirectory
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable, DriveCanError
from drive_can_bridge.core.events import Event, RequestCompleted
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Parameter, Value
from drive_can_bridge.core.requests import (
    Failure, FailureKind, is_answer, Outcome, ReadRequest, ReadValue, Request, WriteRequest,
    Written)
from drive_can_bridge.core.roles import controlled_by, Role
from drive_can_bridge.core.session import Session
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.exchange.member import DriveListener
from drive_can_bridge.exchange.one_master import AnotherMaster, Ownership
from drive_can_bridge.protocols.families import FAMILIES

#: s that a bus has to open
_OPEN_TIMEOUT = 5.0
#: s between two checks of the bus, however many wait for something
_PATIENCE = 0.1


class BusConversation:
    """
    One open bus.

    :param drives: those that will be used.
    :param neighbours: all drives that are known on the bus: no other master may talk to them.
    :param ownership: of the bus; kept as long as its threads run, closed or not.
    :raises DriveCanError: the bus cannot be opened.
    """

    def __init__(self, bus: BusConfiguration, drives: Sequence[DriveConfiguration],
                 neighbours: Sequence[DriveConfiguration], ownership: Ownership,
                 clock: Clock) -> None:
        self.bus = bus
        self.now = clock.now
        self._ownership = ownership
        self._changed = clock.wake_event()
        self._lock = threading.Lock()
        self._outcomes: dict[int, tuple[Outcome, ...]] = {}
        self._trouble: DriveCanError | None = None
        self._opened = False
        self._requests: list[tuple[str, Route]] = [
            (drive.name, route) for drive in neighbours
            for route in FAMILIES[drive.protocol].make_prober(drive).requests]
        self.sessions: dict[str, Session] = {
            drive.name: FAMILIES[drive.protocol].make_session(drive) for drive in drives}
        self._exchange = BusExchange(
            bus, list(self.sessions.values()),
            [[claim.route for claim in FAMILIES[drive.protocol].claims(drive) if claim.heard]
             for drive in drives],
            self, clock, counted=[route for _, route in self._requests], note=self._note)
        for session in self.sessions.values():
            self._exchange.attach(session, _SessionListener(self))
        self._exchange.serve()
        self._exchange.open()
        try:
            self._exchange.link.wait_first_attempt(_OPEN_TIMEOUT)
            end = self.now() + _OPEN_TIMEOUT
            while not self._opened and self._trouble is None and self.now() < end:
                self._changed.wait(end)
            if not self._opened:
                self._fail(BusUnavailable(sentences.bus_not_opening(bus=bus.name)))
            self._check()
        except BaseException:
            self.close()
            raise

    def listen(self, seconds: float) -> None:
        """
        Wait, and only listen for another master.

        :raises DriveCanError: another master talks to a drive, or the bus is lost.
        """
        self._check()
        end = self.now() + seconds
        while (began := self.now()) < end:
            self._changed.wait(min(end, began + _PATIENCE))
            self._check()
            # a process that did not run meanwhile has not listened for longer
            end += max(self.now() - began - _PATIENCE, 0.0)

    def submit(self, drive: str, request: Request) -> None:
        """
        Submit a request; :meth:`wait` returns its outcomes.

        :raises DriveCanError: another master talks to a drive, or the bus is lost or closed.
        """
        self._check()
        self._exchange.submit(self.sessions[drive], request)

    def wait(self, request: Request) -> tuple[Outcome, ...]:
        """
        Wait for the outcomes of a submitted request.

        :raises DriveCanError: another master talks to a drive, or the bus is lost.
        """
        self._check()
        while id(request) not in self._outcomes:
            self._changed.wait(self.now() + _PATIENCE)
            self._check()
        return self._outcomes.pop(id(request))

    def send(self, frame: Frame) -> None:
        """
        Send a frame that is no parameter request.

        :raises BusUnavailable: the bus refuses it.
        """
        with self._exchange.lock:
            if not self._exchange.link.send(frame):
                raise BusUnavailable(sentences.bus_because(
                    bus=self.bus.name, reason=self._exchange.link.last_error))

    def close(self) -> None:
        """Close the bus; later requests raise. Idempotent."""
        self._exchange.close()
        self._fail(DriveCanError(sentences.bus_closed(bus=self.bus.name)))

    def _check(self) -> None:
        if self._trouble is not None:
            raise self._trouble

    def _fail(self, trouble: DriveCanError) -> None:
        with self._lock:
            self._trouble = self._trouble or trouble
        self._changed.ring()

    # -- from the exchange ------------------------------------------------------------------------

    def completed(self, request: Request, outcomes: tuple[Outcome, ...]) -> None:
        """Record the outcomes of a request."""
        self._outcomes[id(request)] = outcomes
        self._changed.ring()

    def _note(self, frame: Frame, now: float, sent: bool) -> None:
        if sent:
            return
        for name, route in self._requests:
            if route.matches(frame):
                self._fail(AnotherMaster(sentences.other_master_talks(
                    bus=self.bus.name, drive=name, frame=frame)))

    def bus_opened(self, bus: str) -> None:
        """Release the requests: the bus is there."""
        self._opened = True
        self._changed.ring()

    def bus_lost(self, bus: str, reason: str) -> None:
        """End the conversation: the state of the drives is unknown."""
        self._fail(BusUnavailable(sentences.bus_because(bus=bus, reason=reason)))

    def bus_told(self, bus: str, text: str) -> None:
        """Do nothing: the remark on the adapter changes no answer."""

    def fatal(self, bus: str, reason: str, *, misconfigured: bool) -> None:
        """End the conversation."""
        kind = BusMisconfigured if misconfigured else DriveCanError
        self._fail(kind(sentences.bus_because(bus=bus, reason=reason)))


class _SessionListener(DriveListener):
    """The listener of one session: only completed requests matter."""

    def __init__(self, conversation: BusConversation) -> None:
        self._conversation = conversation

    def handle_event(self, event: Event) -> None:
        """Pass on the outcomes of a request."""
        if isinstance(event, RequestCompleted):
            self._conversation.completed(event.request, event.outcomes)


#: parameters in one request to a session: two frames where four share one; and how many
#: such requests wait in it, so that the drive never waits for us
BLOCK = 8
AHEAD = 3
#: parameters that are tried until a drive counts as absent
TRIES = 3
#: s for which a drive that did not answer at the beginning counts as absent
_ABSENT_FOR = 2.0
#: s between looks whether a node has started, and s until there is no other look
_START_PAUSE = 0.1
_START_PATIENCE = 2.5
_NO_RESULT = Failure(FailureKind.UNAVAILABLE, sentences.no_result())
_START_HINT = sentences.node_not_operational()


class DirectDrive(Drive):
    """One drive on a bus of this process."""

    def __init__(self, drive: DriveConfiguration, bus: BusConfiguration,
                 conversation: BusConversation, nmt_start: bool) -> None:
        self._drive = drive
        self._family = family = FAMILIES[drive.protocol]
        facts = DriveFacts(
            drive.name, bus.name, bus.interface, str(bus.channel), bus.bitrate, drive.protocol,
            drive.station, drive.profile_key or drive.profile.name, drive.profile.sha256,
            drive.profile.restore, persist_writes=getattr(drive.options, 'persist_writes', True))
        super().__init__(drive.name, lambda: facts, ParameterDirectory(
            drive.profile.parameters, lambda name: family.raw_parameter(drive, name)))
        self._conversation = conversation
        self._session = conversation.sessions[drive.name]
        self._absent: tuple[float, Failure] | None = None   # since when, and the failure
        self._start_frame = family.make_prober(drive).start_frame()
        self._nmt_start = nmt_start

    def _start(self) -> None:
        if self._nmt_start and self._start_frame is not None:
            self._conversation.send(self._start_frame)

    def begin(self) -> Iterator[str]:
        """Start the node where that is wanted; yield what the user should know."""
        if self._nmt_start and self._start_frame is not None:
            self._start()
            end = self._conversation.now() + _START_PATIENCE
            while True:     # until its heartbeat, too, reports that it has started
                self._conversation.listen(_START_PAUSE)
                failure = self._greet()[1]
                if failure is None or self._conversation.now() >= end:
                    break
            if failure is not None:
                self._absent = self._conversation.now(), failure
        supervision = self._family.supervision(self._drive)
        if supervision is not None:
            outcome, = self._wait_for((supervision,))
            # a negative one is none; raw names have no sign
            if isinstance(outcome, ReadValue) and 0 < outcome.raw < 1 << 15:
                yield sentences.telegrams_supervised(self.name, supervision.address)

    def role(self, name: str) -> Role | None:
        parameter = self.find(name)
        return None if parameter is None else self._session.roles.role(parameter)

    def write_refusal(self, name: str, parameter: Parameter) -> str:
        if not parameter.writable:
            return ''   # which its value is told
        owner = self._session.roles.owner(parameter)
        if owner is not None and owner[0] is Role.CONTROL:
            return controlled_by(owner[1], sentences.bridge_sends_word)
        if owner is not None and owner[0] is Role.CYCLIC:
            return sentences.bridge_sends_setpoint(name=owner[1].name)
        return self._session.services.write_refusal(parameter)

    # -- reading ----------------------------------------------------------------------------------

    def ask(self, asked: Sequence[tuple[str, Parameter]]) -> Iterator[ReadOutcome]:
        for name, parameter, outcome in self._outcomes(asked):
            yield self._read_outcome(name, parameter, outcome)

    def _outcomes(self, asked: Sequence[tuple[str, Parameter]],
                  ) -> Iterator[tuple[str, Parameter, Outcome]]:
        """Request in blocks; the next one waits in the session while one is being served."""
        blocks = [asked[start:start + BLOCK] for start in range(0, len(asked), BLOCK)]
        waiting: list[tuple[Sequence[tuple[str, Parameter]], ReadRequest]] = []
        while blocks or waiting:
            if blocks and not self._session.online:
                # no answer last time, or ever: not a time-out for each parameter
                known, failure = self._look([each for _, each in blocks[0]])
                if failure is not None:
                    for block in blocks:
                        yield from _paired(block, [failure] * len(block))
                    return
                rest = tuple(each for _, each in blocks[0] if each not in known)
                known.update(zip(rest, self._wait_for(rest)))
                block = blocks.pop(0)
                yield from _paired(block, [known[each] for _, each in block])
                continue
            while blocks and len(waiting) < AHEAD:
                request = ReadRequest(tuple(each for _, each in blocks[0]))
                self._conversation.submit(self.name, request)
                waiting.append((blocks.pop(0), request))
            block, request = waiting.pop(0)
            outcomes = self._conversation.wait(request)
            if any(isinstance(each, Failure) and each.kind is FailureKind.OFFLINE
                   for each in outcomes):
                # the one before had no answer at all, which may have been the fault of its names
                blocks.insert(0, block)
            else:
                yield from _paired(block, outcomes)

    def _look(self, wanted: Sequence[Parameter] = (),
              ) -> tuple[dict[Parameter, Outcome], Failure | None]:
        """Greet a drive, which may have restarted, unless that was done just now."""
        if self._absent is not None and self._conversation.now() - self._absent[0] < _ABSENT_FOR:
            return {}, self._absent[1]
        self._absent = None
        self._start()
        return self._greet(wanted)

    def _greet(self, wanted: Sequence[Parameter] = (),
               ) -> tuple[dict[Parameter, Outcome], Failure | None]:
        """
        Find out whether the drive is there, preferably by what is wanted anyway.

        :return: what was learnt by that, and why the drive counts as absent; None: it does not.
        """
        known: dict[Parameter, Outcome] = {}
        listed = [each for each in self.parameters.values()
                  if each.readable and self._session.roles.cells(each)]
        candidates = dict.fromkeys([*wanted[:1], *listed[:TRIES], *wanted])
        outcome: Outcome = Failure(FailureKind.OFFLINE, sentences.no_answer_offline())
        for candidate in list(candidates)[:TRIES]:
            outcome, = self._wait_for((candidate,))
            if is_answer(outcome):
                if candidate in wanted:
                    known[candidate] = outcome
                return known, None
        return known, outcome if isinstance(outcome, Failure) else None

    def _wait_for(self, parameters: tuple[Parameter, ...]) -> tuple[Outcome, ...]:
        request = ReadRequest(parameters)
        self._conversation.submit(self.name, request)
        return self._conversation.wait(request)

    def _read_outcome(self, name: str, parameter: Parameter, outcome: Outcome) -> ReadOutcome:
        if isinstance(outcome, ReadValue):
            return ReadOutcome(name, parameter, outcome.raw,
                               parameter.value_from_raw(outcome.raw))
        failure = outcome if isinstance(outcome, Failure) else _NO_RESULT
        return ReadOutcome(
            name, parameter, reason=self._explained(failure), kind=failure.kind)

    def _explained(self, failure: Failure) -> str:
        """Return the reason of a failure, with a hint for a drive that never answers."""
        silent = not self._session.online and failure.kind in (
            FailureKind.OFFLINE, FailureKind.NO_ANSWER)
        if silent and self._start_frame is not None and not self._nmt_start:
            return f'{failure.reason}; {_START_HINT}'
        return failure.reason

    # -- writing ----------------------------------------------------------------------------------

    def put(self, name: str, parameter: Parameter, value: Value, *, blind: bool) -> WriteOutcome:
        if not (blind or self._session.online):     # nothing is written to a silent drive
            _, failure = self._look()
            if failure is not None:
                return self._not_written(name, parameter, failure)
        request = WriteRequest(((parameter, self._directory.raw_from_user(parameter, value)),),
                               blind=blind)
        self._conversation.submit(self.name, request)
        try:
            outcome, = self._conversation.wait(request)
        except DriveCanError as trouble:
            return WriteOutcome.under_way(name, parameter, trouble)
        if isinstance(outcome, Written):
            return WriteOutcome(name, True, parameter, outcome.note)
        return self._not_written(
            name, parameter, outcome if isinstance(outcome, Failure) else _NO_RESULT)

    def _not_written(self, name: str, parameter: Parameter, failure: Failure) -> WriteOutcome:
        return WriteOutcome(name, False, parameter, self._explained(failure), kind=failure.kind)

    # -- state ------------------------------------------------------------------------------------

    def enabled(self) -> Enabled:
        told = self._family.enabled_status(self._drive)
        if told is None:
            return Enabled.UNKNOWN
        status, is_enabled = told
        outcome, = self.ask([(status.name, status)])
        if outcome.raw is None:
            return Enabled.UNKNOWN
        return Enabled.YES if is_enabled(outcome.raw) else Enabled.NO

    def identity(self) -> str:
        names = self._drive.profile.identity
        outcomes = self.read(*names) if names else {}
        return ' '.join(f'{name}={outcome.parameter.text(outcome.value)}'
                        for name, outcome in outcomes.items()
                        if outcome.parameter is not None and outcome.value is not None)


def _paired(block: Sequence[tuple[str, Parameter]], outcomes: Sequence[Outcome],
            ) -> Iterator[tuple[str, Parameter, Outcome]]:
    for (name, parameter), outcome in zip(block, outcomes, strict=True):
        yield name, parameter, outcome


#: s to listen for another master before the first request
LISTEN = 1.2
#: what to do where a bridge has a drive
ADVICE = sentences.leave_file_away()


class DirectSource:
    """
    The drives of a parameter file, reached on their buses, without a bridge.

    :param nmt_start: start CANopen nodes before they are asked.
    :raises ConfigurationError: the file is wrong.
    :ivar listens: opening listens for another master first.
    """

    listens = True

    def __init__(self, params_file: str | Path, clock: Clock, *, nmt_start: bool = False) -> None:
        self.configuration: BridgeConfiguration = configuration_from_file(Path(params_file))
        self._clock = clock
        self._nmt_start = nmt_start

    @property
    def names(self) -> Sequence[str]:
        """All drives, in the order of the file."""
        return tuple(self.configuration.drives)

    def parameter_names(self, drive: str) -> Sequence[str]:
        """Return the names of the listed parameters of a drive."""
        return tuple(self.configuration.drives[drive].profile.parameters)

    def open(self, names: Sequence[str]) -> Drives:
        """Acquire the locks, open the buses of these drives, and listen for another master."""
        configuration = self.configuration
        wanted = [drive for name, drive in configuration.drives.items() if name in names]
        everyone = [*wanted, *(drive for drive in configuration.drives.values()
                               if drive not in wanted)]
        groups = {bus: [drive for drive in everyone if drive.bus == bus]
                  for bus in dict.fromkeys(drive.bus for drive in wanted)}
        ownership = Ownership([(configuration.buses[bus], drives)
                               for bus, drives in groups.items()], _program(), ADVICE)
        conversations: dict[str, BusConversation] = {}

        def close() -> None:
            for conversation in conversations.values():
                conversation.close()
            ownership.release()
        try:
            for bus, drives in groups.items():
                conversations[bus] = BusConversation(
                    configuration.buses[bus], [drive for drive in wanted if drive.bus == bus],
                    drives, ownership, self._clock)
            seconds = LISTEN    # they all listen at the same time
            for conversation in conversations.values():
                conversation.listen(seconds)
                seconds = 0.0
            opened = {drive.name: DirectDrive(drive, configuration.buses[drive.bus],
                                              conversations[drive.bus], self._nmt_start)
                      for drive in wanted}
            warnings = [text for drive in opened.values() for text in drive.begin()]
        except BaseException:
            close()
            raise
        return Drives(opened, close, warnings=warnings)

    def close(self) -> None:
        """Do nothing: nothing is open."""


def _program() -> str:
    """Return the name of this process, for others that want the same drives."""
    words = [Path(word).name for word in sys.argv]
    subcommand = next((word for word in words[1:] if word.isidentifier()), '')
    return f'{words[0]} {subcommand}' if words[0] == 'drive_can' else words[0] or 'script'
