# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a device is told: setpoints and control word while it is online, and the stop of both.

Both are written when they change. Neutral setpoints follow the word that stops a drive at once,
and so does everything in the stop, whatever is known of the node.
"""

from collections.abc import Callable

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.canopen_pkw import procedures
from drive_can_bridge.protocols.canopen_pkw.addresses import Placement
from drive_can_bridge.protocols.canopen_pkw.control_writer import ControlWriter
from drive_can_bridge.protocols.canopen_pkw.mailbox import MailboxChannel, Reply, Step
from drive_can_bridge.protocols.canopen_pkw.setpoint_writer import SetpointWriter
from drive_can_bridge.protocols.channel import Lane
from drive_can_bridge.protocols.safe_stop import SafeStop

#: how often a drive is told to stand still
STOP_ATTEMPTS = 3


class Writers:
    """
    The writers of one drive.

    :param stop_ended: called when a stop has run its course.
    """

    def __init__(self, session: Session, channel: MailboxChannel,
                 stop_ended: Callable[[], None]) -> None:
        self._session = session
        self._channel = channel
        self._placement = Placement.of(session.configuration)
        self._setpoints = SetpointWriter(session, channel)
        self._control = None if session.control is None else ControlWriter(
            session, session.control, channel)
        self._stop: SafeStop[Step, Reply] = SafeStop(session, channel, stop_ended)

    def forget(self) -> None:
        """Take note that nothing is known of the drive."""
        self._setpoints.forget()
        if self._control is not None:
            self._control.forget()

    def cancel(self) -> None:
        """Leave alone what is under way, but for a stop."""
        self._channel.cancel(Lane.SETPOINTS)
        self._channel.cancel(Lane.CONTROL)

    def write_setpoints(self, now: float) -> None:
        """Write the setpoints that are due."""
        self._setpoints.look(now)

    def write_control(self, now: float, *, known: bool) -> None:
        """
        Write a control word that has changed.

        :param known: the status was read just now, or there is none.
        """
        if self._control is not None:
            self._control.update(now, known=known)
        setpoints = self._session.setpoints
        if setpoints.changed and not setpoints.enabled:
            self._setpoints.look(now)

    # -- stopping ---------------------------------------------------------------------------------

    def stop(self, time: float, now: float, *, in_the_end: float = 0.0,
             insist: bool = False) -> None:
        """
        Tell the drive to stand still, within so many s.

        :param in_the_end: s that the answer to the last attempt is waited for at least: a device
            may be slow, and nobody waits for the end of this stop.
        :param insist: what failed is told even if the drive was not told to run.
        """
        writes = self._stop.writes()
        self._channel.cancel(Lane.STOP)
        self._channel.make_room(now)
        timeout = min(self._session.configuration.parameter_timeout,
                      time / (STOP_ATTEMPTS * max(1, len(writes))))
        self._stop.begin(
            procedures.write_until_answered(
                writes, self._placement, STOP_ATTEMPTS, timeout, max(timeout, in_the_end)),
            now, insist=insist)

    # -- what the drive refuses -------------------------------------------------------------------

    def control_refusal(self, action: ControlAction, refusal: str) -> str:
        """Say why a control action cannot be asked for, besides the usual."""
        if action is ControlAction.ENABLE:
            for setpoint in self._session.setpoints.held:  # the drive has another position
                refused = self._setpoints.refusals.get(setpoint.parameter.name)
                if refused:
                    return f'it would jump: write of {refused}'
        return refusal

    def warnings(self) -> list[str]:
        """Say what the drive refuses, and what to do."""
        texts = [f'write of {text}: correct cyclic_request, the command or the profile'
                 for text in self._setpoints.refusals.values()]
        if self._control is not None and self._control.refusal:
            texts.append(f'write of {self._control.refusal}: look at the device')
        return texts
