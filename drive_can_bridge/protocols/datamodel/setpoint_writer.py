# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a DataModel drive is told by acyclic frames, one parameter each, which nobody acknowledges.

*By number* (:class:`ControlByNumber`): a control word without a slot in cyclic telegrams. It is
written when it changes, before everything else that waits; one that stops the drive waits for
nothing at all. A status word without a slot is read twice a second, twenty times while a request
is under way, and whenever the word has left.

*In slots* (:class:`SetpointWriter`): what is in ``cyclic_request`` of a polled drive, as it
changes. It does not wait for answers: it goes out while a read is under way, or in quarantine,
with the value that it has then.

What is due, and when a word is written again, says :mod:`..acyclic_output`.
"""

from collections.abc import Callable
import math

from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.core.stop_duty import CONTROL_WORD, Happened
from drive_can_bridge.protocols.acyclic_output import AcyclicOutput
from drive_can_bridge.protocols.channel import Channel
from drive_can_bridge.protocols.datamodel.procedures import Numbers
from drive_can_bridge.protocols.datamodel.transactor import (
    ParameterTransactor, ParameterWrite, Procedure, Reply, Step)
from drive_can_bridge.protocols.lifecycle import Lifecycle, Script
from drive_can_bridge.protocols.polled_exchange import PolledExchange

#: s between two looks at the status word, while a request is under way and otherwise
STATUS_PERIOD_PENDING = 0.05
STATUS_PERIOD = 0.5
#: s until a word that the bus refused is written again
REFUSED_PAUSE = 0.02


class ControlByNumber:
    """
    Control and status word of a drive, as far as they have no slot.

    :param word: parameter of the control word; None: it has one.
    :param status: parameter of the status word; None: it has one, or there is none.
    :param invalidate: records that answers to what was asked before show nothing of a word that
        left.
    :param known: records that the status was read just now.
    """

    def __init__(self, session: Session, control: ControlMachine, channel: Channel[Step, Reply],
                 transactor: ParameterTransactor, numbers: Numbers, output: AcyclicOutput, *,
                 word: Parameter | None, status: Parameter | None,
                 invalidate: Callable[[], None], known: Callable[[float], None]) -> None:
        self._session = session
        self._invalidate, self._known = invalidate, known
        self._control = control
        self._channel = channel
        self._transactor = transactor
        self._word = word
        self._status = status
        self._numbers = numbers
        self._output = output
        self._watch = Lifecycle(channel)

    def begin(self, now: float) -> None:
        """Handle a drive that was found: write its word, and poll its status."""
        self._output.forget_word()
        self._output.restart()
        self._poll(now)

    def end(self) -> None:
        """Leave the status of a lost drive alone."""
        self._watch.end()
        if self._word is not None:
            self._output.again_at = math.inf

    def stop(self) -> None:
        """Plan nothing any more. The channel was cleared."""
        self.end()
        self._watch.stop()

    def update(self, now: float) -> None:
        """Write the control word if it changed, or if the drive takes no notice of it."""
        control, output = self._control, self._output
        word, runs = control.word, not control.at_rest
        if self._session.may_run and control.stopping and control.confirmed_off:
            self._session.duty.channel(CONTROL_WORD, Happened.ANSWERED)
        if self._word is None or word == output.word and not output.word_due(now):
            return
        output.word_begun(word)
        write = self._transactor.write_now if control.stopping else self._transactor.write_first
        write(self._numbers.write(self._word, word),
              lambda sent, then: self._left(word, sent, then, runs=runs), now)

    def poll_soon(self, now: float) -> None:
        """Read the status now, unless that is under way: a word waits for it."""
        if now < self._watch.due < math.inf:
            self._poll(now)

    @property
    def due(self) -> float:
        """When the status is to be polled, or a word to be written again."""
        poll_at = self._watch.due
        return poll_at if self._word is None else min(poll_at, self._output.again_at)

    def handle_timer(self, now: float) -> None:
        """Do what is due."""
        self._watch.handle_timer(now)
        if self._word is not None and self._output.handle_timer(now):
            self._session.update_control_word(now)

    def _left(self, word: int, sent: bool, now: float, *, runs: bool) -> None:
        session, online = self._session, self._session.online
        if not sent:
            self._output.word_refused(word, now + REFUSED_PAUSE)
            return
        session.duty.channel(CONTROL_WORD, Happened.RUN_LEFT if runs else Happened.STOP_LEFT)
        self._invalidate()
        # of a drive that is lost, others see to the stop
        self._output.word_left(now, word, again=online)
        if online and session.stage is Stage.RUNNING:
            self._poll(now)
        session.control_changed(now)

    def _poll(self, now: float) -> None:
        """Read the status from now on; what was asked before does not count."""
        if self._status is not None:
            self._watch.start(self._poll_status(self._status, now), now)

    def _poll_status(self, status: Parameter, now: float) -> Script:
        while True:
            yield now
            raw = yield self._read(status)
            now = self._channel.now
            if self._transactor.asked_at <= self._control.word_left_at:
                continue
            self._session.interlock.status(raw, now)
            self._session.control_changed(now)
            if raw is not None and self._transactor.is_news(
                    self._transactor.asked_at, now):
                self._known(now)
            now += STATUS_PERIOD_PENDING if self._control.pending else STATUS_PERIOD

    def _read(self, status: Parameter) -> Procedure[int | None]:
        words = yield self._numbers.read(status)
        return None if words is None else status.raw_from_word(words[0])


class SetpointWriter:
    """
    Writes what is in ``cyclic_request`` of one polled drive.

    :param slot: of the control word in there; None: it has none.
    """

    def __init__(self, session: Session, exchange: PolledExchange, transactor: ParameterTransactor,
                 numbers: Numbers, output: AcyclicOutput, *, slot: int | None) -> None:
        self._session = session
        self._exchange = exchange
        self._transactor = transactor
        self._numbers = numbers
        self._slot = slot
        self._parameters = session.configuration.cyclic_request
        self._output = output

    def stop(self) -> None:
        """Plan nothing any more: nothing is known of the drive."""
        self._output.forget()

    def collect_due(self, now: float, *, unanswered: bool = False, known: bool = False) -> None:
        """
        Find out what is to be written.

        :param unanswered: what was asked a period ago still waits for its answer.
        :param known: the status was read just now, or there is none. A word that starts the drive
            is repeated only then: one that was off meanwhile, unseen, must not start by that.
        """
        self._session.interlock.expire(now)      # nothing is handed out that is too old
        control, slot, output = self._session.control, self._slot, self._output
        stopping = control is not None and control.stopping
        starts = control is not None and control.starts
        if slot is not None and output.word_due(now) and (
                stopping or not self._exchange.reading):
            output.failed(slot)
        uncertain = starts and (self._exchange.silent or unanswered)
        if starts and self._exchange.silent:
            output.restart()
        repeated = starts and control is not None and not (control.word_due or control.pulsing)
        hold = [slot] if uncertain or repeated and not known or self.holds_word(now) else []
        unknown = self._session.setpoints.unknown
        output.collect_due(self._raws(), now, hold=hold, unknown=[
            index for index, parameter in enumerate(self._parameters)
            if parameter.name in unknown] if unknown else ())
        if control is not None:
            # a word that starts the drive behind setpoints, also when all are only refreshed
            output.order_word(first=stopping or control.pulsing)

    def holds_word(self, now: float) -> bool:
        """Return whether the control word waits for setpoints."""
        return self._output.holds_word(again=self._output.word_due(now))

    def wants_status(self, now: float) -> bool:
        """Return whether a word that starts the drive is to be repeated, behind its status."""
        control, slot = self._session.control, self._slot
        return control is not None and slot is not None and (
            control.starts and not control.pulsing and self._output.wants(slot, control.word, now))

    def write(self, now: float) -> None:
        """Write one that is due, if there is one, with the value that it has now."""
        if not self._output.waiting or now < self._transactor.free_at:
            return
        self._session.interlock.expire(now)
        index = self._output.next()
        parameter, raw = self._parameters[index], self._raws()[index]
        # now: a neutral value that follows the axis may be another one when the frame leaves
        runs = raw != self._raws(neutral=True)[index]
        # What is sent cyclically is volatile: EEPROM parameters are refused by the configuration.
        self._transactor.write(
            ParameterWrite(self._numbers.number(parameter), self._numbers.words(parameter, raw),
                           eeprom=False),
            lambda sent, then: self._left(index, raw, sent, then, runs=runs), now)
        self._output.written(index, raw, now)

    def write_word(self, now: float, *, known: bool = False) -> None:
        """
        Write a control word that is due, or what it waits for, without waiting for a period.

        :param known: see :meth:`collect_due`.
        """
        self.collect_due(now, known=known)
        self.write(now)

    def write_again(self, since: float, now: float) -> bool:
        """
        Write what has left since then once more, but a word that starts the drive.

        :return: there was any.
        """
        control, slot = self._session.control, self._slot
        starts = control is not None and control.starts
        doubtful = self._output.invalidate(since, but=[slot] if starts else ())
        if doubtful:
            self.write_word(now)
        return doubtful

    def write_all(self, now: float) -> None:
        """Write all setpoints, whether they have changed or not, without waiting for a period."""
        self._output.write_all(but=[
            index for index, parameter in enumerate(self._parameters) if parameter.limit])
        self.write_word(now)

    def handle_timer(self, now: float) -> None:
        """Write what is due."""
        if self._slot is not None and self._output.handle_timer(now):
            self._session.update_control_word(now)
        self.write(now)

    @property
    def due(self) -> float:
        """When :meth:`handle_timer` wants to be called; infinity: never."""
        again_at = math.inf if self._slot is None else self._output.again_at
        return min(again_at, self._transactor.free_at) if self._output.waiting else again_at

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
                self._session.update_control_word(now)
            return
        if self._output.word_left(now, raw):
            self._session.control_changed(now)
