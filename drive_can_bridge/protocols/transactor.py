# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What does one acyclic exchange at a time, as a family does it; :mod:`.channel` does the rest.

A transactor knows the frames of its family, what answers what, how long answers take, and how
frames are paced. It knows nothing of procedures, priorities, repetitions and quarantine.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
import math
from typing import Any, Generic, TypeVar

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.requests import Failure, FailureKind, refused, RetryPolicy

#: what an answer that does not say what it answers can be mistaken for
ANYTHING: Hashable = 'anything'

#: what a procedure wants done, and what it is told of it
StepT = TypeVar('StepT')
ReplyT = TypeVar('ReplyT')
#: and what it returns
ResultT = TypeVar('ResultT')
ContentT = TypeVar('ContentT')


# -- what became of a step, where drives acknowledge writes ---------------------------------------


@dataclass(frozen=True)
class Answered(Generic[ContentT]):
    """The drive did it; ``content`` is what was read (of a write: nothing in particular)."""

    content: ContentT


@dataclass(frozen=True)
class Refused:
    """The drive refused it with a code. Nothing was changed."""

    code: int
    meaning: str = field(default='', compare=False)

    @property
    def text(self) -> Sentence:
        """The refusal in words."""
        return sentences.refused_by_drive(self.code, self.meaning)

    @property
    def absent(self) -> bool:
        """The drive reports that it has no such object."""
        return self.failure.kind is FailureKind.ABSENT

    @property
    def failure(self) -> Failure:
        """What became of the request."""
        return refused(self.code, self.text)


@dataclass(frozen=True)
class Silence:
    """
    No answer came.

    :param sent: False: it was not even sent.
    :param refused: the bus did not take it.
    """

    sent: bool = True
    refused: bool = False


SILENT, NOT_TAKEN = Silence(), Silence(sent=False, refused=True)


# -- one exchange ---------------------------------------------------------------------------------


class Transactor(ABC, Generic[StepT, ReplyT]):
    """
    Does one exchange at a time, as a family does it.

    What a family has to add: :meth:`begin` sends the request of a step, once it is noted down by
    :meth:`expect`; :meth:`receive` makes a reply of an answer. That an exchange has its time, and
    how it ends without an answer, is the same for all.

    :param retry: how long and how often the drive is asked.
    :ivar anonymous: answers do not say what they answer.
    :ivar step: what the exchange under way is for.
    :ivar busy: an exchange is under way.
    :ivar deadline: when :meth:`handle_timer` wants to be called because of it; infinity: never.
    :ivar silent: the reply that says that nobody has answered.
    :ivar wake: to be called with the time when an exchange ended in another way than by
        :meth:`receive` and :meth:`handle_timer`, which then tells how.
    """

    anonymous = busy = False
    deadline = math.inf
    step: StepT | None = None
    silent: ReplyT
    wake: Callable[[float], None]

    def __init__(self, retry: RetryPolicy) -> None:
        self.retry = retry
        self._reply: ReplyT | bool = False  # that ends the exchange, but is no answer

    @abstractmethod
    def begin(self, step: StepT, now: float) -> None:
        """Begin an exchange; none is under way."""

    def expect(self, step: StepT, until: float) -> None:
        """Record that an exchange has begun, and how long its answer is waited for."""
        if self.busy:
            raise RuntimeError('an exchange is under way')
        self.step, self.busy, self.deadline, self._reply = step, True, until, False

    @abstractmethod
    def receive(self, answer: Any, now: float) -> ReplyT | bool:
        """
        Match an answer, in the form that the family gives it.

        :return: the reply that ends the exchange under way; True: it goes on; False: nobody
            asked for this answer.
        :raises RemoteProtocolError: it is malformed, or belongs to something else.
        """

    def answers(self, answer: Any, step: StepT) -> bool:
        """Return whether an answer may be that to a step that was given up."""
        return True

    def end(self, step: StepT, reply: ReplyT, now: float) -> None:
        """End the exchange for a step, if it is still under way, by what is no answer."""
        if self.step is step:
            self._reply = reply
            self.wake(now)

    def handle_timer(self, now: float) -> ReplyT | bool:
        """Return the reply that ends the exchange under way; False: none does."""
        reply = self._reply
        if reply is False:
            if now < self.deadline:
                return False
            reply = self.silent
        self.finish()
        return reply

    def finish(self) -> None:
        """Record that the exchange under way has ended."""
        self.step, self.busy, self.deadline = None, False, math.inf

    def forget(self) -> None:
        """End the exchange under way, if any, without a reply; drop what waits."""
        self.finish()

    @abstractmethod
    def attempts(self, step: StepT) -> int:
        """Return how often a step is done until it counts as unanswered."""

    def unanswered(self, step: StepT, reply: ReplyT) -> bool:
        """Return whether a reply is no answer, and a late one may come."""
        return isinstance(reply, Silence) and reply.sent

    def again(self, step: StepT) -> bool:
        """Return whether a step is the one before once more: what answers either answers both."""
        return False

    def repeatable(self, step: StepT, *, users: bool) -> bool:
        """
        Return whether a step that had to make room, or is not believed, is done once more.

        :param users: somebody else asked for it: a write of theirs is done once.
        """
        return True

    @property
    def silence(self) -> float:
        """How many s after its deadline an answer may still come."""
        return self.retry.timeout

    def abandon(self, until: float) -> None:
        """Wait for the answer under way until then at most, where others have to wait for it."""

    def key(self, step: StepT) -> Hashable | None:
        """Return what a late answer to the step could be mistaken for; None: nothing."""
        return None

    def late_key(self, step: StepT) -> Hashable | None:
        """Return by which key late answers to others can be taken for that to a stop."""
        return self.key(step)

    def ready_at(self, step: StepT, *, stop: bool) -> float:
        """
        Return when a step may begin.

        :param stop: it stops the drive.
        """
        return -math.inf

    def aside(self, is_late: Callable[[Hashable], bool]) -> StepT | None:
        """
        Return what is asked, once, to learn that nothing older comes; None: there is nothing.

        Drives answer in order.

        :param is_late: tells whether answers to others, by key, may be mistaken for that to it.
        """
        return None

    def held_until(self, step: StepT, now: float) -> float:
        """Return until when a step of a user waits, while others go on."""
        return -math.inf

    def handle_stall(self, now: float) -> ReplyT | bool:
        """
        Record a stall until now.

        :return: the reply that ends the exchange under way; False: none does.
        """
        return False

    def express(self, now: float, held_until: float) -> bool | None:
        """
        Send something that is no exchange and goes before all of them.

        :param held_until: nothing that does not stop the drive is sent before.
        :return: True: something was sent; False: something waits, and nothing may begin before;
            None: there is nothing.
        """
        return None

    def express_at(self, held_until: float) -> float:
        """Return when :meth:`express` wants to be called; infinity: never."""
        return math.inf
