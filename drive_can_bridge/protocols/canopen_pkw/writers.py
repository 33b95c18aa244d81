# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a device is told: setpoints and control word while it is online, and the stop of both.

Both are written when they change, setpoints also again after a while. Neutral setpoints follow the
word that stops a drive at once, and so does everything in the stop, whatever is known of the node.
"""

from collections.abc import Callable, Generator

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.canopen_pkw.addresses import Placement
from drive_can_bridge.protocols.canopen_pkw.control_writer import ControlWriter
from drive_can_bridge.protocols.canopen_pkw.mailbox import (
    MailboxChannel, Refused, Reply, Silence, Step, Write,
)
from drive_can_bridge.protocols.canopen_pkw.procedures import tell, write_until_answered
from drive_can_bridge.protocols.channel import Lane
from drive_can_bridge.protocols.polling import WriteSchedule
from drive_can_bridge.protocols.safe_stop import SafeStop

#: how often a drive is told to stand still
STOP_ATTEMPTS = 3


class Writers:
    """
    What writes to one drive.

    :param stop_ended: called when a stop has run its course.
    :ivar control: writes the control word; None: there is none.
    """

    def __init__(self, session: Session, channel: MailboxChannel,
                 stop_ended: Callable[[], None]) -> None:
        drive = session.configuration
        self.control = None if session.control is None else ControlWriter(
            session, session.control, channel)
        self._session = session
        self._channel = channel
        self._placement = Placement.of(drive)
        self._setpoints = session.setpoints
        self._schedule = WriteSchedule(
            len(session.setpoints.items), drive.options.refresh_interval)
        self._refusals: dict[str, str] = {}     # of setpoints, by name
        self._warned: dict[str, str] = {}
        self._stop: SafeStop[Step, Reply] = SafeStop(session, channel, stop_ended)

    def forget(self) -> None:
        """Take note that nothing is known of the drive."""
        self._schedule.forget()
        self._refusals.clear()
        self._warned.clear()
        if self.control is not None:
            self.control.forget()

    def cancel(self) -> None:
        """Leave alone what is under way, but for a stop."""
        self._channel.cancel(Lane.SETPOINTS)
        self._channel.cancel(Lane.CONTROL)

    # -- while it is online -----------------------------------------------------------------------

    def write_control(self, now: float, *, known: bool) -> None:
        """
        Write a control word that has changed.

        :param known: the status was read just now, or there is none.
        """
        if self.control is not None:
            self.control.update(now, known=known)
        if self._setpoints.changed and not self._setpoints.enabled:
            self.write_setpoints(now)

    def write_setpoints(self, now: float) -> None:
        """Write the setpoints that are due, each once."""
        self._setpoints.changed = False
        items = self._setpoints.items
        if not items:
            return
        self._schedule.look([setpoint.raw for setpoint in items], now, hold=[
            index for index, setpoint in enumerate(items) if not setpoint.known])
        if self._schedule.waiting and self._channel.is_idle(Lane.SETPOINTS):
            self._channel.run(self._write_setpoints(), lambda _: None, now, Lane.SETPOINTS)

    def _write_setpoints(self) -> Generator[Step, Reply, None]:
        while self._schedule.waiting:
            index = self._schedule.next()
            setpoint = self._setpoints.items[index]
            name, raw = setpoint.parameter.name, setpoint.raw
            # at once: a look while the answer is awaited must not find it due again
            self._schedule.written(index, raw, self._channel.now)
            reply = yield from tell(
                self._session.told, index, Write.of(self._placement, setpoint.parameter, raw),
                runs=raw != setpoint.neutral)
            if isinstance(reply, Silence):
                self._schedule.failed(index)
            elif isinstance(reply, Refused):
                text = f'{name} {reply.text}'
                if self._warned.get(name) != text:  # once: commands may go to and fro
                    self._session.report.warn(f'write of {text}')
                self._warned[name] = self._refusals[name] = text
            else:
                self._refusals.pop(name, None)

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
            write_until_answered(
                writes, self._placement, STOP_ATTEMPTS, timeout, max(timeout, in_the_end)),
            now, insist=insist)

    # -- what the drive refuses -------------------------------------------------------------------

    def control_refusal(self, action: ControlAction, refusal: str) -> str:
        """Say why a control action cannot be asked for, besides the usual."""
        if action is ControlAction.ENABLE:
            for setpoint in self._setpoints.held:  # the drive has another position
                refused = self._refusals.get(setpoint.parameter.name)
                if refused:
                    return f'it would jump: write of {refused}'
        return refusal

    def warnings(self) -> list[str]:
        """Say what the drive refuses, and what to do."""
        texts = [f'write of {text}: correct cyclic_request, the command or the profile'
                 for text in self._refusals.values()]
        if self.control is not None and self.control.refusal:
            texts.append(f'write of {self.control.refusal}: look at the device')
        return texts
