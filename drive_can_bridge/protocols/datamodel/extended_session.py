# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with one DataModel drive that uses 29-bit identifiers.

.. code-block:: text

    IDLE ──activate, bus up──► CHECKING ──maps agree──► CYCLIC ──missed_limit──► LEAVING
      ▲                         ▲  │ ▲                    │                        │
      │                         │  └─┼──maps differ──► DIFFERS (looks again in 1 s) │
      └──deactivate / bus down──┘    └─────────3 neutral cycles, then silence──────┘

Whatever was told to run is told to stop: by neutral cycles where the request map is known to
agree, otherwise by acyclic writes (:mod:`.stop_writes`), whatever the session is about to do next.

A drive reads cyclic words by *its own* maps. So the maps are read before the first cyclic frame,
every second while cycling, and again after each loss; a drive that does not answer gets no cyclic
frames beyond three with neutral setpoints, in case it only lost its voice. With
``mapping: assume`` there is neither CHECKING nor LEAVING: cycling never stops.
"""

from enum import Enum
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.drive_state import DriveState
from drive_can_bridge.core.events import Event, MappingDiffered, ProcessDataReceived
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.roles import Roles
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.cyclic_exchange import CYCLE, CyclicExchange
from drive_can_bridge.protocols.datamodel import extended
from drive_can_bridge.protocols.datamodel.acyclic_side import AcyclicSide, map_cells
from drive_can_bridge.protocols.datamodel.map_supervision import (
    MapSupervision, SILENT_LOOKS, Verdict,
)
from drive_can_bridge.protocols.datamodel.positions import Positions
from drive_can_bridge.protocols.datamodel.process_words import CyclicCodec
from drive_can_bridge.protocols.datamodel.stop_writes import ANSWER_TIME, ATTEMPTS
from drive_can_bridge.protocols.exchange_book import ExchangeBook

#: direction and station of an identifier
FROM_WHOM = extended.DIR | extended.STATION_MASK


class Phase(Enum):
    """What the session is doing."""

    IDLE = 'idle'
    CHECKING = 'checking the maps'
    DIFFERS = 'maps differ'
    CYCLIC = 'cycling'
    LEAVING = 'last neutral cycles'
    STOPPING = 'stop by acyclic writes'


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
            self, self._channel, numbers, known=self._start_cycling,
            # it may have started anew meanwhile, with other maps
            silent=self._maps.look_afresh if self._verify else None)
        self._book = ExchangeBook(drive, self.statistics)
        self._timer = self._book.timer
        self._exchange = CyclicExchange(
            self, self._book, self._codec.encode_request, slot=self._side.control_slot,
            ended=self._last_cycle_left)
        self._phase = Phase.IDLE
        self._stopping = False
        self._differs = False  # what the last look at the maps found

    # -- life cycle -------------------------------------------------------------------------------

    def prepare_stop(self, now: float) -> bool:
        self._clear_acyclic()
        self._stopping = self._phase in (Phase.CYCLIC, Phase.LEAVING) or (
            self._phase is not Phase.IDLE and self.told.owed)
        return self._stopping

    def begin_stop(self, now: float) -> bool:
        cycling = self._phase in (Phase.CYCLIC, Phase.LEAVING)
        if cycling:
            self._exchange.stop_soon(now)
        else:
            self._phase = Phase.STOPPING
        self._side.begin_stop(now, setpoints=not cycling)
        return cycling or self._side.stop.running

    @property
    def stopped(self) -> bool:
        return self._phase is Phase.IDLE

    @property
    def longest_stop(self) -> float:
        return self._exchange.longest_stop + ATTEMPTS * ANSWER_TIME

    def time_lost(self, now: float) -> None:
        self._channel.time_lost(now)
        if self._phase is not Phase.IDLE and not self._stopping:
            self.stood_still(now)
            self.start_over(now)

    def begin(self, now: float) -> None:
        self._stopping = False
        self._book.expect_nothing()
        self._book.missed_in_row = 0
        self._differs = False
        if self.told.owed:
            self._side.begin_stop(now, setpoints=self._verify)
        if self._verify:
            self._phase = Phase.CHECKING
            self._timer.stop()
            self._maps.look_afresh(now)
        else:
            self._begin_cycles(now)

    def go_idle(self, advice: str) -> None:
        self._phase = Phase.IDLE
        self._stopping = self._differs = False
        self.setpoints.allow(False)
        self._clear_acyclic()
        self._exchange.stop()
        self.be_offline(advice)

    def _clear_acyclic(self) -> None:
        self._side.clear()
        self._positions.forget()
        self._maps.stop()

    # -- maps -------------------------------------------------------------------------------------

    def _maps_judged(self, verdict: Verdict, text: str, now: float) -> None:
        if verdict is Verdict.AGREE:
            self._differs = False
            if self._phase is not Phase.CYCLIC:
                self._begin_cycles(now)
            elif self.online:
                self.told.answered()
        elif verdict is Verdict.DIFFER:
            self._differs = True
            if self.told.ran:   # neutral cycles since may have reached others, or nobody
                self.told.ran = False
                self.told.note(CYCLE, runs=True)
            owed = self.told.owed
            self.lose(f'mapping differs: {text}', now)
            self._book.expect_nothing()
            # a request map that is right still takes neutral cycles, unless it is to be rewritten
            by_cycles = owed and self._maps.request_agrees and not self.gate.mute
            if owed:
                self._side.begin_stop(now, setpoints=not by_cycles)
            if by_cycles:
                if self._phase is not Phase.LEAVING:
                    self._phase = Phase.LEAVING
                    self._exchange.run_out(max(
                        now, self._timer.began_at + self._timer.stop_spacing))
            else:
                self._phase = Phase.DIFFERS
                self._timer.stop()
        elif self._phase is Phase.LEAVING:
            self._maps.look_at = math.inf  # that comes after the last neutral cycle
        elif self._phase is Phase.CYCLIC:  # there, the cyclic answers tell who is there
            if self._maps.silent_looks == SILENT_LOOKS:
                self.report.warn(self._maps.unknown)
        else:
            self._phase = Phase.CHECKING
            self.report.advice = ('no answer to mapping read: drive silent, wrong station, bit '
                                  'rate or identifier mode')
            self._maps.look_at = now  # paced by the time-out of the read

    def _maps_reported(self, event: Event) -> None:
        if isinstance(event, MappingDiffered):
            self.report.advice = f'mapping differs: {event.text}'
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
            self._timer.stop()
            self._positions.read(now)

    def _start_cycling(self, now: float) -> None:
        self._phase = Phase.CYCLIC
        self._book.stale = 0
        self._exchange.start(now, in_turn=True)
        self.report.advice = 'no cyclic response: drive silent or response identifier taken'

    def _cycle(self, now: float) -> None:
        """Send one cyclic request. The fast path of the timer."""
        if self._stopping and self._exchange.wait_out(now, due=True):
            return
        if self._book.awaiting:
            self._miss(now)
            if self._timer.due == math.inf:
                return
        self._exchange.put(self._exchange.begin(now))
        self._book.awaiting = True
        self._channel.hold(now + 0.5 * self.configuration.period)

    def _last_cycle_left(self, now: float) -> None:
        if self._stopping:
            self._timer.stop()
            self._stop_ended()
        elif self._differs:
            self._timer.stop()
            self._book.expect_nothing()
            self._phase = Phase.DIFFERS

    def _stop_ended(self) -> None:
        if (self._stopping and not self._side.stop.running
                and (self._exchange.cycles_left == 0 or self._phase is Phase.STOPPING)):
            self._exchange.doubt_the_end()
            self.stop_left()

    def _miss(self, now: float) -> None:
        too_many = self._book.missed()
        if self._stopping:
            return
        if self._phase is Phase.LEAVING:
            if self._exchange.cycles_left == 0:
                self.start_over(now)
            return
        if not too_many:
            return
        self._book.missed_in_row = 0
        if self._verify and not self.online:
            self.start_over(now)
            return
        owed = self.told.owed or self.told.ran
        self.lose(f'no cyclic response for {self.configuration.missed_limit} cycles', now)
        if owed:  # of the word that has no slot; setpoints go neutral with the next cycles
            self._side.begin_stop(now, setpoints=False)
        if self.gate.mute:
            self.start_over(now)
        elif self._verify:  # it may still be listening, before it is left alone
            self._phase = Phase.LEAVING
            self._exchange.run_out(self._timer.due)

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
        book = self._book
        if not book.awaiting:
            if not book.take_stale():
                self.report.reject('cyclic response that nobody asked for')
            return
        raws, wrong = self._codec.decode_response(data)
        if wrong:
            self.report.reject(f'cyclic response with {wrong}')
            if not raws:
                return
        elif len(data) != extended.PAYLOAD:
            self.statistics.short += 1
        book.answered(received_at)
        if self.told.ran and not self._verify:  # otherwise the maps tell who has heard it
            self.told.answered()
        if not self.online and not self._stopping:
            if self._phase is Phase.LEAVING:
                if not self._differs:  # it is back: look at its maps before anything else
                    self.start_over(now)
                return
            self.be_online()
            self._side.found(now)
        slot = self._side.status_slot
        if self.control is not None and slot is not None:
            self.control.status_received(raws[slot] if slot < len(raws) else None, now)
            self.control_changed(now)
        self.gate.measured(raws)
        self.report.note(ProcessDataReceived(raws, received_at))
        self._channel.release(now)
        if self._stopping:
            self._exchange.wait_out(now)

    # -- timer ------------------------------------------------------------------------------------

    def handle_timer(self, now: float) -> None:
        if now >= self._timer.due:
            self._cycle(now)
        if now >= self._maps.look_at:
            self._maps.look(now)
        if now >= self._positions.due:
            self._positions.due = math.inf
            if self._phase is Phase.CHECKING:
                self._begin_cycles(now)
        self._side.handle_timer(now)
        if now >= self._channel.next_timer():
            self._channel.advance(now)

    def next_timer(self) -> float:
        return min(self._timer.due, self._channel.next_timer(), self._maps.look_at,
                   self._positions.due, self._side.next_timer())

    # -- control ----------------------------------------------------------------------------------

    def withdrawn(self, now: float) -> None:
        super().withdrawn(now)
        self._side.withdrawn()

    def see_to_control_word(self, now: float) -> None:
        control = self.control
        if control is None or self._stopping:
            return
        writer = self._side.control_writer
        if writer is not None and (self.online or self._phase is Phase.CYCLIC):
            writer.update(now)
        if control.stopping and (self.setpoints.changed or (
                self._side.control_slot is not None and control.word != self._exchange.word)):
            self._timer.hurry(now)

    # -- state ------------------------------------------------------------------------------------

    def facts(self) -> dict[str, str]:
        return {'short_frames': str(self.statistics.short)}

    @property
    def warning(self) -> str:
        return self._maps.unknown if self._phase is Phase.CYCLIC else ''

    @property
    def state(self) -> DriveState:
        if self._differs:
            return DriveState.MAPPING_DIFFERS
        return super().state
