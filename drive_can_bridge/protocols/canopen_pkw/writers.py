# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a device is told: setpoints and control word while it is online, and the stop of both.

Both are written when they change, and again after a while what is in ``cyclic_request``. When they
are due, :mod:`..acyclic_output` knows; whether the drive got them, its answers say.

*Setpoints.* Neutral ones follow the word that stops a drive at once, and so does everything in the
stop, whatever is known of the node. One that takes back a command is repeated soon while nobody
answers where there is no such word.

*Control word.* A word that stops the drive may be executed twice: when its answer is missing, it
is written again soon, before anything else, and with every round from then on. Any other word is
read back first, and written again only if it is not there. Where it cannot be read back it is not
repeated, and the control machine gives up by itself. A word that the drive refuses ends what the
user wanted, with the reason that the drive gives. A refused ``disable`` is tried again and again:
a device under local control, say, takes it as soon as it is back under remote control.
"""

from collections import Counter
from collections.abc import Sequence
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.holding import Setpoint
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.process_image import control_word, status_word
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.core.stop_duty import CONTROL_WORD
from drive_can_bridge.protocols.acyclic_output import Acknowledged, AcyclicOutput
from drive_can_bridge.protocols.canopen_pkw.addresses import Placement
from drive_can_bridge.protocols.canopen_pkw.procedures import command, write_blind_until_answered
from drive_can_bridge.protocols.canopen_pkw.transactor import (
    MailboxChannel, Procedure, RegisterRead, RegisterWrite, Reply, Step)
from drive_can_bridge.protocols.channel import Priority, STOP_PATIENCE
from drive_can_bridge.protocols.polled_exchange import TOLERANCE
from drive_can_bridge.protocols.safe_stop import (
    SafeStop, StatusRead, STOP_ATTEMPTS, StopAgain, write_until_answered)
from drive_can_bridge.protocols.transactor import Answered, Refused, Silence

#: s that a stop may take all together: of a drive that answers, and of one that has fallen silent
STOP_TIME = 3.0
STOP_TIME_SILENT = 0.4
#: s until a ``disable`` that was refused is written again
RETRY_AFTER = 0.25


class Writers:
    """
    What writes to one drive.

    :ivar again: tells a drive to stop again that is offline and shows up.
    """

    def __init__(self, session: Session, channel: MailboxChannel) -> None:
        drive = session.configuration
        self._session = session
        self._channel = channel
        self._placement = Placement.of(drive)
        self._setpoints = session.setpoints
        word = self._word = control_word(drive, controlled=session.control is not None)
        self._slot = len(session.setpoints.items)       # of the word, behind them
        self._output = AcyclicOutput(
            session.control, Acknowledged(), self._slot + 1, slot=self._slot,
            refresh=drive.options.refresh_interval,
            lasting=() if word in drive.cyclic_request else (self._slot,))
        self._word_refusal = NOTHING            # why the drive does not take it
        self._failures: dict[str, str] = {}     # of setpoints, by name
        self._warned: dict[str, str] = {}
        self._silences = Counter[int]()         # in a row, by index
        self._made_room = False                 # for setpoints, in this round
        self._patience = STOP_PATIENCE          # s until a stop is written again
        self._stop: SafeStop[Step, Reply] = SafeStop(
            session, channel, session.stop_ended, status_word(drive), self._read_status)
        self.again = StopAgain(
            session, channel, self._stop, lambda now: self.stop(now, again=True))

    def forget(self) -> None:
        """Record that nothing is known of the drive."""
        self._output.forget()
        self._failures.clear()
        self._warned.clear()
        self._silences.clear()
        self._word_refusal = NOTHING

    def cancel(self) -> None:
        """Leave alone what is under way, but for a stop."""
        self._channel.cancel(Priority.SETPOINTS)
        self._channel.cancel(Priority.CONTROL)

    # -- while it is online -----------------------------------------------------------------------

    def write_control(self, now: float, *, known: bool) -> None:
        """
        Write a control word that has changed.

        :param known: the status was read just now, or there is none. A word that may start the
            drive is repeated only then: one that was off, unseen, must not start by that.
        """
        control, word, waits = self._session.control, self._word, self._output.holds_word()
        if control is not None and word is not None and not waits:
            self._update_word(word, control, now, known=known)
        if waits or self._setpoints.changed and not self._setpoints.enabled:
            self.write_setpoints(now)

    def write_setpoints(self, now: float, *, hold: Sequence[int] = ()) -> None:
        """
        Write the setpoints that are due, each once.

        :param hold: indices of those that are not to be written now.
        """
        self.expire(now)
        self._setpoints.changed = False
        items = self._setpoints.items
        if not items:
            return
        self._output.collect_due([setpoint.raw for setpoint in items], now, hold=hold, unknown=[
            index for index, setpoint in enumerate(items) if not setpoint.known])
        if self._output.waiting and self._channel.is_idle(Priority.SETPOINTS):
            self._channel.run(self._write_setpoints(), lambda _: None, now, Priority.SETPOINTS)

    def write_all_setpoints(self, now: float) -> None:
        """
        Write all setpoints at once, whether they have changed or not; others make room.

        No limit goes before them: each would wait for its answer.
        """
        limits = [index for index, setpoint in enumerate(self._setpoints.items)
                  if setpoint.parameter.limit]
        self._output.write_all(but=limits)
        self._channel.make_room(now)
        self.write_setpoints(now, hold=limits)

    def expire(self, now: float) -> bool:
        """
        Make setpoints neutral that are too old, before any of them is handed out.

        Others make room for those, once a round: a slow drive has to be read, too.
        """
        expired = self._session.interlock.expire(now)
        if expired and not self._made_room:
            self._made_room = True
            self._channel.make_room(now)
        return expired

    def round_begins(self) -> None:
        """Record that a round begins, in which others may make room once more."""
        self._made_room = False

    def _stops(self, index: int, setpoint: Setpoint) -> bool:
        """Return whether a setpoint, as it is now, takes back what was commanded."""
        return (setpoint.raw == setpoint.neutral and setpoint not in self._setpoints.held
                and self._session.duty.runs(index))

    def _write_setpoints(self) -> Procedure[None]:
        """
        Write what is due; what becomes due meanwhile waits: others have their turn first.

        But for what takes back a command, each once.
        """
        stopped: set[int] = set()
        for _ in range(self._output.waiting):
            if not self._output.waiting:  # they have to be held back since
                break
            index = self._output.next()
            if (yield from self._write_setpoint(index)):
                stopped.add(index)
        for index, setpoint in enumerate(self._setpoints.items):
            if index not in stopped and self._stops(index, setpoint):
                yield from self._write_setpoint(index)

    def _write_setpoint(self, index: int) -> Procedure[bool]:
        """Write one as it is then; return whether it was neutral."""
        setpoint = self._setpoints.items[index]
        raw, reply = yield from self._command_setpoint(index, setpoint)
        neutral = raw == setpoint.neutral and not setpoint.parameter.limit
        if isinstance(reply, Silence):
            self._output.failed(index)
            if self._silences[index] >= self._session.configuration.missed_limit:
                self._failed(setpoint, sentences.write_unanswered(setpoint.parameter.name),
                             neutral=neutral)
            return neutral
        del self._silences[index]
        if isinstance(reply, Refused):
            why = sentences.write_refused(setpoint.parameter.name, reply.text)
            self._failed(setpoint, why, neutral=neutral)
            if neutral:
                self._session.neutral_stop.refused(why)
            return neutral
        self._failures.pop(setpoint.parameter.name, None)
        if neutral:     # and acknowledged
            self._session.neutral_stop.left(setpoint.parameter.name)
            self._session.neutral_stop.answered()
        if self._output.has(index):
            self._session.update_control_word(self._channel.now)
        return neutral

    def _command_setpoint(self, index: int, setpoint: Setpoint) -> Procedure[tuple[int, Reply]]:
        """
        Write one until it is answered, or is not to be repeated.

        Where no control word stops the drive, what takes back a command is written again soon: as
        soon as an answer can be there, for requests must not pile up in a slow device.
        """
        since, timeout = self._channel.now, self._session.retry.timeout
        for left in range(STOP_ATTEMPTS - 1, -1, -1):
            self.expire(self._channel.now)
            raw, begun_at = setpoint.raw, self._channel.now
            alone = self._word is None and self._stops(index, setpoint)
            self._output.written(index, raw, begun_at)
            write = RegisterWrite.of(
                self._placement, setpoint.parameter, raw, blind=alone,
                timeout=min(self._patience, timeout) if alone and left > 0 else timeout)
            reply = yield from command(
                self._session.duty, index, write, runs=raw != setpoint.neutral)
            if not isinstance(reply, Silence):
                self._patience = max(STOP_PATIENCE, 2.0 * (self._channel.now - since))
                break
            # what had less time than a slow device may take was no silence
            self._silences[index] += reply.sent and (
                self._channel.now >= begun_at + timeout - TOLERANCE)
            if self._word is not None or not self._stops(index, setpoint):
                break
        return raw, reply

    def _failed(self, setpoint: Setpoint, text: Sentence, *, neutral: bool) -> None:
        """
        Record a setpoint that the drive does not take.

        :param neutral: it is the neutral one: a drive that is enabled would run on.
        """
        session, name = self._session, setpoint.parameter.name
        control, now = session.control, self._channel.now
        if self._warned.get(name) != text:  # once: commands may go to and fro
            session.report.warn(sentences.write_failed(text),
                                may_run=neutral and control is None and session.stop_pending)
        self._warned[name] = self._failures[name] = text
        if control is None:
            return
        if self._output.holds_word():
            control.word_refused(control.word, sentences.word_held_back(text), now)
        elif neutral and control.operating:
            control.drop(sentences.neutral_not_taken(text))
        else:
            return
        session.control_changed(now)

    # -- the control word -------------------------------------------------------------------------

    def _update_word(self, parameter: Parameter, control: ControlMachine, now: float, *,
                     known: bool) -> None:
        """Write the word if the drive does not have it, or not lately; see write_control."""
        word, output = control.word, self._output
        if not output.wants(self._slot, word, now) and not output.word_due(now):
            return
        repeated = output.last_written(self._slot) == word or control.operating
        if repeated and not known and word != control.table.disable:
            return
        if control.stopping and word != output.word:    # once for each stop
            self._channel.make_room(now)
        if self._channel.is_idle(Priority.CONTROL):
            self._channel.run(
                self._write_word(parameter, control), lambda _: None, now, Priority.CONTROL)

    def _write_word(self, parameter: Parameter, control: ControlMachine) -> Procedure[None]:
        """Write the newest word until it is answered, or has to wait after silence."""
        output, unanswered = self._output, 0
        while not output.holds_word():
            word, stopping = control.word, control.stopping
            if word == output.word and output.last_written(self._slot) is None and not stopping:
                there = yield from self._read_back(parameter, word)
                if there is None:
                    return
                if there:
                    output.written(self._slot, word, self._channel.now)
                    self._word_arrived(word)
                    if word == control.word:
                        return
                    continue
                word, stopping = control.word, control.stopping
            # the last has the time that any request has: a slow device is no silent one
            again = stopping and unanswered < STOP_ATTEMPTS - 1
            timeout = min(STOP_PATIENCE, self._session.retry.timeout) if again else None
            output.written(self._slot, word, self._channel.now)
            reply = yield from command(
                self._session.duty, CONTROL_WORD,
                RegisterWrite.of(self._placement, parameter, word, blind=stopping,
                                 timeout=timeout),
                runs=word != control.table.disable)
            if isinstance(reply, Silence):
                unanswered += stopping
                output.failed(self._slot)
                if not reply.sent:      # as if it had not been begun
                    output.word_refused(word, self._channel.now)
                if word == control.word and not again:
                    if stopping:
                        self._warn_of_silence(parameter, word)
                    return
                continue
            if isinstance(reply, Refused):
                self._take_refusal(parameter, control, word, reply.text)
            else:
                self._word_refusal = NOTHING
                self._word_arrived(word)
            if word == control.word:
                return

    def _read_back(self, parameter: Parameter, word: int) -> Procedure[bool | None]:
        """Return whether the drive has a word that was not answered; None: unknown."""
        if not parameter.readable:
            return None
        span = self._placement.span(parameter)
        reply = yield RegisterRead(span.address, span.count, attempts=1)
        if not isinstance(reply, Answered):
            return None
        found = self._placement.raw(parameter, reply.content)
        return parameter.word_from_raw(found) == parameter.word_from_raw(word)

    def _word_arrived(self, word: int) -> None:
        """Record that the drive has a word."""
        if self._output.word_left(self._channel.now, word):
            self._session.control_changed(self._channel.now)

    def _take_refusal(self, parameter: Parameter, control: ControlMachine, word: int,
                      reason: Sentence) -> None:
        now = self._channel.now
        text = sentences.write_refused(f'{parameter.name} {word:04X}h', reason)
        if text != self._word_refusal:
            self._session.report.warn(sentences.write_failed(text))
        self._word_refusal = text
        if word == control.table.disable:
            self._output.again_at = now + RETRY_AFTER
        control.word_refused(word, reason, now)
        self._session.control_changed(now)

    def _warn_of_silence(self, parameter: Parameter, word: int) -> None:
        """Warn that a word that stops the drive is not acknowledged, once until one is."""
        text = sentences.write_unanswered(f'{parameter.name} {word:04X}h')
        if text != self._word_refusal:
            self._session.report.warn(
                sentences.write_failed(text), may_run=self._session.stop_pending)
        self._word_refusal = text

    # -- stopping ---------------------------------------------------------------------------------

    @property
    def stop_time(self) -> float:
        """How many s a stop may take that somebody waits for."""
        return STOP_TIME if self._session.online else STOP_TIME_SILENT

    def stop(self, now: float, *, again: bool = False) -> None:
        """
        Stop the drive: in the end, or because it is offline.

        In the end, what failed is told even if the drive was not told to run. Otherwise nobody
        waits for the end of the stop: the last attempt has the time that any request has, for a
        device may be slow.

        :param again: a stop before this one has failed, which was told, and the drive has shown
            up. What looks for it goes on, so that nothing makes room; no other stop is under way.
        """
        writes, patience = self._stop.writes(), self._session.retry.timeout
        if not again:
            self._channel.cancel(Priority.STOP)
            self._channel.make_room(now)
        timeout = min(patience, STOP_PATIENCE if again else (
            self.stop_time / (STOP_ATTEMPTS * max(1, len(writes)))))
        ends = not self._session.active
        self._stop.begin(write_until_answered(writes, lambda each: write_blind_until_answered(
            self._placement, each, timeout, timeout if ends else patience)),
            now, always_report=ends, again=again)

    def _read_status(self, status: Parameter, timeout: float) -> StatusRead[Step, Reply]:
        span = self._placement.span(status)
        reply = yield RegisterRead(span.address, span.count, attempts=1, timeout=timeout)
        return self._placement.raw(status, reply.content) if isinstance(reply, Answered) else None

    # -- what the drive refuses -------------------------------------------------------------------

    def control_refusal(self, action: ControlAction, refusal: Sentence) -> Sentence:
        """Return why a control action cannot be asked for, besides the usual."""
        if action is ControlAction.ENABLE:
            for setpoint in self._setpoints.held:  # the drive has another position
                failed = self._failures.get(setpoint.parameter.name)
                if failed:
                    return sentences.would_jump(sentences.write_failed(failed))
        return refusal

    def warnings(self) -> list[Sentence]:
        """Return what the drive refuses, and what to do."""
        texts = [sentences.setpoint_not_taken(text) for text in self._failures.values()]
        if self._word_refusal:
            texts.append(sentences.word_not_taken(self._word_refusal))
        return texts


class ExpiryWatch:
    """The part of a session that takes back commands that are too old, whatever is being read."""

    def __init__(self, session: Session, writers: Writers) -> None:
        self._session, self._writers = session, writers

    @property
    def due(self) -> float:
        """When ages are to be checked; infinity: no commands while lost or stopped."""
        running = self._session.stage is Stage.RUNNING
        return self._session.setpoints.expires_at if running else math.inf

    def handle_timer(self, now: float) -> None:
        """Write what goes neutral now."""
        if self._writers.expire(now):
            self._writers.write_setpoints(now)

    def stop(self) -> None:
        """Do nothing: the stage says it."""
