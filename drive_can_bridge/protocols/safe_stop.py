# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The stop of a drive by acyclic writes, whatever its family: which writes, and what follows.

How that is written and confirmed, and how often it is tried, is a procedure of the family, of the
first priority. At the end of the bridge, a drive that has confirmed it is asked once for its
status: what it was told is not what it does.

A drive that falls silent is told to stop, and may not hear it. When it is back, it is told with
the first exchange that is complete. Until then, and that may be for ever if it answers a part
only, any sign of life has it told again (:class:`StopAgain`): at once, and then with pauses.
"""

from collections.abc import Callable, Generator, Iterable
from functools import partial
import math
from typing import Any, Generic, NamedTuple, Union

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.process_image import control_word
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.core.stop_duty import CONTROL_WORD, Happened
from drive_can_bridge.protocols.channel import Channel, Priority
from drive_can_bridge.protocols.transactor import Refused, ReplyT, Silence, StepT

#: how often a drive is told to stand still by writes, at most, until it has confirmed that
STOP_ATTEMPTS = 3
#: s that an answer is waited for at most where a stop is read back, and for the status then
ANSWER_TIME = 0.1

#: reads one word: the raw integer, or None
StatusRead = Generator[StepT, ReplyT, Union[int, None]]


class StopWrite(NamedTuple):
    """What makes a drive stand still; ``is_word``: it is the control word."""

    parameter: Parameter
    raw: int
    is_word: bool = False

    @property
    def name(self) -> str:
        """What it is called in messages."""
        return f'{self.parameter.name} {self.raw:04X}h' if self.is_word else self.parameter.name


def write_until_answered(
        writes: Iterable[StopWrite],
        write: Callable[[StopWrite], Generator[StepT, ReplyT, tuple[ReplyT, int, Sentence]]],
        ) -> Generator[StepT, ReplyT, list[Sentence]]:
    """
    Stop a drive that acknowledges writes, each thing until it is answered or was tried enough.

    :param write: returns what became of one, after how many attempts, and what silence may mean.
    :return: what failed, in words.
    """
    failed: list[Sentence] = []
    for each in writes:
        reply, attempts, hint = yield from write(each)
        if isinstance(reply, Refused):
            failed.append(sentences.write_refused(each.name, reply.text))
        elif isinstance(reply, Silence):
            failed += [sentences.write_not_taken(each.name)] if reply.refused else [
                sentences.write_not_acknowledged(each.name, attempts), *filter(None, (hint,))]
    return failed


class _Kind(NamedTuple):
    """What a stop is about, as it was when it began; ``whole``: all setpoints are in it."""

    stop_pending: bool
    always_report: bool
    again: bool
    whole: bool


class SafeStop(Generic[StepT, ReplyT]):
    """
    The acyclic stop of one drive.

    :param ended: called when it has run its course.
    :param status: the word to be read in the end; None: there is none, or it comes by itself.
    :param word: the control word, where no profile has it.
    :param read: (word, s to wait for the answer): reads it once; None: no answer.
    :ivar running: it is under way.
    :ivar again: the last one was told again.
    :ivar again_at: when one that was told again had run its course, the last time.
    """

    def __init__(self, session: Session, channel: Channel[StepT, ReplyT],
                 ended: Callable[[], None], status: Parameter | None,
                 read: Callable[[Parameter, float], StatusRead[StepT, ReplyT]],
                 word: Parameter | None = None) -> None:
        self.running = self.again = False
        self.again_at = -math.inf
        self._status, self._read = status, read
        self._session = session
        self._channel = channel
        self._ended = ended
        self._word = word or control_word(
            session.configuration, controlled=session.control is not None)

    @property
    def answer_time(self) -> float:
        """How many s an answer is waited for where a stop is read back, and for the status."""
        return min(ANSWER_TIME, self._session.retry.timeout)

    def writes(self, *, word: bool = True, setpoints: bool = True) -> list[StopWrite]:
        """
        Return what has to be written: ``disable``, then neutral setpoints.

        But no position where the axis may not be any more, and no limit.

        :param word: the control word has to be told.
        :param setpoints: they have to be told.
        """
        control, found = self._session.control, []
        if word and control is not None and self._word is not None:
            found.append(StopWrite(self._word, control.table.disable, is_word=True))
        if setpoints:
            found += [StopWrite(setpoint.parameter, setpoint.neutral)
                      for setpoint in self._session.setpoints.items
                      if setpoint.known and not setpoint.parameter.limit]
        return found

    def begin(self, procedure: Generator[StepT, ReplyT, list[Sentence]], now: float, *,
              setpoints: bool = True, always_report: bool = False, again: bool = False) -> None:
        """
        Begin.

        :param procedure: returns what failed, in words; nothing: the drive has confirmed it all.
        :param setpoints: False: they are stopped in another way.
        :param always_report: what failed is told even if the drive was not told to run.
        :param again: that it failed before was told: what is new is that it does not.
        """
        session = self._session
        self.running, self.again = True, again
        kind = _Kind(session.stop_pending and not again, always_report, again,
                     setpoints and not session.interlock.position_unknown)
        self._channel.run(
            self._then_poll(procedure), partial(self._done, kind), now, Priority.STOP)

    def poll(self, now: float) -> None:
        """Read the status at the end of a stop by other means, if it does not come by itself."""
        if self._status is not None and not self.running:
            self.running = True
            self._channel.run(self._poll(), self._polled, now, Priority.STOP)

    def forget(self) -> None:
        """Record that the channel was cleared."""
        self.running = False

    def _then_poll(self, procedure: Generator[StepT, ReplyT, list[Sentence]],
                   ) -> Generator[StepT, ReplyT, list[Sentence]]:
        failed = yield from procedure
        if not failed:
            yield from self._poll()
        return failed

    def _poll(self) -> Generator[StepT, ReplyT, None]:
        session = self._session
        if self._status is None or session.active or not session.online:
            return
        raw = yield from self._read(self._status, self.answer_time)
        if raw is not None:
            session.interlock.status(raw, self._channel.now)

    def _polled(self, _: None) -> None:
        self.running = False
        self._ended()

    def _done(self, kind: _Kind, failed: list[Sentence]) -> None:
        session, self.running = self._session, False
        if kind.again:
            self.again_at = self._channel.now
        # it may have fallen silent since: with what it was told just before
        stop_pending = kind.stop_pending or session.stop_pending and not kind.again
        if not failed:
            if kind.whole:
                session.duty.happened(Happened.STOPPED)
            else:
                for happened in (Happened.STOP_LEFT, Happened.ANSWERED):    # it was read back
                    session.duty.channel(CONTROL_WORD, happened)
                if not session.active:  # in its end, to be disabled is enough
                    session.duty.happened(Happened.ANSWERED)
            if kind.again and not session.stop_pending:
                session.report.note(Noted(sentences.stopped_again()))
        elif stop_pending or kind.always_report:
            session.report.warn(sentences.stop_failed(failed), may_run=stop_pending)
            # the activation ends with it: there is no more to be said; behind a defect it goes on
            if not session.activated:
                session.duty.happened(Happened.SAID)
        self._ended()


#: s after one that was told again until the next: what looks for the drive goes on meanwhile
PAUSE = 1.0
#: longest such pause where each stop wears an EEPROM: they double
PAUSE_MAX = 60.0


class StopAgain:
    """
    The stops of an offline drive, written again until it has confirmed one.

    :param stop: what is told.
    :param tell: begins it.
    :param wears: it is written to an EEPROM.
    """

    def __init__(self, session: Session, channel: Channel[Any, Any], stop: SafeStop[Any, Any],
                 tell: Callable[[float], None], *, wears: bool = False) -> None:
        self._session = session
        self._channel = channel
        self._stop = stop
        self._tell = tell
        self._longest = PAUSE_MAX if wears else PAUSE
        self._pause = PAUSE
        self._first = True

    def sign_of_life(self, now: float, *, hurry: bool = False, answered: bool = False) -> None:
        """
        Record a sign of life, before an answer is taken that it may be.

        :param hurry: it is no answer, and for that to what is under way a moment will do; once,
            for a slow drive would never be found.
        :param answered: the answer that it may be has been taken.
        """
        if not self._wanted:
            self._pause, self._first = PAUSE, True
        elif now >= self._stop.again_at + self._pause and self._channel.is_idle(Priority.STOP):
            if hurry and self._first:
                self._channel.make_room(now)
            self._first = False
            if answered:
                self._again(now)
            else:
                self._channel.run(self._begin(), lambda _: None, now, Priority.STOP)

    @property
    def _wanted(self) -> bool:
        session = self._session
        return not session.online and session.stage is Stage.RUNNING and session.may_run

    def _begin(self) -> Generator[Any, Any, None]:
        """Begin when the exchange under way has ended, unless that has found the drive."""
        if self._wanted:
            self._again(self._channel.now)
        yield from ()

    def _again(self, now: float) -> None:
        self._pause = min(2 * self._pause, self._longest)
        self._session.duty.happened(Happened.SHOWED_UP)
        self._tell(now)
