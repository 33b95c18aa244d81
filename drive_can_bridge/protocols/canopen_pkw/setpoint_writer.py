# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Setpoints on their way through the mailbox: on change, and again after a while."""

from collections.abc import Callable, Generator

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.setpoints import Setpoints
from drive_can_bridge.core.told import Told
from drive_can_bridge.protocols.canopen_pkw import addresses
from drive_can_bridge.protocols.canopen_pkw.mailbox import (
    Answered, MailboxChannel, Reply, Silence, Step, Write,
)
from drive_can_bridge.protocols.canopen_pkw.procedures import LastWrite
from drive_can_bridge.protocols.channel import Lane
from drive_can_bridge.protocols.polling import WriteSchedule


class SetpointWriter:
    """
    Writes setpoints; each at most once for every look.

    :param refresh: s after which an unchanged one is written again; 0: never.
    :param refused: takes what the drive says to a setpoint that it refuses, in words.
    :param told: takes note of what the drive was told.
    :ivar refusals: what the drive says to setpoints that it refused, by name.
    """

    def __init__(self, channel: MailboxChannel, setpoints: Setpoints,
                 refused: Callable[[str], None], told: Told, *, addressing: str,
                 word_order: str, refresh: float) -> None:
        self.refusals: dict[str, str] = {}
        self._channel = channel
        self._setpoints = setpoints
        self._refused = refused
        self._told = told
        self._warned: dict[str, str] = {}
        self._word_order = word_order
        self._spans = [addresses.span_of(setpoint.parameter, addressing)
                       for setpoint in setpoints.items]
        self._schedule = WriteSchedule(len(setpoints.items), refresh)

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

    def neutral_writes(self) -> list[LastWrite]:
        """Return what writes the neutral value of every setpoint of which it is known."""
        return [LastWrite(setpoint.parameter.name, span, addresses.words_from_raw(
                    setpoint.parameter, setpoint.neutral, self._word_order))
                for setpoint, span in zip(self._setpoints.items, self._spans)
                if setpoint.known]

    def _write(self) -> Generator[Step, Reply, None]:
        while self._schedule.waiting:
            index = self._schedule.next()
            setpoint = self._setpoints.items[index]
            parameter, raw = setpoint.parameter, setpoint.raw
            # at once: a look while the answer is awaited must not find it due again
            self._schedule.written(index, raw, self._channel.now)
            # now: a neutral value that follows the axis is another one when the answer comes
            before, runs = self._told.runs(index), raw != setpoint.neutral
            if runs:
                self._told.note(index, runs=True)
            reply = yield Write(self._spans[index].address, addresses.words_from_raw(
                parameter, raw, self._word_order))
            if isinstance(reply, Silence):
                self._schedule.failed(index)
                if not reply.sent:
                    self._told.note(index, runs=before)
            elif isinstance(reply, Answered):
                self._told.note(index, runs=runs)
                self.refusals.pop(parameter.name, None)
            else:
                self._take_refusal(parameter, f'{parameter.name} {reply.text}')

    def _take_refusal(self, parameter: Parameter, text: str) -> None:
        if self._warned.get(parameter.name) != text:  # once: commands may go to and fro
            self._refused(f'write of {text}')
        self._warned[parameter.name] = self.refusals[parameter.name] = text
