# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with one DataModel drive that uses 29-bit identifiers.

.. code-block:: text

    IDLE ──activate, bus up──► CHECKING ──maps agree──► CYCLIC ──missed_limit──► LEAVING
      ▲                         ▲  │ ▲                    │                        │
      │                         │  └─┼──maps differ──► DIFFERS (looks again in 1 s) │
      └──deactivate / bus down──┘    └─────────3 neutral cycles, then silence──────┘

Whatever was told to run is told to stop: by neutral cycles where the request map is known to
agree, otherwise by acyclic writes (:mod:`.safe_stop`), whatever the session is about to do next.

A drive reads cyclic words by *its own* maps. So the maps are read before the first cyclic frame,
every second while cycling, and again after each loss; a drive that does not answer gets no cyclic
frames beyond three with neutral setpoints, in case it only lost its voice. With
``mapping: assume`` there is neither CHECKING nor LEAVING: cycling never stops.
"""

from enum import Enum
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.events import (
    Event, ForeignMasterSeen, MappingDiffered, Noted, ProcessDataReceived,
)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.requests import BRIDGE_INACTIVE
from drive_can_bridge.core.session import (
    DriveState, STOP_CYCLES, untold_text,
)
from drive_can_bridge.protocols.cycle_timer import CycleTimer
from drive_can_bridge.protocols.datamodel import extended
from drive_can_bridge.protocols.datamodel.base_session import DataModelSession
from drive_can_bridge.protocols.datamodel.map_supervision import MapSupervision, Verdict
from drive_can_bridge.protocols.datamodel.process_words import CyclicCodec, wire_numbers
from drive_can_bridge.protocols.datamodel.safe_stop import ANSWER_TIME, ATTEMPTS

#: so many looks at the maps in a row may go unanswered until that is told
SILENT_LOOKS = 3
#: what the drive is told by cyclic requests, for the books of what it was told
CYCLE = 'cycle'
#: s until a position that a setpoint cannot carry is read again
POSITION_PAUSE = 0.1
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


class ExtendedSession(DataModelSession):
    """Mapping check, cyclic exchange, and the acyclic frames between its cycles."""

    def __init__(self, drive: DriveConfiguration) -> None:
        station = drive.station
        super().__init__(
            drive,
            encode_read=lambda number, count: extended.encode_read_request(
                station, number, count),
            encode_write=lambda number, words: extended.encode_write(station, number, words),
            together=extended.SLOTS)
        options = drive.options
        self._verify: bool = options.mapping != 'assume'
        self._strict: bool = options.length_policy == 'strict'
        self._codec = CyclicCodec(
            station, drive.cyclic_request, drive.cyclic_response,
            control_slot=self._control_slot, strict=self._strict)
        self._request_identifier = self._codec.request_identifier
        self._response_identifier = self._codec.response_identifier
        self._maps = MapSupervision(
            self._channel, request_base=self._request_base, response_base=self._response_base,
            request=wire_numbers(drive.cyclic_request, self._offset),
            response=wire_numbers(drive.cyclic_response, self._offset),
            rewrite=options.mapping == 'configure',
            emit=self._maps_reported, judged=self._maps_judged)
        self._phase = Phase.IDLE
        self._cycles_left = -1  # cycles still to be sent in LEAVING or before a stop; -1: no end
        self._silent_looks = 0
        self._stopping = False
        self._differs = False  # what the last look at the maps found
        self._frame: Frame | None = None
        self._frame_raws: list[int] | None = None  # in it, until it has left
        self._frame_runs = False  # it holds anything but neutral and disable
        self._ran = False  # such a one left, and no look has shown that neutral ones arrive since
        self._sent_word: int | None = None
        self._awaiting = False
        self._forgiven = False
        self._timer = CycleTimer(drive.period)
        self._positions_at = math.inf   # when positions are to be read again
        self._missed_in_row = 0

    # -- life cycle -------------------------------------------------------------------------------

    def deactivate(self, now: float) -> None:
        self.active = False
        self._fail_requests(BRIDGE_INACTIVE)
        cycling = self._phase in (Phase.CYCLIC, Phase.LEAVING)
        self._stopping = cycling or self._phase is not Phase.IDLE and self.told.owed
        self._withdraw(BRIDGE_INACTIVE, now)
        if cycling:
            self._cycles_left = STOP_CYCLES
            self._timer.no_later(max(now, self._timer.began_at + self._stop_spacing))
            self._timer.hurry(now)
            self._stop_by_writes(now, setpoints=False)
        elif self._stopping:
            self._phase = Phase.STOPPING
            self._stop_by_writes(now)
        if not cycling and not self._safe_stop.running:
            if self._stopping or not self.bus_available:
                self._leave_owing()
            self._go_idle('deactivated')

    @property
    def stopped(self) -> bool:
        return self._phase is Phase.IDLE

    @property
    def longest_stop(self) -> float:
        return super().longest_stop + ATTEMPTS * ANSWER_TIME

    def time_lost(self, now: float) -> None:
        self._channel.time_lost(now)
        if self._phase is Phase.IDLE or self._stopping:
            return
        self._lose('the bridge stood still', now)
        self._begin(now)

    def _begin(self, now: float) -> None:
        """Start over: nothing is known of the drive."""
        (self._lose if self.online else self._withdraw)('the drive is being reconnected', now)
        self.setpoints.forget()
        self._stopping = False
        self._stop_awaiting()
        self._missed_in_row = 0
        self._differs = False
        if self.told.owed:
            self._stop_by_writes(now, setpoints=self._verify)
        if self._verify:
            self._phase = Phase.CHECKING
            self._timer.stop()
            self._maps.look_afresh(now)
        else:
            self._begin_cycles(now)

    def _go_idle(self, advice: str) -> None:
        self._phase = Phase.IDLE
        self._stopping = self._differs = self._ran = False
        self._cycles_left = -1
        self.setpoints.allow(False)
        self._clear_channel()
        self._timer.stop()
        self._stop_awaiting()
        self._advice = advice
        self._be_offline(advice)

    def _clear_channel(self) -> None:
        super()._clear_channel()
        self._positions_at = math.inf
        self._maps.stop()

    # -- maps -------------------------------------------------------------------------------------

    def _maps_judged(self, verdict: Verdict, text: str, now: float) -> None:
        self._silent_looks = self._silent_looks + 1 if verdict is Verdict.SILENT else 0
        if verdict is Verdict.AGREE:
            self._differs = False
            if self._phase is not Phase.CYCLIC:
                self._begin_cycles(now)
            elif self.online and not self.told.owed:
                self._ran = False
        elif verdict is Verdict.DIFFER:
            self._differs = True
            if self._ran:   # neutral cycles since may have reached other parameters, or nobody
                self._ran = False
                self.told.note(CYCLE, runs=True)
            owed = self.told.owed
            self._lose(f'mapping differs: {text}', now)
            self._stop_awaiting()
            # a request map that is right still takes neutral cycles, unless it is to be rewritten
            by_cycles = owed and self._maps.request_agrees and not self._mute
            if owed:
                self._stop_by_writes(now, setpoints=not by_cycles)
            if by_cycles:
                if self._phase is not Phase.LEAVING:
                    self._start_leaving(max(now, self._timer.began_at + self._stop_spacing))
            else:
                self._phase = Phase.DIFFERS
                self._timer.stop()
        elif self._phase is Phase.LEAVING:
            self._maps.look_at = math.inf  # that comes after the last neutral cycle
        elif self._phase is Phase.CYCLIC:  # there, the cyclic answers tell who is there
            if self._silent_looks == SILENT_LOOKS:
                self._events.append(Noted(self._maps_unknown, warning=True))
        else:
            self._phase = Phase.CHECKING
            self._advice = ('no answer to mapping read: drive silent, wrong station, bit rate '
                            'or identifier mode')
            self._maps.look_at = now  # paced by the time-out of the read

    def _maps_reported(self, event: Event) -> None:
        if isinstance(event, MappingDiffered):
            self._advice = f'mapping differs: {event.text}'
        self._events.append(event)

    # -- cyclic exchange --------------------------------------------------------------------------

    def _begin_cycles(self, now: float) -> None:
        """Begin to cycle, as soon as it is known where axes are that have to stay there."""
        if self.setpoints.held and self._phase is Phase.LEAVING:
            return  # a stop takes its course
        # a drive that was told to run has to be told ``disable``, whatever is known of its axes
        at_once = self.setpoints.ever_known and not self._verify and not self._mute
        if self.setpoints.known or at_once:
            self._start_cycling(now)
        else:
            self._phase = Phase.CHECKING
            self._timer.stop()
            self._read_positions(now)

    def _positions_read(self, answered: bool, now: float) -> None:
        if self.setpoints.known:
            self._start_cycling(now)
            return
        self._advice = untold_text(self.setpoints.untold)
        if answered:    # but the setpoint cannot carry it
            self._positions_at = now + POSITION_PAUSE
        elif self._verify:  # it may have started anew meanwhile, with other maps
            self._maps.look_afresh(now)
        else:
            self._read_positions(now)   # paced by the time-out of the read

    def _start_cycling(self, now: float) -> None:
        self._phase = Phase.CYCLIC
        self._cycles_left = -1
        self._forgiven = False
        self._missed_in_row = 0
        self._timer.start(self._next_turn(max(now, self._timer.began_at + self.drive.period)))
        self._advice = 'no cyclic response: drive silent or response identifier taken'

    def _cycle(self, now: float) -> None:
        """Send one cyclic request. The fast path of the timer."""
        if self._awaiting:
            self._miss(now)
            if self._timer.due == math.inf:
                return
        self._expire(now)
        control = self.control
        if (self.setpoints.changed or self._frame is None
                or control is not None and control.word != self._sent_word):
            self._frame = self._encode()
        self._outbox.put(self._frame, self._cycle_left)
        error = self._timer.begun(now, self._stop_spacing if self._cycles_left >= 0 else None)
        if error == error:  # not NaN
            self.statistics.period_error.add(error)
        self._awaiting = True
        self._channel.hold(now + 0.5 * self.drive.period)

    def _cycle_left(self, sent: bool, now: float) -> None:
        """Take note of a cyclic request that left; what the bus refused does not count."""
        if not sent:
            return
        self.told.note(CYCLE, runs=self._frame_runs)
        self._ran = self._ran or self._frame_runs
        if self._frame_raws is not None:    # the first time that it left
            self.sent.take(self._frame_raws)
            self._frame_raws = None
        control = self.control
        if (control is not None and self._control_slot is not None
                and control.word == self._sent_word):  # else it has changed since
            fresh = control.word_due
            control.word_sent(now)
            if fresh or control.word != self._sent_word:
                self._control_changed(now)
            if control.pulsing:
                self._timer.no_later(now + self._stop_spacing)
        if self._cycles_left > 0:  # the last cycles before silence
            self._cycles_left -= 1
            if self._cycles_left == 0 and (self._stopping or self._differs):
                self._timer.stop()
                if not self._stopping:
                    self._stop_awaiting()
                    self._phase = Phase.DIFFERS
                self._stop_ended()

    def _stop_ended(self) -> None:
        if (self._stopping and not self._safe_stop.running
                and (self._cycles_left == 0 or self._phase is Phase.STOPPING)):
            self._go_idle('deactivated')

    def _start_leaving(self, first: float) -> None:
        """Send the last cycles to a drive that is to be left alone."""
        self._phase = Phase.LEAVING
        self._cycles_left = STOP_CYCLES
        self._timer.start(first)

    def _encode(self) -> Frame:
        raws = [setpoint.raw for setpoint in self.setpoints.items]
        self._frame_runs = not self.setpoints.at_rest
        if self.control is not None:
            self._sent_word = self.control.word
            if self._control_slot is not None:
                raws.insert(self._control_slot, self._sent_word)
                self._frame_runs = self._frame_runs or not self.control.at_rest
        self.setpoints.changed = False
        self._frame_raws = raws
        return self._codec.encode_request(raws)

    def _miss(self, now: float) -> None:
        self._awaiting = False
        self._forgiven = True  # one answer too many is on its way, if this one is only late
        self.statistics.missed += 1
        self._missed_in_row += 1
        if self._stopping:
            return
        if self._phase is Phase.LEAVING:
            if self._cycles_left == 0:
                self._begin(now)
            return
        if self._missed_in_row < self.drive.missed_limit:
            return
        self._missed_in_row = 0
        reason = f'no cyclic response for {self.drive.missed_limit} cycles'
        if self._verify and not self.online:
            self._begin(now)
            return
        owed = self.told.owed
        self._lose(reason, now)
        if owed:  # of the word that has no slot; setpoints go neutral with the next cycles
            self._stop_by_writes(now, setpoints=False)
        if self._mute:
            self._begin(now)
        elif self._verify:  # it may still be listening, before it is left alone
            self._start_leaving(self._timer.due)

    def _stop_awaiting(self) -> None:
        """Expect no answer any more; one that is on its way is no surprise, though."""
        self._forgiven = self._awaiting
        self._awaiting = False

    # -- frames from the drive --------------------------------------------------------------------

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        if frame[0] == self._response_identifier:
            self._receive_cyclic(frame[1], now, now - age)
            return
        if frame.extended and frame.identifier & FROM_WHOM == self._request_identifier & FROM_WHOM:
            self._events.append(ForeignMasterSeen(
                f'another master sends requests to station {self.drive.station}: {frame}'))
            return
        step = self._channel.outstanding
        try:
            words = extended.decode_answer(
                frame, self.drive.station, None if step is None else (step.number, step.count),
                strict=self._strict)
        except RemoteProtocolError as error:
            self._reject(str(error))
            return
        if len(frame.data) != extended.PAYLOAD:
            self.statistics.short += 1
        self._channel.receive(words, now)

    def _receive_cyclic(self, data: bytes, now: float, received_at: float) -> None:
        """Take a cyclic response. The fast path of the reader."""
        statistics = self.statistics
        if not self._awaiting:
            if self._forgiven:
                self._forgiven = False
            else:
                self._reject('cyclic response that nobody asked for')
            return
        raws, wrong = self._codec.decode_response(data)
        if wrong:
            self._reject(f'cyclic response with {wrong}')
            if not raws:
                return
        elif len(data) != extended.PAYLOAD:
            statistics.short += 1
        self._awaiting = False
        self._missed_in_row = 0
        statistics.exchanges += 1
        latency = received_at - self._timer.began_at
        statistics.latency.add(latency if latency > 0.0 else 0.0)
        if not self.online and not self._stopping:
            if self._phase is Phase.LEAVING:
                if not self._differs:  # it is back: look at its maps before anything else
                    self._begin(now)
                return
            self._found(now)
        if self.control is not None and self._status_slot is not None:
            slot = self._status_slot
            self.control.status_received(raws[slot] if slot < len(raws) else None, now)
            self._control_changed(now)
        self._measured(raws)
        self._events.append(ProcessDataReceived(raws, received_at))
        self._channel.release(now)

    def _found(self, now: float) -> None:
        self._be_online()
        if self._by_hand is not None:
            self._by_hand.begin(now)
        self._control_changed(now)

    # -- timer ------------------------------------------------------------------------------------

    def handle_timer(self, now: float) -> None:
        if now >= self._timer.due:
            self._cycle(now)
        if now >= self._maps.look_at:
            self._maps.look(now)
        if now >= self._positions_at:
            self._positions_at = math.inf
            if self._phase is Phase.CHECKING:
                self._begin_cycles(now)
        self._serve_control(now)
        if now >= self._channel.next_timer():
            self._channel.advance(now)

    def next_timer(self) -> float:
        return min(self._timer.due, self._channel.next_timer(), self._maps.look_at,
                   self._positions_at, self._control_timer())

    def _see_to_control_word(self, now: float) -> None:
        control = self.control
        if control is None or self._stopping:
            return
        if self._by_hand is not None and (self.online or self._phase is Phase.CYCLIC):
            self._by_hand.update(now)
        if control.stopping and (self.setpoints.changed or (
                self._control_slot is not None and control.word != self._sent_word)):
            self._timer.hurry(now)

    @property
    def warning(self) -> str:
        if self._phase is Phase.CYCLIC and self._silent_looks >= SILENT_LOOKS:
            return self._maps_unknown
        return ''

    @property
    def _maps_unknown(self) -> str:
        return (f'no answer to {self._silent_looks} mapping reads in a row, although cyclic '
                f'requests are answered: nobody knows whether the maps are still right')

    @property
    def state(self) -> DriveState:
        if self._differs:
            return DriveState.MAPPING_DIFFERS
        return super().state
