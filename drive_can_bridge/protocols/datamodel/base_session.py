# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What sessions with DataModel drives share, whatever their identifiers look like."""

from abc import abstractmethod
from collections.abc import Callable

from drive_can_bridge.configuration.model import DriveConfiguration
from drive_can_bridge.core.control import ControlMachine, ProfileControl
from drive_can_bridge.core.events import FrameRejected, Noted, StationLost
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.requests import Request
from drive_can_bridge.core.session import DriveState, Session
from drive_can_bridge.protocols.datamodel.channel import AcyclicChannel, Words
from drive_can_bridge.protocols.datamodel.extended import SLOTS
from drive_can_bridge.protocols.datamodel.user_requests import UserRequests


class DataModelSession(Session):
    """
    The acyclic channel, the requests of users in it, and the rules for parameter numbers.

    :param encode_read: (number, count) -> frame.
    :param encode_write: (number, words) -> frame.
    """

    def __init__(self, drive: DriveConfiguration, *, encode_read: Callable[[int, int], Frame],
                 encode_write: Callable[[int, Words], Frame]) -> None:
        table = drive.profile.control
        control: ControlMachine | None = None
        if table is not None:
            control = ProfileControl(table, timeout=drive.control_timeout)
        super().__init__(drive, control)
        options = drive.family_options
        self._offset: int = options['parameter_offset']
        self._request_base: int = options['request_map_base'] + self._offset
        self._response_base: int = options['response_map_base'] + self._offset
        self._channel = AcyclicChannel(
            encode_read=encode_read, encode_write=encode_write,
            timeout=drive.parameter_timeout, attempts=drive.parameter_retries + 1,
            eeprom_gap=options['eeprom_write_gap'])
        self._users = UserRequests(
            self._channel, drive, offline=lambda: self.state is DriveState.OFFLINE,
            offset=self._offset, complete=self._complete)
        self._advice = 'not activated'

    @property
    def offline_advice(self) -> str:
        return self._advice

    def take_frames(self) -> list[Frame]:
        frames = super().take_frames()
        acyclic = self._channel.take_frames()
        return frames + acyclic if acyclic else frames

    def frames_left(self, now: float) -> None:
        self._channel.frames_left(now)

    # -- user requests ----------------------------------------------------------------------------

    def _enqueue(self, request: Request, now: float) -> None:
        self._users.add(request, now)

    def _waiting_requests(self) -> int:
        return self._users.waiting

    def _fail_requests(self, reason: str) -> None:
        self._clear_channel()
        self._users.fail(reason)

    def _clear_channel(self) -> None:
        """Forget everything acyclic, and whatever waits for its outcome."""
        self._channel.clear()

    def reconfigure(self, *, command_timeout: float | None = None,
                    rearm_immediate: bool | None = None,
                    parameter_timeout: float | None = None) -> None:
        super().reconfigure(command_timeout=command_timeout, rearm_immediate=rearm_immediate,
                            parameter_timeout=parameter_timeout)
        self._users.reconfigure(self.drive)

    def write_refusal(self, parameter: Parameter) -> str:
        number = (parameter.number or 0) + self._offset
        if self.active and (self._request_base <= number < self._request_base + SLOTS
                            or self._response_base <= number < self._response_base + SLOTS):
            return 'mapping parameter: not written while the bridge is active'
        return super().write_refusal(parameter)

    # -- for the families -------------------------------------------------------------------------

    def _lose(self, reason: str, now: float) -> None:
        """Make the drive offline, if it is not."""
        self._withdraw(reason, now)
        self._advice = reason
        self._be_offline(reason)

    def _be_offline(self, reason: str) -> None:
        if self.online:
            self.online = False
            self._events.append(StationLost(reason))

    def _withdraw(self, reason: str, now: float) -> None:
        """Go neutral, and back to ``disable``."""
        self.setpoints.disarm()
        self.setpoints.enabled = False
        if self.control is not None:
            self.control.withdraw(reason, now)
            self._control_changed(now)

    def _control_changed(self, now: float) -> None:
        """Tell what the control machine noted; then see to its word."""
        if self.control is not None:
            for note in self.control.take_notes():
                self._events.append(Noted(note))
            self._update_control_word(now)

    @abstractmethod
    def _update_control_word(self, now: float) -> None:
        """Write a control word that changed, unless it goes with the cycle."""

    def _reject(self, text: str) -> None:
        self.statistics.rejected += 1
        self._events.append(FrameRejected(text))
