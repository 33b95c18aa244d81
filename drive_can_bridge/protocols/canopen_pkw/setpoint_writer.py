# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Setpoints on their way through the mailbox: on change, and again after a while."""

from collections.abc import Generator

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.canopen_pkw.addresses import Placement
from drive_can_bridge.protocols.canopen_pkw.mailbox import (
    Answered, MailboxChannel, Reply, Silence, Step, Write,
)
from drive_can_bridge.protocols.canopen_pkw.procedures import tell
from drive_can_bridge.protocols.channel import Lane
from drive_can_bridge.protocols.polling import WriteSchedule


class SetpointWriter:
    """
    Writes setpoints; each at most once for every look.

    :ivar refusals: what the drive says to setpoints that it refused, by name.
    """

    def __init__(self, session: Session, channel: MailboxChannel) -> None:
        drive = session.configuration
        self.refusals: dict[str, str] = {}
        self._session = session
        self._setpoints = session.setpoints
        self._channel = channel
        self._warned: dict[str, str] = {}
        self._placement = Placement.of(drive)
        self._spans = [self._placement.span(setpoint.parameter)
                       for setpoint in session.setpoints.items]
        self._schedule = WriteSchedule(len(self._spans), drive.options.refresh_interval)

    def forget(self) -> None:
        """Take note that nothing is known of the drive."""
        self._schedule.forget()
        self.refusals.clear()
        self._warned.clear()

    def look(self, now: float) -> None:
        """Write what is due."""
        self._setpoints.changed = False
        if not self._setpoints.items:
            return
        self._schedule.look(
            [setpoint.raw for setpoint in self._setpoints.items], now,
            hold=[index for index, setpoint in enumerate(self._setpoints.items)
                  if not setpoint.known])
        if self._schedule.waiting and self._channel.is_idle(Lane.SETPOINTS):
            self._channel.run(self._write(), lambda _: None, now, Lane.SETPOINTS)

    def _write(self) -> Generator[Step, Reply, None]:
        while self._schedule.waiting:
            index = self._schedule.next()
            setpoint = self._setpoints.items[index]
            parameter, raw = setpoint.parameter, setpoint.raw
            # at once: a look while the answer is awaited must not find it due again
            self._schedule.written(index, raw, self._channel.now)
            reply = yield from tell(
                self._session.told, index,
                Write(self._spans[index].address, self._placement.words(parameter, raw)),
                runs=raw != setpoint.neutral)
            if isinstance(reply, Silence):
                self._schedule.failed(index)
            elif isinstance(reply, Answered):
                self.refusals.pop(parameter.name, None)
            else:
                self._take_refusal(parameter, f'{parameter.name} {reply.text}')

    def _take_refusal(self, parameter: Parameter, text: str) -> None:
        if self._warned.get(parameter.name) != text:  # once: commands may go to and fro
            self._session.report.warn(f'write of {text}')
        self._warned[parameter.name] = self.refusals[parameter.name] = text
