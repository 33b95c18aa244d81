# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a polled DataModel drive is told: setpoints, and a control word among them, as they change.

One parameter a frame, which nobody acknowledges. They do not wait for answers: they go out while a
read is under way, or in quarantine, with the values that they have then.
"""

import math

from drive_can_bridge.core.session import Session
from drive_can_bridge.core.stop_duty import Happened
from drive_can_bridge.protocols.datamodel.acyclic_side import AcyclicSide
from drive_can_bridge.protocols.datamodel.channel import Reply, Step, Write
from drive_can_bridge.protocols.polled_exchange import PolledExchange

Rounds = PolledExchange[Step, Reply]


class SetpointWriter:
    """
    Writes what is in ``cyclic_request`` of one drive.

    :ivar word_written_at: when the control word left last.
    """

    def __init__(self, session: Session, side: AcyclicSide, exchange: Rounds) -> None:
        drive = session.configuration
        self.word_written_at = -math.inf
        self._session = session
        self._exchange = exchange
        self._side = side
        self._courier = side.courier
        self._numbers = side.numbers
        self._slot = side.control_slot
        self._parameters = drive.cyclic_request
        self._output = side.output

    def stop(self) -> None:
        """Plan nothing any more: nothing is known of the drive."""
        self._output.forget()

    def look(self, now: float, *, unanswered: bool = False, known: bool = False) -> None:
        """
        Find out what is to be written.

        :param unanswered: what was asked a period ago still waits for its answer.
        :param known: the status was read just now, or there is none. A word that starts the drive
            is repeated only then: one that was off meanwhile, unseen, must not start by that.
        """
        self._session.gate.expire(now)      # nothing is handed out that is too old
        control, slot, output = self._session.control, self._slot, self._output
        stopping = control is not None and control.stopping
        starts = control is not None and not (control.at_rest or stopping)
        if slot is not None and output.word_due(now) and (
                stopping or not self._exchange.reading):
            output.failed(slot)
        doubt = starts and (self._exchange.silent or unanswered)
        if starts and self._exchange.silent:
            output.start_over()
        repeated = starts and control is not None and not (control.word_due or control.pulsing)
        hold = [slot] if doubt or repeated and not known or self.holds_word(now) else []
        unknown = self._session.setpoints.unknown
        if unknown:
            hold += [index for index, parameter in enumerate(self._parameters)
                     if parameter.name in unknown]
        output.look(self._raws(), now, hold=hold)
        if control is not None:
            # a word that starts the drive behind setpoints, also when all are only refreshed
            output.order_word(first=stopping or control.pulsing)

    def holds_word(self, now: float) -> bool:
        """Tell whether the control word waits for setpoints."""
        return self._output.holds_word(again=self._output.word_due(now))

    def write(self, now: float) -> None:
        """Write one that is due, if there is one, with the value that it has now."""
        if not self._output.waiting or now < self._courier.free_at:
            return
        self._session.gate.expire(now)
        index = self._output.next()
        parameter, raw = self._parameters[index], self._raws()[index]
        # now: a neutral value that follows the axis may be another one when the frame leaves
        runs = raw != self._raws(neutral=True)[index]
        # What is sent cyclically is volatile: EEPROM parameters are refused by the configuration.
        self._courier.write(
            Write(self._numbers.number(parameter), self._numbers.words(parameter, raw),
                  eeprom=False),
            lambda sent, then: self._left(index, raw, sent, then, runs=runs), now)
        self._output.written(index, raw, now)

    def write_word(self, now: float, *, known: bool = False) -> None:
        """
        Write a control word that is due, or what it waits for, without waiting for a period.

        :param known: see :meth:`look`.
        """
        self.look(now, known=known)
        self.write(now)

    def write_all(self, now: float) -> None:
        """Write all setpoints, whether they have changed or not, without waiting for a period."""
        self._output.write_all()
        self.write_word(now)

    def handle_timer(self, now: float) -> None:
        """Write what is due."""
        if self._slot is not None and self._output.handle_timer(now):
            self._session.see_to_control_word(now)
        self.write(now)

    def next_timer(self) -> float:
        """Return when :meth:`handle_timer` wants to be called; infinity: never."""
        again_at = math.inf if self._slot is None else self._output.next_timer()
        return min(again_at, self._courier.free_at) if self._output.waiting else again_at

    def _raws(self, *, neutral: bool = False) -> list[int]:
        items, control = self._session.setpoints.items, self._session.control
        raws = [setpoint.neutral if neutral else setpoint.raw for setpoint in items]
        if control is not None and self._slot is not None:
            raws.insert(self._slot, control.table.disable if neutral else control.word)
        return raws

    def _left(self, index: int, raw: int, sent: bool, now: float, *, runs: bool) -> None:
        """Record a setpoint, or control word, that left; the refused ones are due again."""
        if not sent:
            self._output.failed(index)
            return
        self._session.duty.channel(index, Happened.RUN_LEFT if runs else Happened.STOP_LEFT)
        if not runs:
            self._session.neutral_stop.left(self._parameters[index].name)
        control = self._session.control
        if index != self._slot or control is None:
            if self._output.has(index):
                self._session.see_to_control_word(now)
            return
        self.word_written_at = now
        if self._output.word_left(now, raw):
            self._session.control_changed(now)
