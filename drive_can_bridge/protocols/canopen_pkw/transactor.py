# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The mailbox as its user sees it: one request at a time, and what became of it.

The device starts nothing when it gets the function byte that it had before (see :mod:`.pkw`). As
long as every request is answered, inverting the toggle with each of them is all that is needed.
After a start, a time-out or a restart of the device nobody knows its last function byte. Then
function 00h goes first; once the device has answered that, any function byte is a change:

.. code-block:: text

    synchronised ──request, answered──► synchronised        (toggle inverted)
         │ no answer, device restarted
         ▼
    unknown ──function 00h, answered──► request ──answered──► synchronised
         └──────not answered in 0.1 s──► request (reads), or nothing (writes)

A device that has just started has 00h as its last function byte already and need not answer
function 00h. So a read is sent all the same: it does no harm, and its answer synchronises. A
write that was sent like this might be executed although it seems lost; it is reported as *not
sent*, unless the caller says that this does not matter (:attr:`RegisterWrite.blind`).

Blind writes do not wait for function 00h, so that the answer to a write that was given up may
still come. There are two toggles only: it fits the last but one as well, and may say that a drive
runs where a drive is to stop. As a device answers in order, an answer is that to the oldest write
that it fits. It proves a blind one only if nothing else was written since; otherwise that is
written again at once: a device that keeps nothing but the newest request while it is busy takes
no notice of one that has the function byte of the request that it was busy with.

Other writes cannot be written again to be sure, and some device may acknowledge one long after it
has answered others, function 00h among them. So as long as that may happen, the next one to the
same address gets the other toggle, behind function 00h where it is that of the last request. Where
both toggles are taken, a user's write waits until one is free, and of another the first answer,
which may be a late one, is not believed. It may come for a while, and until the device has
answered something newer: one that queues requests, and stands still for seconds, gets on with what
it was sent. An answer proves nothing newer than the oldest request that it fits: of a queue of
reads of one register, every other one looks the same. So that this comes to an end however many
answers were lost, a register that nobody has asked for is read behind function 00h: its answer
fits nothing else, and shows that nothing older comes. That is done where more is in doubt than the
next answer.
"""

from collections import deque
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from functools import partial
from itertools import dropwhile
import math
from typing import Any, Union

from drive_can_bridge.core.outbox import Left
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.requests import RetryPolicy
from drive_can_bridge.protocols.access import SentWrites
from drive_can_bridge.protocols.canopen_pkw import pkw
from drive_can_bridge.protocols.canopen_pkw.addresses import Placement, Span
from drive_can_bridge.protocols.canopen_pkw.pkw import Address, Function, PkwMessage
from drive_can_bridge.protocols.channel import Channel, LATE_MAX, STOP_PATIENCE
from drive_can_bridge.protocols.transactor import (
    Answered, NOT_TAKEN, Refused, ResultT, Silence, Transactor)

#: s that an answer to function 00h is waited for at most
SYNCHRONISATION_TIMEOUT = 0.1
#: so many writes whose answers may still come are remembered
OPEN_MAX = 16
#: so many requests that were not answered are remembered: those of a minute of silence
ASKED_MAX = 256
#: registers that are read to have an answer that fits nothing else: what identifies the device
ASIDE = range(64, 96)
#: s until the bus is asked again to take a write that waits for nobody
REFUSED_PAUSE = 0.01


@dataclass(frozen=True)
class RegisterRead:
    """
    Read one register, or two adjacent ones.

    :param attempts: None: as configured.
    :param timeout: s to wait for the answer; None: as configured.
    """

    address: Address
    count: int = 1
    attempts: int | None = None
    timeout: float | None = None


@dataclass(frozen=True)
class RegisterWrite:
    """
    Write one register, or two adjacent ones.

    :param blind: send it even though the device may take no notice; it may be executed twice.
        When the bus refuses it, it is tried again until its time is over.
    :param timeout: s to wait for the answer; None: as configured.
    """

    address: Address
    words: tuple[int, ...]
    blind: bool = False
    timeout: float | None = None

    @classmethod
    def of(cls, placement: Placement, parameter: Parameter, raw: int,
           **how: Any) -> 'RegisterWrite':
        """Return what gives a parameter this raw integer."""
        return cls(placement.span(parameter).address, placement.words(parameter, raw), **how)

    @property
    def span(self) -> Span:
        """The registers that it is about."""
        return Span(self.address, len(self.words))


Step = Union[RegisterRead, RegisterWrite]


#: not sent, and not refused by the bus: the mailbox could not be synchronised
Reply = Union[Answered[pkw.Words], Refused, Silence]
#: yields steps, is sent what became of each, and returns something
Procedure = Generator[Step, Reply, ResultT]


class MailboxTransactor(Transactor[Step, Reply]):
    """
    One exchange at a time. Late answers have the wrong toggle, or are seen through.

    :param send: takes a request that leaves now, and who is told whether it did.
    :param order: of the halves of abort codes: ``auto``, ``low_first``, ``high_first``.
    :param retry: how long and how often the device is asked.
    :param sent: keeps the books of what left.
    """

    def __init__(self, send: Callable[[PkwMessage, Left], None], *, order: str, retry: RetryPolicy,
                 sent: SentWrites[Span] | None = None) -> None:
        super().__init__(retry)
        self._send = send
        self._sent = sent
        self._order = order
        self._synchronised = False
        self._toggle = False            # of the last request
        self._request: PkwMessage | None = None
        #: writes in order, the one under way included, whose answers may still come
        self._open: deque[PkwMessage] = deque(maxlen=OPEN_MAX)
        #: requests in order, of which a device that answers in order has answered no newer one
        self._asked: deque[PkwMessage] = deque(maxlen=ASKED_MAX)
        #: writes that were given up and are not to be done twice, until a late answer may come
        self._given_up: deque[tuple[float, PkwMessage]] = deque(maxlen=ASKED_MAX)
        self._late_until = -math.inf    # the answer to the request under way may come, at last
        self._until = math.inf          # an answer counts; the deadline may be a moment before
        self._abandoned = False
        self._refused_at: float | None = None   # the bus did not take the request
        self._late = False                      # at first
        self._preparing = False                 # the request is not that of the step
        #: where an answer to a write was not believed: the next one is
        self._disbelieved: set[Address] = set()

    def attempts(self, step: Step) -> int:
        # What takes more than one write tells what may be executed twice, and what may not.
        return (step.attempts or self.retry.attempts) if isinstance(step, RegisterRead) else 1

    def unanswered(self, step: Step, reply: Reply) -> bool:
        return isinstance(reply, Silence) and (isinstance(step, RegisterRead) or reply.sent)

    def repeatable(self, step: Step, *, users: bool) -> bool:
        return isinstance(step, RegisterRead)

    def answers(self, answer: PkwMessage, step: Step) -> bool:
        """Return whether an answer may be that to a step that was given up, or to its 00h."""
        return answer.code == Function.NONE or pkw.answers(
            answer, self._make_request(step, answer.toggle))

    def begin(self, step: Step, now: float) -> None:
        self.expect(step, math.inf)     # until its request is made
        if _is_blind(step):
            self._send_step(step, now)
        elif not self._synchronised:
            self._prepare(pkw.idle_request(), now)
        elif self._is_ambiguous(step, now):
            self._ask_aside(step, now)
        elif self._next_toggle(step, now) != self._toggle:
            self._send_step(step, now)
        else:
            self._prepare(pkw.idle_request(), now)

    def held_until(self, step: Step, now: float) -> float:
        if isinstance(step, RegisterRead) or step.blind:
            return -math.inf
        late = [-math.inf, -math.inf]
        for until, request in self._still_late(now):
            if request.address == step.address:
                late[request.toggle] = max(late[request.toggle], until)
        return min(late)

    def abandon(self, until: float) -> None:
        """Wait for the answer under way until then at most; the step is not gone on with."""
        if self.busy:
            self._abandoned = True
            self._until = min(self._until, until)
            self.deadline = min(self.deadline, until)

    def receive(self, answer: PkwMessage, now: float) -> Reply | bool:
        request, step, since = self._request, self.step, self._writes_since(answer)
        late_until = self._take_late(answer, now)
        if request is None or step is None:
            return False
        if self._preparing:
            return _fits(answer, request) and self._prepared(request, step, now)
        if not pkw.answers(answer, request):
            return False
        if late_until is not None and not _is_blind(step):
            # the other of the two may come as long; not longer: one of them may be lost
            self._late_until = min(self._late_until, late_until)
            self._disbelieved.add(request.address)
            return False
        self._disbelieved.discard(request.address)
        if isinstance(step, RegisterRead):
            self._open.clear()
        elif step.blind and _conflicts(since, request):
            if not self._abandoned and self._refused_at is None:
                if _conflicts(self._open, request):
                    self._ask_aside(step, now)
                else:
                    self._send_step(step, now)
            return False
        self._synchronised = True
        self.finish()
        if answer.code == Function.ERROR:
            code = pkw.code_from_words(answer.words, self._order)
            return Refused(code, pkw.describe(code))
        return Answered(answer.words)

    def handle_timer(self, now: float) -> Reply | bool:
        request, step = self._request, self.step
        if request is None or step is None:
            return False
        if self._refused_at is not None:
            return self._try_again(step, self._refused_at, now)
        if now < self._until:
            return False
        sent = not self._preparing
        if sent or self._abandoned or isinstance(step, RegisterWrite) and not step.blind:
            self.forget()
            return Silence(sent or _is_blind(step))     # it was, before what was asked aside
        self._send_step(step, now)
        return False

    def forget(self) -> None:
        """Expect nothing any more; what the device's last function byte is, is unknown."""
        request, step = self._request, self.step
        if request is not None and not self._preparing and self._refused_at is None and (
                isinstance(step, RegisterWrite) and not step.blind):
            self._given_up.append((self._late_until, request))
        self.finish()
        self._synchronised = False

    def finish(self) -> None:
        super().finish()
        self._request = None
        self._abandoned = self._late = self._preparing = False
        self._refused_at = None

    def _prepare(self, request: PkwMessage, now: float) -> None:
        """Ask something else before the step."""
        self._preparing, self._request = True, request
        patience = STOP_PATIENCE if _is_blind(self.step) else SYNCHRONISATION_TIMEOUT
        self.deadline = self._until = now + min(self.retry.timeout, patience)
        self._asked.append(request)
        self._send(request, self._left)

    def _prepared(self, request: PkwMessage, step: Step, now: float) -> Reply | bool:
        """Handle the answer to what was asked before the step."""
        self._synchronised = True
        if self._abandoned:
            self.finish()
            return Silence(sent=_is_blind(step))
        if request.code != Function.NONE:
            self._open.clear()
            if isinstance(step, RegisterWrite) and step.address in self._disbelieved:
                self._given_up = deque(
                    (each for each in self._given_up if each[1].address != step.address),
                    maxlen=ASKED_MAX)
        elif self._is_ambiguous(step, now):
            self._ask_aside(step, now)
            return True
        self._send_step(step, now)
        return True

    def _is_ambiguous(self, step: Step, now: float) -> bool:
        """Return whether answers to given-up writes would make more than the next one doubtful."""
        if isinstance(step, RegisterRead) or step.blind:
            return False
        late = [each[1] for each in self._still_late(now) if each[1].address == step.address]
        asked = set(map(id, self._asked))
        return len({each.toggle for each in late}) == 2 and (
            step.address in self._disbelieved or any(id(each) in asked for each in late))

    def _ask_aside(self, step: Step, now: float) -> None:
        """Read a register that no request has asked for, if there is one, before the step."""
        asked = {request.word for request in self._asked}
        word = next((word for word in ASIDE if word not in asked), None)
        if word is None:
            self._send_step(step, now)
            return
        self._toggle = not self._toggle
        self._prepare(pkw.read_request(Address(word), 1, self._toggle), now)

    def _writes_since(self, answer: PkwMessage) -> list[PkwMessage]:
        """Return the oldest write that an answer fits, and those since; forget up to that one."""
        found = list(dropwhile(lambda each: not pkw.answers(answer, each), self._open))
        if found:
            self._open = deque(found[1:], maxlen=OPEN_MAX)
        return found

    def _take_late(self, answer: PkwMessage, now: float) -> float | None:
        """Record an answer; return until when it might be that to a write that was given up."""
        found = next(
            (each for each in self._still_late(now) if pkw.answers(answer, each[1])), None)
        if found is not None:
            self._given_up.remove(found)
        older = list(dropwhile(lambda each: not _fits(answer, each), self._asked))
        if older:
            self._asked = deque(older[1:], maxlen=ASKED_MAX)
        return None if found is None else found[0]

    def _still_late(self, now: float) -> list[tuple[float, PkwMessage]]:
        """Return the writes that were given up, and until when answers to them may come anyhow."""
        if self._given_up:
            asked = set(map(id, self._asked))
            self._given_up = deque(
                (each for each in self._given_up if now < each[0] or id(each[1]) in asked),
                maxlen=ASKED_MAX)
        return list(self._given_up)

    def _next_toggle(self, step: Step, now: float) -> bool:
        """Return the toggle of the request for a step: inverted, if no late answer has only it."""
        inverted = not self._toggle
        if isinstance(step, RegisterRead) or step.blind:
            return inverted
        taken = {request.toggle for _, request in self._still_late(now)
                 if request.address == step.address}
        return self._toggle if taken == {inverted} else inverted

    def _left(self, sent: bool, now: float) -> None:
        """Record a request that the bus refused; or took, if late, after all."""
        if self._request is None:
            return
        if sent:
            if self._late:
                more = 0.5 * self._patience(self.step)
                self.deadline = self._until = max(self._until, now + more)
            return
        self._refused_at = now
        if self._asked and self._asked[-1] is self._request:
            self._asked.pop()
        if isinstance(self.step, RegisterWrite) and self.step.blind:
            self.deadline = min(self._until, now + REFUSED_PAUSE)
        if self._request.code != Function.NONE:
            self._toggle = not self._toggle     # the device has not seen this one
            if self._open and self._open[-1] is self._request:
                self._open.pop()

    def _patience(self, step: Step | None) -> float:
        """Return how many s the answer to a step has."""
        return self.retry.timeout if step is None or step.timeout is None else step.timeout

    def _write_left(self, write: RegisterWrite, sent: bool, now: float) -> None:
        if sent and self._sent is not None:
            self._sent.note(write.span, write.words)
        self._left(sent, now)

    def _try_again(self, step: Step, refused_at: float, now: float) -> Reply | bool:
        """Go on after a refusal: a read ends when its time is over, a write that may wait now."""
        again = isinstance(step, RegisterWrite) and step.blind
        if now >= self._until or self._abandoned or isinstance(step, RegisterWrite) and not again:
            self.finish()   # what the device's last function byte is, is as known as before
            return NOT_TAKEN
        if again and now >= refused_at + REFUSED_PAUSE:
            until, self._refused_at, self._late = self._until, None, True
            self._send_step(step, now)
            self.deadline = self._until = until
        return False

    def _send_step(self, step: Step, now: float) -> None:
        self._preparing = False
        # after function 00h, too: a late answer to the request before never fits
        self._toggle = self._next_toggle(step, now)
        left, self._request = self._left, self._make_request(step, self._toggle)
        if isinstance(step, RegisterWrite):
            self._open.append(self._request)
            left = partial(self._write_left, step)
        self.deadline = self._until = now + self._patience(step)
        self._late_until = self._until + self.silence + LATE_MAX
        self._asked.append(self._request)
        self._send(self._request, left)

    def _make_request(self, step: Step, toggle: bool) -> PkwMessage:
        if isinstance(step, RegisterRead):
            return pkw.read_request(step.address, step.count, toggle)
        return pkw.write_request(step.address, step.words, toggle)


def _fits(answer: PkwMessage, request: PkwMessage) -> bool:
    """Return whether an answer may be that to a request, function 00h included."""
    return (answer.code == Function.NONE if request.code == Function.NONE else
            pkw.answers(answer, request))


def _conflicts(written: Iterable[PkwMessage], request: PkwMessage) -> bool:
    """Return whether something else was written to the registers of a request."""
    return any(each.words != request.words and each.address == request.address
               for each in written)


def _is_blind(step: Step | None) -> bool:
    return isinstance(step, RegisterWrite) and step.blind


MailboxChannel = Channel[Step, Reply]
