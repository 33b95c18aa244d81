# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What sessions with DataModel drives share, whatever their identifiers look like."""

from collections.abc import Callable
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlMachine
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.requests import Request
from drive_can_bridge.core.roles import Cells
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.told import MAY_RUN
from drive_can_bridge.protocols.channel import Lane
from drive_can_bridge.protocols.datamodel import procedures
from drive_can_bridge.protocols.datamodel.acyclic_control import control_by_hand, CONTROL_WORD
from drive_can_bridge.protocols.datamodel.channel import (
    AcyclicChannel, Polling, Procedure, Read, Words, Write,
)
from drive_can_bridge.protocols.datamodel.extended import SLOTS
from drive_can_bridge.protocols.datamodel.process_words import slot_of
from drive_can_bridge.protocols.datamodel.safe_stop import SafeStop, StopWrite


class DataModelSession(Session):
    """
    The acyclic channel, the requests of users and the control word in it.

    :param encode_read: (number, count) -> frame.
    :param encode_write: (number, words) -> frame.
    :param together: parameters that fit one write frame.
    :param polling: given where the exchange itself goes through the channel.
    """

    def __init__(self, drive: DriveConfiguration, *, encode_read: Callable[[int, int], Frame],
                 encode_write: Callable[[int, Words], Frame], together: int,
                 polling: Polling | None = None) -> None:
        table = drive.profile.control
        control: ControlMachine | None = None
        if table is not None:
            control = ControlMachine(table, timeout=drive.control_timeout)
        super().__init__(drive, control)
        options = drive.options
        self._offset: int = options.parameter_offset
        self._request_base: int = options.request_map_base + self._offset
        self._response_base: int = options.response_map_base + self._offset
        # where each of ``request_parameters`` is written by number
        self._sent_by_number = {
            (parameter.number or 0) + self._offset: place
            for place, parameter in enumerate(self.sent.parameters)}
        self._channel = AcyclicChannel(
            encode_read=encode_read, encode_write=encode_write, send=self._outbox.put,
            wrote=self._note_write, retry=self.retry,
            eeprom_gap=options.eeprom_write_gap, polling=polling)
        self._access = procedures.ParameterAccess(
            self.retry, verify=drive.verify_writes, offset=self._offset, together=together)
        status_name = table.status_parameter or '' if table is not None else ''
        self._control_slot = slot_of(drive.cyclic_request, self._control_name)
        self._status_slot = slot_of(drive.cyclic_response, status_name)
        self._by_hand = control_by_hand(
            drive, self._channel, self.control, self._control_changed, self.told,
            word=self._control_name if self._control_slot is None else '',
            status=status_name if self._status_slot is None else '', spacing=self._stop_spacing)
        self._safe_stop = SafeStop(self._channel, self._safe_stop_ended)
        self._owed = False  # there was something to be stopped when the stop began
        self._stops_all = False  # setpoints, too
        self._positions_asked = -1  # ``setpoints.forgotten`` when they were; -1: they are not

    def _note_write(self, write: Write) -> None:
        """Take note of a write that left."""
        for number, word in enumerate(write.words, write.number):
            if number in self._sent_by_number:
                self.sent.take((word,), self._sent_by_number[number])

    def facts(self) -> dict[str, str]:
        return {'short_frames': str(self.statistics.short)}

    # -- user requests ----------------------------------------------------------------------------

    def _enqueue(self, request: Request, now: float) -> None:
        self._channel.run(
            self._access.serve(request),
            lambda outcomes: self._answer(request, outcomes), now, Lane.USERS)

    def _waiting_requests(self) -> int:
        return self._channel.waiting_users

    def _fail_requests(self, reason: str) -> None:
        self._clear_channel()
        self._fail_open_requests(reason)

    def _clear_channel(self) -> None:
        """Forget everything acyclic, and whatever waits for its outcome."""
        self._channel.clear()
        self._channel.hold(-math.inf)
        self._positions_asked = -1
        self._safe_stop.forget()
        if self._by_hand is not None:
            self._by_hand.stop()

    @property
    def map_cells(self) -> Cells:
        options = self.drive.options     # numbers of the profile, as in ``cells``
        return frozenset(base + slot for slot in range(SLOTS)
                         for base in (options.request_map_base, options.response_map_base))

    # -- for the families -------------------------------------------------------------------------

    def _withdraw(self, reason: str, now: float) -> None:
        """Go neutral, and back to ``disable``."""
        self.setpoints.allow(False)
        if self.control is not None:
            self.control.withdraw(reason, now)
            self._control_changed(now)
        if self._by_hand is not None:
            self._by_hand.end()

    def _serve_control(self, now: float) -> None:
        """Do what is due for the control and status word."""
        if self.control is None:
            return
        if self._by_hand is not None:
            if now >= self._by_hand.look_at:
                self._by_hand.look(now)
            if now >= self._by_hand.retry_at:
                self._by_hand.retry_at = math.inf
                self._see_to_control_word(now)
        if now >= self.control.next_timer():
            self.control.handle_timer(now)
            self._control_changed(now)

    def _control_timer(self) -> float:
        """Return when ``_serve_control`` wants to be called."""
        if self.control is None:
            return math.inf
        due = self.control.next_timer()
        if self._by_hand is None:
            return due
        return min(due, self._by_hand.look_at, self._by_hand.retry_at)

    # -- stopping by acyclic writes ---------------------------------------------------------------

    def _stop_by_writes(self, now: float, *, setpoints: bool = True) -> None:
        """
        Write ``disable`` and neutral setpoints by their numbers, and see that the drive has them.

        :param setpoints: False: what is in ``cyclic_request`` is stopped by cyclic frames.
        """
        writes = []
        if self.control is not None and (setpoints or self._control_slot is None):
            word = self.drive.profile.parameters[self._control_name]
            writes.append(self._stop_write(word, self.control.word))
        if setpoints:   # but no position where the axis may not be any more
            writes += [self._stop_write(setpoint.parameter, setpoint.neutral)
                       for setpoint in self.setpoints.items if setpoint.known]
            setpoints = self.control is not None or self.setpoints.known
        # what is kept in RAM does not wait until an EEPROM is done
        writes.sort(key=lambda each: each.write.eeprom)
        if writes and not self._safe_stop.running:
            self._owed, self._stops_all = self.told.owed, setpoints
            self._safe_stop.begin(writes, now)

    # -- axes that stay where they are ------------------------------------------------------------

    def _read_positions(self, now: float) -> None:
        """Read by number where the axes are; ends with :meth:`_positions_read`."""
        asked = self.setpoints.forgotten
        if self._positions_asked != asked:
            self._positions_asked = asked
            self._channel.run(self._positions(), lambda raws: self._take_positions(asked, raws),
                              now)

    def _positions(self) -> Procedure:
        raws: list[int] = []
        for setpoint in self.setpoints.held:
            words = yield Read((setpoint.measured.number or 0) + self._offset)
            if words is None:
                return None
            raws.append(setpoint.measured.raw_from_word(words[0]))
        return raws

    def _take_positions(self, asked: int, raws: list[int] | None) -> None:
        if asked != self.setpoints.forgotten:   # the drive was lost since
            return
        self._positions_asked = -1
        for setpoint, raw in zip(self.setpoints.held, raws or ()):
            self.setpoints.changed |= setpoint.measure(raw)
        self._positions_read(raws is not None, self._channel.now)

    def _positions_read(self, answered: bool, now: float) -> None:
        """Go on when it was read where the axes are, or nobody answered."""

    def _stop_write(self, parameter: Parameter, raw: int) -> StopWrite:
        return StopWrite(parameter, (parameter.number or 0) + self._offset, raw)

    def _safe_stop_ended(self, failed: list[str]) -> None:
        if not failed:
            self.told.note(CONTROL_WORD, runs=False)
            if self._stops_all:
                self.told.stopped()
        elif self._owed:
            self._warn(f'told to stop, but {"; ".join(failed)}: {MAY_RUN}')
        self._stop_ended()

    def _stop_ended(self) -> None:
        """Go on after a stop by acyclic writes."""
