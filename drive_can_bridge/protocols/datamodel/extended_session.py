# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with one DataModel drive that uses 29-bit identifiers.

.. code-block:: text

    IDLE ──activate, bus up──► CHECKING ──maps agree──► CYCLIC ──missed_limit──► LEAVING
      ▲                         ▲  │ ▲                    │                        │
      │                         │  └─┼──maps differ──► DIFFERS (looks again in 1 s) │
      └──deactivate / bus down──┘    └─────────3 neutral cycles, then silence──────┘

Whatever was told to run is told to stop: by neutral cycles where the request map is known to
agree, otherwise by acyclic writes (:mod:`.acyclic_side`), whatever the session is about to do
next.

A drive reads cyclic words by *its own* maps. So the maps are read before the first cyclic frame,
every second while cycling, and again after each loss; a drive that does not answer gets no cyclic
frames beyond three with neutral setpoints, in case it only lost its voice. One that was told to
run and has not answered those either is told to stop by number, and again when it shows a sign of
life. With ``mapping: assume`` there is neither CHECKING nor LEAVING: cycling never stops.
"""

from enum import Enum
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.drive_state import DriveState
from drive_can_bridge.core.events import Event, MappingDiffered, ProcessDataReceived
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.roles import Roles
from drive_can_bridge.core.sentences import NOTHING, Sentence
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.core.stop_duty import CYCLE, Do, Happened
from drive_can_bridge.protocols.cyclic_exchange import CyclicExchange
from drive_can_bridge.protocols.datamodel import extended
from drive_can_bridge.protocols.datamodel.acyclic_side import AcyclicSide, map_cells
from drive_can_bridge.protocols.datamodel.map_supervision import (
    MapSupervision, SILENT_LOOKS, Verdict,
)
from drive_can_bridge.protocols.datamodel.positions import Positions
from drive_can_bridge.protocols.datamodel.process_words import CyclicCodec

#: direction and station of an identifier
FROM_WHOM = extended.DIR | extended.STATION_MASK


class Phase(Enum):
    """How far the session has come with its drive."""

    IDLE = 'idle'
    CHECKING = 'checking the maps'
    DIFFERS = 'maps differ'
    CYCLIC = 'cycling'
    LEAVING = 'last neutral cycles'


class ExtendedSession(Session):
    """Mapping check, cyclic exchange, and the acyclic frames between its cycles."""

    def __init__(self, drive: DriveConfiguration) -> None:
        table = drive.profile.control
        station, options = drive.station, drive.options
        strict: bool = options.length_policy == 'strict'
        control = None if table is None else ControlMachine(table, timeout=drive.control_timeout)
        super().__init__(drive, control, roles=Roles(
            drive, controlled=table is not None, maps=map_cells(options)))
        self._side = AcyclicSide(
            self,
            encode_read=lambda number, count: extended.encode_read_request(
                station, number, count),
            encode_write=lambda number, words: extended.encode_write(station, number, words),
            decode=lambda frame, step: extended.decode_answer(
                frame, station, None if step is None else step.key, strict=strict),
            together=extended.SLOTS, stop_ended=self._stop_ended)
        self._channel = self._side.channel
        self._verify: bool = options.mapping != 'assume'
        self._codec = CyclicCodec(
            station, drive.cyclic_request, drive.cyclic_response,
            control_slot=self._side.control_slot, strict=strict)
        self._request_identifier = self._codec.request_identifier
        self._response_identifier = self._codec.response_identifier
        numbers = self._side.numbers
        self._maps = MapSupervision(
            self._channel, request_base=options.request_map_base + numbers.offset,
            response_base=options.response_map_base + numbers.offset,
            request=numbers.numbers(drive.cyclic_request),
            response=numbers.numbers(drive.cyclic_response),
            rewrite=options.mapping == 'configure',
            emit=self._maps_reported, judged=self._maps_judged)
        self._positions = Positions(
            self, self._channel, numbers, known=self._start_cycling, again=self._look_again,
            # it may have started anew meanwhile, with other maps
            silent=self._axes_unknown if self._verify else None)
        self._exchange = CyclicExchange(
            self, self._codec.encode_request, self._send_cycle, slot=self._side.control_slot,
            silence='no cyclic response', missed=self._missed, ended=self._last_cycle_left,
            heeded=not self._verify)    # otherwise the maps tell who has heard it
        self.look_after(self._exchange, self._maps, self._positions, *self._side.parts,
                        channel=self._channel)
        self._phase = Phase.IDLE
        self._differs = False  # what the last look at the maps found

    # -- life cycle -------------------------------------------------------------------------------

    @property
    def _cycling(self) -> bool:
        return self._phase in (Phase.CYCLIC, Phase.LEAVING)

    def prepare_stop(self, now: float) -> bool:
        self._side.clear()
        self._positions.stop()
        self._maps.stop()
        owes = self.duty.happened(Happened.ENDS) is Do.STOP
        return self._cycling or (self.stage is not Stage.IDLE and owes)

    def begin_stop(self, now: float) -> bool:
        if self._cycling:
            self._exchange.stop_soon(now)
        self._side.begin_stop(now, setpoints=not self._cycling)
        return self._cycling or self._side.stop.running

    @property
    def longest_stop(self) -> float:
        by_number = self._side.longest_stop(setpoints=not self._cycling)
        return by_number + (self._exchange.longest_stop if self._cycling else 0.0)

    def begin(self, now: float) -> None:
        self._exchange.stop()
        self._differs = self._side.shows_up = False
        if self.duty.happened(Happened.STARTED) is Do.STOP:
            self._side.begin_stop(now, setpoints=self._verify)
        if self._verify:
            self._phase = Phase.CHECKING
            self._maps.look_afresh(now)
        else:
            self._begin_cycles(now)

    def fall_silent(self) -> None:
        super().fall_silent()
        self._side.clear()
        self._phase = Phase.IDLE
        self._differs = False

    # -- maps -------------------------------------------------------------------------------------

    def _maps_judged(self, verdict: Verdict, text: str, now: float) -> None:
        if verdict is Verdict.AGREE:
            self._differs = False
            if self._phase is not Phase.CYCLIC:
                self._begin_cycles(now)
            elif self.online:
                self.duty.happened(Happened.ANSWERED)
        elif verdict is Verdict.DIFFER:
            self._differs = True
            self.duty.channel(CYCLE, Happened.MISROUTED)
            do = self.duty.happened(Happened.MAPS_DIFFER)
            self.lose(sentences.mapping_differs(text), now)
            # a request map that is right still takes neutral cycles, unless it is to be rewritten
            by_cycles = (
                do is Do.STOP and self._maps.request_agrees and not self.gate.mute)
            if do is not Do.NOTHING:
                self._side.begin_stop(now, setpoints=not by_cycles)
            if by_cycles:
                self._exchange.book.expect_nothing()
                if self._phase is not Phase.LEAVING:
                    self._phase = Phase.LEAVING
                    timer = self._exchange.timer
                    self._exchange.run_out(max(now, timer.began_at + timer.stop_spacing))
            else:
                self._phase = Phase.DIFFERS
                self._exchange.stop()
        elif self._phase is Phase.LEAVING:
            self._maps.look_at = math.inf  # that comes after the last neutral cycle
        elif self._phase is Phase.CYCLIC:  # there, the cyclic answers tell who is there
            if self._maps.silent_looks == SILENT_LOOKS:
                self.report.warn(self._maps.unknown)
        else:
            self._phase = Phase.CHECKING
            self.report.advice = sentences.maps_unread()
            self._maps.look_at = now  # paced by the time-out of the read
            if self._side.shows_up:   # and answers a part of what it is asked
                self._side.shows_up = False
                self._side.again.heard(now, answered=True)

    def _maps_reported(self, event: Event) -> None:
        if isinstance(event, MappingDiffered):
            self.report.advice = sentences.mapping_differs(event.text)
        self.report.note(event)

    # -- cyclic exchange --------------------------------------------------------------------------

    def _begin_cycles(self, now: float) -> None:
        """Begin to cycle, as soon as it is known where axes are that have to stay there."""
        if self.setpoints.held and self._phase is Phase.LEAVING:
            return  # a stop takes its course
        # a drive that was told to run has to be told ``disable``, whatever is known of its axes
        at_once = self.setpoints.ever_known and not self._verify and not self.gate.mute
        if self.setpoints.known or at_once:
            self._start_cycling(now)
        else:
            self._phase = Phase.CHECKING
            self._exchange.timer.stop()
            self._positions.read(now)

    def _look_again(self, now: float) -> None:
        if self._phase is Phase.CHECKING:
            self._begin_cycles(now)

    def _axes_unknown(self, now: float) -> None:
        """Handle a drive whose maps agree, but that does not say where its axes are."""
        self._side.again.heard(now, answered=True)
        self._maps.look_afresh(now)

    def _start_cycling(self, now: float) -> None:
        self._phase = Phase.CYCLIC
        self._exchange.book.forget_asked()
        self._exchange.start(now, in_turn=True)
        self.report.advice = sentences.cycles_unanswered()

    def _send_cycle(self, request: Frame, now: float) -> None:
        self._exchange.put(request)
        self._exchange.expect_answer(now)
        self._channel.hold(now + 0.5 * self.configuration.period)

    def _last_cycle_left(self, now: float) -> None:
        if self.stage is Stage.STOPPING:
            self._exchange.timer.stop()
            if self._side.control_slot is not None and not self._exchange.book.missed_in_row:
                self._side.stop.look(now)
            self._stop_ended()
        elif self._differs:
            self._exchange.stop()
            self._phase = Phase.DIFFERS

    def _stop_ended(self) -> None:
        if (self.stage is Stage.STOPPING and not self._side.stop.running
                and (self._exchange.cycles_left == 0 or not self._cycling)):
            self._exchange.doubt_the_end()
            self.stop_left()

    def _missed(self, reason: Sentence, now: float) -> None:
        if self._phase is Phase.LEAVING:
            if self._exchange.cycles_left == 0:
                # if nobody answers any more: next it is told by number
                self.duty.happened(Happened.SILENT)
                self.start_over(now)
            return
        if not reason:
            return
        self._exchange.forget()
        if self._verify and not self.online:
            self.start_over(now)
            return
        do = self.duty.happened(Happened.LOST if self.online else Happened.UNANSWERED)
        self.lose(reason, now)
        if do is not Do.NOTHING:    # setpoints that heard cycles go neutral with the next
            self._side.begin_stop(now, setpoints=do is Do.STOP_BY_NUMBER)
        if self.gate.mute:
            self.start_over(now)
        elif self._verify:  # it may still be listening, before it is left alone
            self._phase = Phase.LEAVING
            self._exchange.run_out(self._exchange.timer.due)

    # -- frames from the drive --------------------------------------------------------------------

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        if frame[0] == self._response_identifier:
            self._receive_cyclic(frame[1], now, now - age)
            return
        if frame.extended and frame.identifier & FROM_WHOM == self._request_identifier & FROM_WHOM:
            self._side.foreign_master(frame)
        else:
            self._side.receive(frame, now)

    def _receive_cyclic(self, data: bytes, now: float, received_at: float) -> None:
        """Take a cyclic response. The fast path of the reader."""
        if not self._exchange.expects('cyclic response', now, received_at):
            self._exchange.wait_out(now)
            return
        raws, wrong = self._codec.decode_response(data)
        if wrong:
            self.report.reject(sentences.bad_cyclic_response(wrong))
            if not raws:
                return
        elif len(data) != extended.PAYLOAD:
            self.statistics.short += 1
        self._exchange.answered(received_at)
        if not self.online and self.stage is Stage.RUNNING:
            if self._phase is Phase.LEAVING:
                if not self._differs:  # it is back: look at its maps before anything else
                    self.start_over(now)
                return
            self.be_online()
            # a neutral cycle, right after a look at its maps
            self.duty.happened(Happened.ANSWERED)
            self._side.found(now)
        slot = self._side.status_slot
        if self.control is not None and slot is not None:
            self.gate.status(raws[slot] if slot < len(raws) else None, now)
            self.control_changed(now)
        self.gate.measured(raws)
        self.report.note(ProcessDataReceived(raws, received_at))
        self._channel.release(now)
        self._exchange.wait_out(now)

    # -- control ----------------------------------------------------------------------------------

    def withdrawn(self, now: float) -> None:
        super().withdrawn(now)
        self._side.withdrawn()

    def hand_out_neutral(self, now: float) -> None:
        self._exchange.hand_out_neutral(now)

    def see_to_control_word(self, now: float) -> None:
        if self.stage is Stage.STOPPING:
            return
        writer = self._side.control_writer
        if writer is not None and (self.online or self._phase is Phase.CYCLIC):
            writer.update(now)
        self._exchange.hurry(now, setpoints=True)

    # -- state ------------------------------------------------------------------------------------

    def facts(self) -> dict[str, str]:
        return {'short_frames': str(self.statistics.short)}

    @property
    def unshown(self) -> bool:
        return super().unshown and not self._exchange.book.stop_shown

    @property
    def warning(self) -> Sentence:
        return self._maps.unknown if self._phase is Phase.CYCLIC else NOTHING

    @property
    def state(self) -> DriveState:
        if self._differs:
            return DriveState.MAPPING_DIFFERS
        return super().state
