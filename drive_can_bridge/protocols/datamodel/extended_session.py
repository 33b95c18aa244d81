# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with one DataModel drive that uses 29-bit identifiers.

Its lifecycle (:meth:`ExtendedSession._script`) is one sequence, restarted whenever the drive is
lost, the bus is back, or the process stalled:

.. code-block:: text

    read the maps ─nobody answers─► again
        │      └──differ──► stop, tell or rewrite, look again
        ▼ agree
    where are the axes that have to stay there ─not said─► again
        ▼
    cycles begin; look at the maps once a second

Whatever was told to run is told to stop: by neutral cycles where the request map is known to
agree, otherwise by acyclic writes (:mod:`.acyclic_side`), whatever the session is about to do
next.

A drive reads cyclic words by *its own* maps. So the maps are read before the first cyclic frame,
every second while cycling, and again after each loss; a drive that does not answer gets no cyclic
frames beyond three with neutral setpoints, in case it only lost its voice. One that was told to
run and has not answered those either is told to stop by number, and again when it shows a sign of
life. With ``mapping: assume`` maps are never read, and cycling never stops.

With ``mapping: configure`` a difference is followed by a rewrite, and the rewrite by another look:
nothing is believed that was not read. Map entries are kept in EEPROM, whose cells wear. So the
pause before the next rewrite doubles from one to the next, whether it failed or was undone by
somebody else, until the maps have been right for a minute.
"""

from collections.abc import Generator
import math
from typing import Any

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.events import (
    DriveState, MappingDiffered, MappingWritten, ProcessDataReceived)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.reporter import AdviceKind
from drive_can_bridge.core.roles import Roles
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.core.stop_duty import CONTROL_WORD, CYCLE, Do, Happened
from drive_can_bridge.protocols.answers import CycleAnswers
from drive_can_bridge.protocols.cyclic_exchange import CyclicExchange
from drive_can_bridge.protocols.datamodel import extended, procedures
from drive_can_bridge.protocols.datamodel.acyclic_side import AcyclicSide, map_cells
from drive_can_bridge.protocols.datamodel.options import differences, effective
from drive_can_bridge.protocols.datamodel.process_words import CyclicCodec
from drive_can_bridge.protocols.datamodel.transactor import Procedure
from drive_can_bridge.protocols.lifecycle import Lifecycle, Script

#: direction and station of an identifier
FROM_WHOM = extended.DIR | extended.STATION_MASK
#: s between two looks at the maps
POLL_PERIOD = 1.0
#: longest pause between map rewrites
REWRITE_PAUSE_MAX = 60.0
#: so many looks at the maps in a row may go unanswered until that is told
SILENT_POLLS = 3
#: s until a position that a setpoint cannot carry is read again
POSITION_PAUSE = 0.1
#: all setpoints go by cycles: what the output of acyclic writes knows them as
_CYCLE = 0


class ExtendedSession(Session):
    """Mapping check, cyclic exchange, and the acyclic frames between its cycles."""

    def __init__(self, drive: DriveConfiguration) -> None:
        table = drive.profile.control
        station, options = drive.station, drive.options
        strict: bool = options.length_policy == 'strict'
        control = None if table is None else ControlMachine(table, timeout=drive.control_timeout)
        super().__init__(drive, control, roles=Roles(
            drive, controlled=table is not None, maps=map_cells(options)))
        self._side = AcyclicSide(self, extended.ExtendedAcyclicCodec(station, strict),
                                 invalidate=lambda: self._answers.book.invalidate())
        self._channel = self._side.channel
        self._verify: bool = options.mapping != 'assume'
        self._codec = CyclicCodec(
            station, drive.cyclic_request, drive.cyclic_response,
            control_slot=self._side.control_slot, strict=strict)
        self._request_identifier = self._codec.request_identifier
        self._response_identifier = self._codec.response_identifier
        numbers = self._side.numbers
        self._map_bases = (options.request_map_base + numbers.offset,
                           options.response_map_base + numbers.offset)
        self._wanted = (numbers.numbers(drive.cyclic_request),
                        numbers.numbers(drive.cyclic_response))
        self._rewrites: bool = options.mapping == 'configure'
        if not self._rewrites:
            self.remedy = sentences.maps_to_correct
        self.encode_cycle = self._codec.encode_request
        self._answers: CycleAnswers = CycleAnswers(self, silence='no cyclic response')
        self._exchange = CyclicExchange(self._answers, self, slot=self._side.control_slot)
        self._answers.confirms = not self._verify      # otherwise the maps tell who has heard it
        self._answers.by_number = (
            control is not None and self._side.control_slot is None and not control.unseen)
        self._lifecycle = Lifecycle(self._channel)
        self.set_parts(self._exchange, self._lifecycle, *self._side.parts, channel=self._channel)
        self._differs = False       # what the last look at the maps found
        self._unread = NOTHING      # nobody knows whether the maps are still right
        self._reported = NOTHING        # which difference
        self._rewritten_at, self._pause = -math.inf, POLL_PERIOD

    # -- life cycle -------------------------------------------------------------------------------

    def prepare_stop(self, now: float) -> bool:
        self._side.clear()
        self._lifecycle.stop()
        self._judge_word(unseen=True)
        pending = self.duty.happened(Happened.ENDS) is Do.STOP
        return self._exchange.cycling or (self.stage is not Stage.IDLE and pending)

    def lose(self, reason: Sentence, now: float) -> None:
        self._judge_word()
        super().lose(reason, now)

    def bus_down(self, now: float, reason: str) -> None:
        self._judge_word(unseen=True)
        super().bus_down(now, reason)

    def _judge_word(self, *, unseen: bool = False) -> None:
        """
        Record a drive that answers cycles, as if it had heard its word, but runs on.

        :param unseen: or has not been seen to stand since that left.
        """
        if self.control is not None and self._answers.by_number:
            if self.control.unconfirmed:
                self.duty.channel(CONTROL_WORD, Happened.RUN_LEFT)
            elif unseen and not self.control.confirmed_off:
                self.duty.channel(CONTROL_WORD, Happened.MISROUTED)

    def begin_stop(self, now: float) -> bool:
        if self._exchange.cycling:
            self._exchange.stop_soon(now)
        self._side.begin_stop(now, setpoints=not self._exchange.cycling)
        return self._exchange.cycling or self._side.stop.running

    @property
    def longest_stop(self) -> float:
        by_number = self._side.longest_stop(setpoints=not self._exchange.cycling)
        return by_number + (self._exchange.longest_stop if self._exchange.cycling else 0.0)

    def handle_stall(self, now: float) -> None:
        # no answer to a stop that just left will come; with assumed maps, its cycles go on
        if (self._verify and self.stage is Stage.RUNNING and self.unacknowledged
                and not self.stop_pending):
            self.duty.happened(Happened.SILENT)
        super().handle_stall(now)

    def begin(self, now: float) -> None:
        self._exchange.stop()
        self._differs = self._side.shows_up = False
        if self.duty.happened(Happened.STARTED) is Do.STOP:
            self._side.begin_stop(now, setpoints=self._verify)
        self._lifecycle.start(self._script(now), now)

    def fall_silent(self) -> None:
        super().fall_silent()
        self._side.clear()
        self._differs = False

    # -- the script of a drive --------------------------------------------------------------------

    def _script(self, now: float) -> Script:
        """Poll the maps, for ever; cycle while they agree."""
        exchange, self._unread = self._exchange, NOTHING
        agreed = differed = False   # what the look before found
        silent_polls = 0            # so many in a row went unanswered
        while self._verify:
            maps: procedures.Maps | None = yield procedures.read_maps(
                *self._map_bases, needed=self._wanted[0] if agreed else None)
            now = self._channel.now
            poll_at = now + POLL_PERIOD
            found = '' if maps is None else '; '.join(differences(
                maps.request, maps.response,
                wanted_request=self._wanted[0], wanted_response=self._wanted[1]))
            if maps is not None and found:
                self._differ(found, maps, now, again=differed)
                agreed, differed, silent_polls = False, True, 0
                poll_at = yield from self._make_fit(found, poll_at)
            elif maps is None or maps.response is None:
                differed, silent_polls = False, silent_polls + 1
                if exchange.leaving and not self._differs:
                    return      # who starts over follows the last of the cycles
                if not exchange.cycling:
                    self._nobody_answers(now)
                    if silent_polls >= SILENT_POLLS:    # what they were says nothing any more
                        self._differs, self._reported = False, NOTHING
                    poll_at = now   # paced by the time-out of the read
                elif silent_polls >= SILENT_POLLS and not exchange.leaving:
                    # there, the cyclic answers tell who is there
                    self._unread = sentences.maps_unknown(silent_polls)
                    if silent_polls == SILENT_POLLS:
                        self.report.warn(self._unread)
            else:
                agreed, differed, silent_polls = True, False, 0
                self._differs, self._unread, self._reported = False, NOTHING, NOTHING
                if now - self._rewritten_at > REWRITE_PAUSE_MAX:
                    self._pause = POLL_PERIOD
                if exchange.cycling and not exchange.leaving:
                    transactor = self._side.transactor
                    # a look that was under way when the stop left shows nothing of it
                    if (self.online and self._answers.book.stop_shown
                            and transactor.asked_at > transactor.wrote_at):
                        self._answers.stop_answered()
                elif exchange.leaving and self.setpoints.held:
                    pass    # a stop takes its course
                elif (yield from self._find_axes(poll_at)):
                    self._start_cycling(self._channel.now)
                elif self._channel.now < poll_at:   # it has not answered, and may have
                    agreed = False                  # restarted meanwhile, with other maps
                    self._side.again.sign_of_life(self._channel.now, answered=True)
                    continue
            yield poll_at
        # a drive that was told to run has to be told ``disable``, whatever is known of its axes
        if not self.setpoints.known and (
                not self.setpoints.ever_known or self.interlock.position_unknown):
            yield from self._find_axes(math.inf)
            now = self._channel.now
        self._start_cycling(now)

    def _find_axes(self, until: float) -> Generator[Any, Any, bool]:
        """Read the positions that axes have to keep; False: unknown until then."""
        setpoints = self.setpoints
        if not setpoints.known:
            self._exchange.timer.stop()
        while not setpoints.known:
            raws = yield self._positions()
            for setpoint, raw in zip(setpoints.held, raws or ()):
                setpoints.changed |= setpoint.measure(raw)
            if not setpoints.unknown:
                break
            self.report.advise(setpoints.untold_text)
            if raws is None and self._verify:
                return False
            now = self._channel.now     # without an answer, the time-out of the read is the pace
            if raws is not None:        # but the setpoint cannot carry it
                now = yield min(now + POSITION_PAUSE, until)
            if now >= until:
                return False
        return True

    def _positions(self) -> Procedure[list[int] | None]:
        raws: list[int] = []
        for setpoint in self.setpoints.held:
            words = yield self._side.numbers.read(setpoint.measured)
            if words is None:
                return None
            raws.append(setpoint.measured.raw_from_word(words[0]))
        return raws

    def _differ(self, text: str, maps: procedures.Maps, now: float, *, again: bool) -> None:
        """
        Stop a drive that takes our cycles for something else.

        :param again: the look before found a difference, too.
        """
        exchange, self._differs, self._unread = self._exchange, True, NOTHING
        # cyclic requests reach what they are meant for, and the map stays as it is
        routed = effective(maps.request) == self._wanted[0] and not self._rewrites
        if not routed:
            self.duty.channel(CYCLE, Happened.MISROUTED)
        elif again and not exchange.cycling:    # its last cycles have reached what they were for
            self.duty.happened(
                Happened.ANSWERED if self._answers.book.stop_shown else Happened.SILENT)
        do = self.duty.happened(Happened.MAPS_DIFFER)
        self.lose(sentences.mapping_differs(text), now)
        # a request map that is right still takes neutral cycles, unless it is to be rewritten
        by_cycles = do is Do.STOP and routed and not self.interlock.position_unknown
        if do is not Do.NOTHING:
            self._side.begin_stop(now, setpoints=not by_cycles)
        if not by_cycles:
            exchange.stop()
            return
        self._answers.book.expect_nothing()
        if not exchange.leaving:
            exchange.run_out(max(now, exchange.timer.began_at + exchange.timer.stop_spacing))

    def _make_fit(self, found: str, poll_at: float) -> Generator[Any, Any, float]:
        """Rewrite maps that differ, or report them, as configured; return when to poll again."""
        if not self._rewrites:
            self._report_difference(sentences.maps_found(found))
            return poll_at
        if self._channel.now < self._rewritten_at + self._pause:
            self._report_difference(sentences.maps_wait(found, self._pause))
        elif (yield self._rewrite()):
            return self._channel.now
        return self._rewritten_at + self._pause

    def _rewrite(self) -> Procedure[bool]:
        """Rewrite the maps, and note it even if the script has ended since: cells wear."""
        if self._rewritten_at > -math.inf:
            self._pause = min(2 * self._pause, REWRITE_PAUSE_MAX)
        request, response = self._wanted
        failure, kept = yield from procedures.write_maps(
            *self._map_bases, request=request, response=response)
        self._rewritten_at = self._channel.now
        self.remedy = sentences.drive_to_correct if failure and kept else sentences.maps_not_kept
        if failure:
            self._report_difference(sentences.maps_not_written(failure))
        else:
            self.report.note(MappingWritten(sentences.maps_written(request, response)))
            self._reported = NOTHING
        return not failure

    def _report_difference(self, text: Sentence) -> None:
        """Report a difference, once."""
        self.report.advise(sentences.mapping_differs(text), AdviceKind.MAPPING)
        if text != self._reported:
            self._reported = text
            self.report.note(MappingDiffered(text))

    def _nobody_answers(self, now: float) -> None:
        self.report.guess(sentences.maps_unread())
        if self._side.shows_up:     # and answers a part of what it is asked
            self._side.shows_up = False
            self._side.again.sign_of_life(now, answered=True)

    # -- cyclic exchange --------------------------------------------------------------------------

    def _start_cycling(self, now: float) -> None:
        self._answers.book.forget_asked()
        self._exchange.start(now, in_turn=True)
        self.report.guess(sentences.cycles_unanswered())

    def send_cycle(self, request: Frame, now: float) -> None:
        self._exchange.put(request)
        self._exchange.expect_answer(now)
        # of one that is silent for as long as that nobody knows that it still has a request
        self._channel.hold(now + min(0.5 * self.configuration.period, self.retry.timeout))

    def last_cycle_left(self, now: float) -> None:
        if self.stage is Stage.STOPPING:
            self._exchange.timer.stop()
            if self._side.control_slot is not None and not self._answers.book.missed_in_row:
                self._side.stop.poll(now)
            self.stop_ended()
        elif self._differs:
            self._exchange.stop()

    def stop_ended(self) -> None:
        if (self.stage is Stage.STOPPING and not self._side.stop.running
                and (self._exchange.cycles_left == 0 or not self._exchange.cycling)):
            self._exchange.mark_silent()
            self.stop_left()

    def exchange_missed(self, reason: Sentence, now: float) -> None:
        if self._exchange.leaving:
            if self._exchange.cycles_left == 0:
                # if nobody answers any more: next it is told by number
                self.duty.happened(Happened.SILENT)
                self.restart(now)
            return
        if not reason:
            return
        self._answers.forget()
        if self._verify and not self.online:
            self.restart(now)
            return
        happened = Happened.LOST if self.online else Happened.UNANSWERED
        self.lose(reason, now)
        do = self.duty.happened(happened)
        if do is not Do.NOTHING:    # setpoints that heard cycles go neutral with the next
            self._side.begin_stop(now, setpoints=do is Do.STOP_BY_NUMBER)
        if self.interlock.position_unknown:
            self.restart(now)
        elif self._verify:  # it may still be listening, before it is left alone
            self._exchange.run_out(self._exchange.timer.due)

    # -- frames from the drive --------------------------------------------------------------------

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        if frame[0] == self._response_identifier:
            self._receive_cyclic(frame[1], now, now - age)
            return
        if frame.extended and frame.identifier & FROM_WHOM == self._request_identifier & FROM_WHOM:
            self._side.foreign_master(frame)
        else:
            self._side.receive(frame, now, age)

    def _receive_cyclic(self, data: bytes, now: float, received_at: float) -> None:
        """Handle a cyclic response. The fast path of the reader."""
        if not self._answers.expects('cyclic response', now, received_at):
            self._exchange.wait_out(now)
            return
        raws, wrong = self._codec.decode_response(data)
        if wrong:
            self.report.reject(sentences.bad_cyclic_response(wrong))
            if not raws:
                return
        elif len(data) != extended.PAYLOAD:
            self.statistics.short += 1
        self._answers.answered(received_at)
        if not self.online and self.stage is Stage.RUNNING:
            if self._exchange.leaving:
                if not self._differs:  # it is back: look at its maps before anything else
                    self.restart(now)
                return
            self.be_online()
            if self._verify:    # a neutral cycle, right after a look at its maps; what was
                self.duty.channel(CYCLE, Happened.ANSWERED)     # written it may have missed
            self._side.found(now)
        slot = self._side.status_slot
        # by number, a word may have left since this was asked for
        if self.control is not None and slot is not None and (
                self._side.control_slot is not None
                or self._answers.book.began_at > self.control.word_left_at):
            self.interlock.status(raws[slot] if slot < len(raws) else None, now)
            self.control_changed(now)
        if self._answers.book.stop_shown and self._side.output.has(_CYCLE):
            self.update_control_word(now)
        self.interlock.measured(raws)
        self.report.note(ProcessDataReceived(raws, received_at))
        self._channel.release(now)
        self._exchange.wait_out(now)

    # -- control ----------------------------------------------------------------------------------

    def withdrawn(self, now: float) -> None:
        super().withdrawn(now)
        self._side.withdrawn()

    def hand_out_neutral(self, now: float) -> None:
        self._exchange.hand_out_neutral(now)

    def update_control_word(self, now: float) -> None:
        if self.stage is Stage.STOPPING:
            return
        writer = self._side.control_writer
        exchange = self._exchange
        if (writer is not None and self._side.control_slot is None
                and (self.online or exchange.cycling and not exchange.leaving)
                and not self._lacks_neutral(now)):
            writer.update(now)
        exchange.hurry(now, setpoints=True)

    def _lacks_neutral(self, now: float) -> bool:
        """Return whether a word that starts the drive waits for the answer to a neutral cycle."""
        output = self._side.output
        lacks = output.holds_word(again=output.word_due(now))
        if lacks and output.last_written(_CYCLE) is None:
            output.written(_CYCLE, 0, now)
            self._exchange.hand_out_neutral(now)
        return lacks

    # -- state ------------------------------------------------------------------------------------

    def facts(self) -> dict[str, str]:
        return {'short_frames': str(self.statistics.short)}

    @property
    def unacknowledged(self) -> bool:
        return super().unacknowledged and not self._answers.book.stop_shown

    @property
    def warning(self) -> Sentence:
        return NOTHING if self._exchange.leaving else self._unread

    @property
    def state(self) -> DriveState:
        if self._differs:
            return DriveState.MAPPING_DIFFERS
        return super().state
