# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The acyclic channel to one station: reads that are answered, and writes that are not.

============================ =================================================================
step                         result sent back
============================ =================================================================
``ParameterRead(n, count)``  the words, or None when nobody answered after all attempts
``ParameterWrite(n, words)`` (), as soon as the bus has taken the frame (nobody acknowledges it);
                             None when the bus refused it
============================ =================================================================

As nobody answers writes, some of them are no exchange. A control word goes before all procedures,
and takes the place of one that has not left yet (:meth:`~ParameterTransactor.write_first`). What
stops a drive waits for nothing but the spacing of frames (:meth:`~ParameterTransactor.write_now`).

Pace: at least 20 ms lie between two EEPROM writes to a station and between such a write and the
next read (manual, "Scrittura di un parametro": "almeno 20msec"); a frame leaves only while no
cyclic request is under way, because nothing is known about how many requests a drive can hold.

Quarantine: with 29-bit identifiers an answer repeats what it answers, number and count; with
11-bit identifiers it says nothing.
"""

from collections import deque
from collections.abc import Callable, Generator, Hashable
from dataclasses import dataclass
import math
from typing import Protocol, Union

from drive_can_bridge.core.errors import RemoteProtocolError, Unasked
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.outbox import Left
from drive_can_bridge.core.requests import RetryPolicy
from drive_can_bridge.protocols.access import SentWrites
from drive_can_bridge.protocols.channel import Channel, STOP_PATIENCE
from drive_can_bridge.protocols.datamodel.options import REQUEST_MAP_BASE, RESPONSE_MAP_BASE
from drive_can_bridge.protocols.polled_exchange import Chunk, TOLERANCE
from drive_can_bridge.protocols.transactor import ANYTHING, ResultT, Transactor

#: s between an unacknowledged write and the next acyclic frame, so that a drive with a single
#: receive buffer has fetched the first; and, where answers carry no address, between an answer and
#: the next read
SPACING = 0.001
#: numbers that every drive has whose answers say what they answer
ASIDE = REQUEST_MAP_BASE, RESPONSE_MAP_BASE
#: s that a stop waits for an EEPROM at most, whatever the gap may be: it takes 20 ms
STOP_EEPROM_WAIT = 0.025


@dataclass(frozen=True)
class ParameterRead:
    """
    Read ``count`` consecutive parameters.

    :param attempts: None: as configured.
    :param late_will_do: the late answer to the same question is as good as any: no quarantine. A
        stop does not believe those to what others have asked all the same.
    :param timeout: s to wait for the answer; None: as configured.
    """

    number: int
    count: int = 1
    attempts: int | None = None
    late_will_do: bool = False
    timeout: float | None = None

    @property
    def key(self) -> tuple[int, int]:
        """What an answer with a 29-bit identifier repeats."""
        return self.number, self.count


@dataclass(frozen=True)
class ParameterWrite:
    """Write consecutive parameters."""

    number: int
    words: tuple[int, ...]
    eeprom: bool

    @property
    def chunk(self) -> Chunk:
        """The numbers that it is about."""
        return Chunk(self.number, len(self.words))


Step = Union[ParameterRead, ParameterWrite]
Words = tuple[int, ...]
Reply = Union[Words, None]
#: yields steps, is sent what became of each, and returns something
Procedure = Generator[Step, Reply, ResultT]
Send = Callable[[Frame, Union[Left, None]], None]
#: what a procedure is told of a write that left
SENT: Words = ()


class AcyclicCodec(Protocol):
    """The acyclic frames of one drive, whatever its identifiers look like."""

    #: parameters that fit one write
    together: int

    def encode_read(self, number: int, count: int) -> Frame:
        """Encode a read of consecutive parameters."""

    def encode_write(self, number: int, words: Words) -> Frame:
        """Encode a write of as many as fit."""

    def decode(self, frame: Frame, asked: tuple[int, int] | None) -> Words:
        """
        Make words of an answer.

        :param asked: number and count of the read that waits for one; None: none does.
        :raises RemoteProtocolError: malformed.
        :raises Unasked: it answers something else.
        """


class ParameterTransactor(Transactor[Step, Reply]):
    """
    Sends reads and writes, paced.

    :param codec: of the frames.
    :param send: takes frames that are to leave now, and who is told whether they did.
    :param retry: how long and how often the drive is asked.
    :param eeprom_gap: s after an EEPROM write.
    :param sent: keeps the books of what left.
    :param quarantine: given where answers do not say what they answer, and the exchange itself
        goes through the channel: s of silence after a read that nobody answered, or an answer that
        nobody asked for. Writes that go first do not wait for the answer of a read then.
    :ivar asked_at: when the last read was sent; ``wrote_at``: when the last write was.
    :ivar free_at: when the next write to RAM may follow.
    """

    silent = None

    def __init__(self, codec: AcyclicCodec, *, send: Send, retry: RetryPolicy, eeprom_gap: float,
                 sent: SentWrites[Chunk] | None = None, quarantine: float | None = None) -> None:
        super().__init__(retry)
        self.asked_at = self.wrote_at = -math.inf
        self.free_at = -math.inf
        self.anonymous = quarantine is not None
        self._codec = codec
        self._emit = send
        self._sent = sent
        self._eeprom_gap = eeprom_gap
        self._quarantine = quarantine
        self._eeprom_free_at = -math.inf
        self._stop_free_at = -math.inf      # for what confirms a stop, or tells it again
        self._stop_wait_until = -math.inf   # for the EEPROM, what tells it first
        self._refused: ParameterRead | None = None  # by the bus: nothing answers it
        self._first: tuple[ParameterWrite, Left] | None = None
        self._urgent: deque[tuple[ParameterWrite, Left]] = deque()

    @property
    def silence(self) -> float:
        return self.retry.timeout if self._quarantine is None else self._quarantine

    # -- one exchange -----------------------------------------------------------------------------

    @property
    def outstanding(self) -> ParameterRead | None:
        """The read that waits for its answer, if any."""
        step = self.step
        return step if isinstance(step, ParameterRead) and step is not self._refused else None

    def begin(self, step: Step, now: float) -> None:
        if isinstance(step, ParameterRead):
            def left(sent: bool, _: float) -> None:
                # where answers say what they answer, a late one is as good
                if not sent and self.anonymous:
                    self._refused = step
            self._refused, self.asked_at = None, now
            self._emit(self._codec.encode_read(step.number, step.count), left)
            self.expect(step, now + (
                self.retry.timeout if step.timeout is None else step.timeout))
            return
        self.expect(step, math.inf)     # it ends when somebody says whether it left
        self.write(step, lambda sent, then: self.end(step, SENT if sent else None, then), now)

    def receive(self, answer: Words, now: float) -> Words:
        """Return the answer of the outstanding read (the caller has matched it)."""
        self.finish()
        if self.anonymous:  # a second answer, if there is one, must not meet the next read
            self.free_at = max(self.free_at, now + SPACING)
        return answer

    def answers(self, answer: Frame | None, step: Step) -> bool:
        """Return whether a frame may answer a step; None: it does not say what it answers."""
        if answer is None or not isinstance(step, ParameterRead):
            return answer is None
        try:
            self._codec.decode(answer, step.key)
        except (RemoteProtocolError, Unasked):
            return False
        return True

    def is_news(self, asked_at: float, now: float) -> bool:
        """Return whether an answer taken now has not waited for a process that stood still."""
        return now - asked_at <= self.retry.timeout + TOLERANCE

    def handle_stall(self, now: float) -> Reply | bool:
        if self.outstanding is None or not self.anonymous:
            return False    # its answer will say what it answers
        self.finish()
        return None

    def forget(self) -> None:
        self.finish()
        self._first = None
        self._urgent.clear()

    def attempts(self, step: Step) -> int:
        # A write is never repeated: it may be a command.
        return (step.attempts or self.retry.attempts) if isinstance(step, ParameterRead) else 1

    def unanswered(self, step: Step, reply: Reply) -> bool:
        return reply is None and isinstance(step, ParameterRead)

    def key(self, step: Step) -> Hashable | None:
        if not isinstance(step, ParameterRead):
            return None
        if self.anonymous:
            return ANYTHING
        return None if step.late_will_do else step.key

    def late_key(self, step: Step) -> Hashable | None:
        # one that was asked before the stop was written proves nothing
        if self.anonymous or not isinstance(step, ParameterRead):
            return self.key(step)
        return step.key

    def aside(self, is_late: Callable[[Hashable], bool]) -> Step | None:
        if self.anonymous:
            return None
        timeout = min(STOP_PATIENCE, self.retry.timeout)
        asides = [ParameterRead(number, count, attempts=1, late_will_do=True, timeout=timeout)
                  for number in ASIDE for count in range(1, 5)]
        return next((each for each in asides if not is_late(each.key)), None)

    def ready_at(self, step: Step, *, stop: bool) -> float:
        # "20 ms between one write and the next", says the manual of writes to the EEPROM, not that
        # the next has to go there, too. Setpoints and control words do not wait.
        return max(self.free_at, self._stop_free_at if stop else self._eeprom_free_at)

    # -- writes that are no exchange --------------------------------------------------------------

    def write(self, write: ParameterWrite, told: Left, now: float) -> None:
        """Send a write now."""
        self.wrote_at, self.free_at = now, now + SPACING
        if write.eeprom:
            self._wear(now)

        def left(sent: bool, then: float) -> None:
            if write.eeprom:    # the pause begins when the frame is on its way
                self._wear(then)
            if sent and self._sent is not None:
                self._sent.note(write.chunk, write.words)
            told(sent, then)
        self._emit(self._codec.encode_write(write.number, write.words), left)

    def _wear(self, now: float) -> None:
        """Delay what follows until the EEPROM is free."""
        gap = self._eeprom_gap
        self._eeprom_free_at = max(self._eeprom_free_at, now + gap)
        self._stop_free_at = max(self._stop_free_at, now + min(gap, STOP_EEPROM_WAIT))

    def write_first(self, write: ParameterWrite, left: Left, now: float) -> None:
        """
        Write something before everything that waits.

        It takes the place of such a write that has not left yet: what is outdated is not sent.

        :param left: called when the bus has taken or refused the frame.
        """
        self._first = write, left
        self.wake(now)

    def write_now(self, write: ParameterWrite, left: Left, now: float) -> None:
        """
        Write what stops a drive: after nothing but other such writes, whatever is under way.

        What waits with :meth:`write_first`, or to be written to the same parameter, is outdated:
        it is not sent any more.
        """
        self._first = None
        self._urgent = deque(each for each in self._urgent if each[0].number != write.number)
        self._urgent.append((write, left))
        self._stop_wait_until = now + STOP_EEPROM_WAIT
        self.wake(now)

    def express(self, now: float, held_until: float) -> bool | None:
        if not self._urgent and self._first is None:
            return None
        if now < self.express_at(held_until):
            return False
        if self._urgent:
            waiting = self._urgent.popleft()
        elif self._first is not None:
            waiting, self._first = self._first, None
        self.write(*waiting, now)
        return True

    def express_at(self, held_until: float) -> float:
        if self._urgent:
            if not self._urgent[0][0].eeprom:
                return self.free_at
            return max(self.free_at, min(self._eeprom_free_at, self._stop_wait_until))
        # nobody answers writes: where reads take up all the time, they need not wait for answers
        if self._first is None or self.busy and not (
                self.anonymous and isinstance(self.step, ParameterRead)):
            return math.inf
        ready = max(held_until, self.free_at)
        return max(ready, self._eeprom_free_at) if self._first[0].eeprom else ready


AcyclicChannel = Channel[Step, Reply]
