# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The machine behind ``~/enable``, ``~/reset_fault`` and ``~/quick_stop`` of one drive.

It decides which control word is sent now. The session of the drive sends that word, reports that
it left (:meth:`~ControlMachine.word_sent`) and what status words come back, and hands the outcome
of each request to the caller. The rules for requests stand in :mod:`.control`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import (
    ControlAction, ControlCompleted, ControlRequest, Meeting, MEETINGS, Seen, STEPS, TableRules,
    Then)
from drive_can_bridge.core.messages import NOTHING, Sentence, together
from drive_can_bridge.core.profile import ControlTable, StatusPattern
from drive_can_bridge.core.status_reports import (
    disregard_text, state_text, StatusReports, stuck_text, success_text, Wording)

#: s that a drive may go on running under ``disable`` at least until that is reported
RUNNING_ON_MAX = 1.0
#: how often the reset word leaves where it is not acknowledged
RESET_CYCLES = 3
_STOPS = (ControlAction.DISABLE, ControlAction.QUICK_STOP)


class StopNotFollowed:
    """
    Notices a condition that lasts.

    :param timeout: s that a caller of a stop waits, ramps included: it may last so long.
    :ivar text: what was reported of it; '': nothing.
    """

    def __init__(self, timeout: float) -> None:
        self.text = NOTHING
        self._longest = max(RUNNING_ON_MAX, timeout)
        self._since = math.inf

    def lasts(self, now: float, *, so: bool) -> bool:
        """Record whether the condition holds now; return whether it is to be reported."""
        if not so:
            self.forget()
            return False
        self._since = min(self._since, now)
        return not self.text and now - self._since > self._longest

    def forget(self) -> None:
        """Record that it is over."""
        self._since, self.text = math.inf, NOTHING


@dataclass(slots=True)
class Operation:
    """
    The request that is under way.

    :ivar requests: those that wait for it; a quick stop for which there is no word waits for
        ``disable``.
    :ivar pulsed: the reset word has left as often as it has to.
    :ivar held: it is answered, and only keeps its word: whatever else is wanted may end it.
    """

    action: ControlAction
    deadline: float
    requests: list[ControlRequest] = field(default_factory=list)
    pulsed: bool = False
    held: bool = False


class ControlAnswers:
    """The outcomes of requests until they are fetched."""

    def __init__(self) -> None:
        self._completed: list[ControlCompleted] = []

    def complete(self, request: ControlRequest, success: bool, message: Sentence, *,
                 by_fault: bool = False) -> None:
        """Record the outcome of one request."""
        self._completed.append(ControlCompleted(request, success, message, by_fault))

    def answer(self, operation: Operation, success: bool, message: Sentence, *,
               by_fault: bool = False) -> None:
        """Record the outcome of all requests that wait for an operation."""
        for request in operation.requests:
            instead = request.action is not operation.action
            self.complete(
                request, success, sentences.disabled_instead(message) if instead else message,
                by_fault=by_fault)
        operation.requests.clear()

    def take(self) -> list[ControlCompleted]:
        """Return the outcomes since the last call."""
        completed = self._completed
        if completed:
            self._completed = []
        return completed


class ControlMachine:
    """
    Brings one drive to the requested state, by the words and conditions of a table.

    After any call, look at :attr:`word`, :attr:`take_completed`, :meth:`take_notes`,
    :attr:`due`. Time is that of a steady clock, in s.

    :param timeout: seconds until an unconfirmed request fails.
    :param pulse: how often the reset word leaves: once where writes are acknowledged.
    :param members: names of the drives, where several share the control word.
    :param unheard: returns which of them may run without answering any more; '' if none.
    :param wording: what the family knows of status words.
    :param rules: choose the word for what is wanted; None: the table does.
    :ivar word: control word to send now.
    :ivar word_left_at: when it left first. A status requested earlier does not count for it.
    :ivar table: the words and conditions.
    :ivar fault_text: which fault it is, if that is known.
    :ivar take_completed: returns the outcomes since the last call; asked after every frame.
    """

    def __init__(self, table: ControlTable, *, timeout: float, pulse: int = RESET_CYCLES,
                 members: Sequence[str] = (), unheard: Callable[[], Sentence] = lambda: NOTHING,
                 wording: Wording | None = None, rules: TableRules | None = None) -> None:
        self.table = self._table = table
        self._timeout = timeout
        self._pulse = pulse
        self._pulses_left = 0
        self._rules = rules or TableRules(table)
        self._known = self._rules.known
        self._reports = StatusReports(table, members)
        self._unheard = unheard
        self._wording = wording
        self._sending = ControlAction.DISABLE   # by name: two words may have the same bits
        self.word = self._rules.word(self._sending, asked=None)
        self._sent = self._again = False        # the current word left; is to leave once more
        self.word_left_at = -math.inf
        self._fault: bool | None = None         # None: not known
        self.fault_text = ''
        self._reached = False                   # enabled was confirmed for this enable word
        self._seen_enabled: set[str] = set()    # which members reported it, knowing that word
        self._disregard = StopNotFollowed(timeout)
        self._operation: Operation | None = None
        self._answers = ControlAnswers()
        self.take_completed = self._answers.take
        self._notes: list[Sentence] = []

    # -- what the session and diagnostics look at -------------------------------------------------

    @property
    def at_rest(self) -> bool:
        """Whether the current word stops the drive: it has the bits of ``disable``."""
        return self._rules.rests(self.word)

    @property
    def loose(self) -> bool:
        """Whether nothing drives the axis, by what the drive reports, even if it is enabled."""
        return self.off or self._rules.loose

    @property
    def stopping(self) -> bool:
        """Whether the current word stops a drive, and so is sent without waiting."""
        return self._sending in _STOPS

    @property
    def starts(self) -> bool:
        """Whether the current word starts a drive, or lets it run on, or resets its fault."""
        return not (self.at_rest or self.stopping)

    @property
    def pulsing(self) -> bool:
        """Whether the current word is a pulse, which has to leave again soon."""
        return self._sending is ControlAction.RESET_FAULT

    @property
    def operating(self) -> bool:
        """Whether ``enable`` was sent, and the drive reports enabled (or cannot report it)."""
        return self._reached

    @property
    def off(self) -> bool:
        """Whether the drive reports that it drives nothing, or cannot and was commanded so."""
        if self._table.enabled is None:
            return self._sending is ControlAction.DISABLE and self._sent
        return self._reports.off

    @property
    def word_due(self) -> bool:
        """Whether the word has not left since it changed, :meth:`withdraw`, or a new stop."""
        return not self._sent or self._again

    @property
    def state(self) -> str:
        """State of the drive in words; see :func:`.control_texts.state_text`."""
        return state_text(self._reports, self._table, self._wording, self._sending, self._sent)

    @property
    def fault(self) -> bool:
        """Whether the drive reports a fault, or did with its last status."""
        return self._fault is True

    @property
    def pending(self) -> bool:
        """Whether a request, or a quick stop that is answered already, is under way."""
        return self._operation is not None

    @property
    def unconfirmed(self) -> bool:
        """Whether the drive has reported since the word left, but not what the word wants."""
        if not self._sent or not self._reports.answered:
            return False
        if self._sending is ControlAction.DISABLE:
            return self._reports.running_on
        # what the drive does not report at all, it cannot confirm; and a pulse has its own end
        return self.pending and not self.pulsing and not self.unseen

    @property
    def confirmed_off(self) -> bool:
        """Return whether the drive, knowing the current word, reports that it does not run."""
        if self._table.enabled is None:
            return self._sent
        return self._reports.standing and not self._rules.may_run

    @property
    def unseen(self) -> bool:
        """Whether the drive does not report whether it runs."""
        return self._table.enabled is None

    @property
    def holds(self) -> Sentence:
        """Text for a drive in a quick stop that does not end by itself; '' if it is in none."""
        return self._rules.holds

    @property
    def disregard(self) -> Sentence:
        """Text for a drive that runs on under a stop, with advice; '' for others."""
        return self._disregard.text

    def take_notes(self) -> list[Sentence]:
        """Return the lines for the log since the last call."""
        notes = self._notes
        if notes:   # seldom, and asked for with every status
            self._notes = []
        return notes

    # -- inputs -----------------------------------------------------------------------------------

    def request(self, request: ControlRequest, now: float) -> None:
        """Handle a request; its outcome may be there when this returns."""
        self.handle_timer(now)
        action = request.action
        if action is ControlAction.QUICK_STOP and action not in self._known:
            action = ControlAction.DISABLE
        if action not in self._known and self._nothing_to_do(action):
            self._answers.complete(request, True, sentences.state_reached(self.state))
            return
        refusal = self._refusal(action)
        if refusal is not None:
            self._answers.complete(request, False, refusal)
            return
        under_way = self._operation
        if under_way is None or MEETINGS[action, under_way.action] is not Meeting.JOINS:
            if action is ControlAction.RESET_FAULT and self._nothing_to_do(action) and (
                    under_way is None or under_way.action in _STOPS):
                self._answers.complete(request, True, sentences.state_reached(self.state))
                return
            may_run = self._may_run
            if under_way is not None:
                self._end(False, sentences.replaced(request.action.value))
            under_way = self._operation = Operation(action, now + self._timeout)
            if action is ControlAction.QUICK_STOP and may_run and (
                    not self._fault or self._reports.sound_ones_run):
                self._send(ControlAction.QUICK_STOP)
            elif action is not ControlAction.ENABLE:    # of an enabled drive: nothing to do
                self._send(ControlAction.DISABLE)
        self._choose()
        self._again = action in _STOPS and self.unconfirmed
        if not under_way.requests and self._table.enabled is not None:
            under_way.deadline = now + self._timeout
        under_way.requests.append(request)
        self._advance()

    def word_sent(self, now: float) -> None:
        """
        Record that the current word left.

        Call it each time the bus has taken the word, before the response can arrive; where a write
        is acknowledged, at the acknowledgement. A word that meanwhile is not the current one any
        more does not count.
        """
        if self.word_due:
            self.word_left_at = now
        self._sent, self._again = True, False   # before the timer, which may change the word
        self._rules.left(self.word)
        if self.pulsing:
            self._pulses_left -= 1
        self.handle_timer(now)
        self._advance()

    def status_received(self, raw: int | None, now: float, member: str = '') -> None:
        """
        Handle a status word.

        :param raw: None when a response arrived that should hold a status word, but did not.
        :param member: which drive's it is, where several drives share the control word.
        """
        self.handle_timer(now)
        if self._reports.take(member, raw, counts=self._sent) and raw is not None:
            behind = self._sent
            self._rules.reported(raw, behind=behind)
            self._choose()      # what another word has to bring about is not confirmed yet
            self._watch_fault(raw)
            self._watch_enabled(member, raw, behind=behind)
            self._advance()
            self._choose()
            self._watch_disabled(now)

    def rules_changed(self) -> None:
        """Handle a change of the rules' choice that no status word has caused."""
        self._choose()

    def member_found(self, name: str) -> None:
        """Record that a member is online."""
        self._reports.find(name)

    def member_lost(self, name: str) -> None:
        """Record that a member is offline. The others do not run without it."""
        if not self._reports.lose(name):
            return
        self._fault = None if self._fault is None else self._reports.faulted
        under_way = self._operation
        if self._reached or (
                under_way is not None and under_way.action is ControlAction.ENABLE):
            self.drop(sentences.members_offline([name]), 'the group')
        self._advance()

    def word_refused(self, word: int, reason: Sentence, now: float) -> None:
        """
        Record that the drive refused a control word: what is under way fails.

        :param reason: the drive's reason, in words.
        """
        self.handle_timer(now)
        if word == self.word and self._operation is not None:
            self._end(False, sentences.word_refused(word, reason))

    def handle_timer(self, now: float) -> None:
        """End what is overdue. May be called early or late."""
        under_way = self._operation
        if under_way is None or now < under_way.deadline:
            return
        text = stuck_text(
            self._reports, self._table, self._wording, self.state, self._timeout, self._sending,
            self.word, sent=self._sent, pulsed=under_way.pulsed,
            acknowledged=self._pulse < RESET_CYCLES, fault=self.fault_text,
            more=self._rules.remark(self._sending))
        if self._sending is ControlAction.QUICK_STOP and self._reports.braking:
            under_way.deadline = now + self._timeout    # `disable` would end the braking
            self._answers.answer(under_way, False, text)
        else:
            self._end(False, text)

    @property
    def due(self) -> float:
        """When :meth:`handle_timer` is to be called; infinity: never."""
        return math.inf if self._operation is None else self._operation.deadline

    def drop(self, reason: Sentence, whom: str = 'the drive') -> None:
        """End what is under way, and what was reached, without a user's request."""
        if self._reached:
            self._notes.append(sentences.enable_withdrawn(reason, whom))
        self._end(False, reason)

    def withdraw(self, reason: Sentence, now: float, *, lost: bool = True) -> None:
        """
        Go back to ``disable``: the drive went offline or restarted, or the bridge stops.

        Open requests fail, the word is :attr:`word_due`; the state of one that is ``lost`` is
        unknown.
        """
        self.handle_timer(now)
        self.drop(reason)
        self._sent = False
        self._reports.forget_answers()
        if lost:
            self._reports.forget()
            self._rules.forget()
            self._choose()
        self._disregard.forget()
        self._fault = self._fault or None   # a known one stands until the drive reports otherwise

    # -- rules ------------------------------------------------------------------------------------

    def _nothing_to_do(self, action: ControlAction) -> bool:
        """Return whether the drive is known to be where an action would bring it."""
        if action is ControlAction.QUICK_STOP:
            return not self._may_run
        return action is ControlAction.RESET_FAULT and self._fault is False

    def _refusal(self, action: ControlAction) -> Sentence | None:
        """Return why a request cannot be accepted, in words; None if it can."""
        if action not in self._known:
            return sentences.no_reset_word()
        if action is ControlAction.ENABLE and self._reports.missing:
            return sentences.members_offline(self._reports.missing)
        if action is ControlAction.ENABLE and self._fault:
            return sentences.reset_first(self.fault_text)
        under_way = self._operation
        if under_way is None or under_way.held or (
                MEETINGS[action, under_way.action] is not Meeting.REFUSED
                or self._nothing_to_do(action)):
            return None
        return together((
            sentences.stop_under_way(under_way.action.value, action.value),
            sentences.still_braking() if self._reports.braking else NOTHING))

    def _advance(self) -> None:
        """Perform the next step of what is under way, if its conditions are seen."""
        under_way = self._operation
        if under_way is not None:
            for step in STEPS:
                if (step.request is under_way.action and step.word is self._sending
                        and all(self._sees(each, under_way) for each in step.when)):
                    self._take(step.then, under_way)
                    return
            if self._sending is ControlAction.QUICK_STOP and self._reports.answered and (
                    holds := self._rules.holds):
                under_way.held = True
                self._answers.answer(under_way, True, holds)

    def _sees(self, wanted: Seen, under_way: Operation) -> bool:
        table = self._table
        match wanted:
            case Seen.NO_FAULT:
                return self._confirmed(table.fault, False)
            case Seen.READY:
                return self._confirmed(table.ready, True)
            case Seen.ENABLED:
                return self._confirmed(table.enabled, True) and not self._rules.lacking
            case Seen.OFF:
                return self.confirmed_off
            case Seen.RESETTABLE:
                return not under_way.pulsed and self._resettable()
            case Seen.PULSED:
                return self._pulses_left <= 0
            case Seen.REPORTS:
                return table.enabled is not None

    def _take(self, then: Then, under_way: Operation) -> None:
        match then:
            case Then.SEND_ENABLE:
                self._send(ControlAction.ENABLE)
            case Then.SEND_RESET:
                self._pulses_left = self._pulse
                self._send(ControlAction.RESET_FAULT)
            case Then.SEND_DISABLE:
                under_way.pulsed = True
                self._send(ControlAction.DISABLE)
            case Then.ANSWER:
                self._answers.answer(under_way, True, self._success(under_way))
            case Then.SUCCEED_AND_STAY:
                self._reached = True
                self._end(True, self._success(under_way), stays=True)
            case Then.SUCCEED:
                unheard = self._unheard() if under_way.action in _STOPS else NOTHING
                self._end(not unheard, unheard or self._success(under_way))

    def _success(self, under_way: Operation) -> Sentence:
        """Return the text of a success: what was reached, or that it is not reported."""
        if under_way.action is not ControlAction.RESET_FAULT:
            return together((
                success_text(self._table, self._sending, self.state), self._rules.proviso()))
        return (sentences.reset_not_reported() if self._table.fault is None else
                sentences.state_reached(self.state))

    def _watch_fault(self, raw: int) -> None:
        """Record a fault that comes or goes; it ends everything but stops and resets."""
        if self._table.fault is None:
            return
        fault = self._table.fault.matches(raw)
        if not fault and (self._fault is False or self._reports.faulted):
            return      # nothing new; or its fault ends with that of the last member
        had_fault, self._fault = self._fault, fault
        if not self._fault:
            if had_fault:
                self._notes.append(sentences.fault_gone(self._reports.text))
            return
        if not had_fault:
            self._notes.append(sentences.fault_came(self._reports.text, self._reached))
        under_way = self._operation
        if under_way is not None and under_way.action is ControlAction.ENABLE:
            self._end(False, sentences.fault_while_enabling(self._reports.text), by_fault=True)
        elif self._sending is not ControlAction.RESET_FAULT and not (
                self._sending is ControlAction.QUICK_STOP and self._reports.sound_ones_run):
            self._send(ControlAction.DISABLE)

    def _watch_enabled(self, member: str, raw: int, *, behind: bool) -> None:
        """Withdraw the enable word from a drive that dropped out by itself, confirmed or not."""
        table = self._table
        if self._sending is not ControlAction.ENABLE or table.enabled is None:
            return
        if table.enabled.matches(raw):
            if behind:
                self._seen_enabled.add(member)
            return
        if self._reached:
            self._notes.append(sentences.dropped_out_for_good(self._reports.text))
        elif member not in self._seen_enabled and not (
                table.braking is not None and table.braking.matches(raw)):
            return      # it is on its way
        self._end(False, sentences.dropped_out(self._reports.text))

    def _watch_disabled(self, now: float) -> None:
        """Report a drive that runs on although its control word is there to stop it."""
        if self._disregard.lasts(now, so=self._sending in _STOPS and self._sent and (
                not self._fault and self._reports.running_on and not self._rules.holds)):
            self._disregard.text = disregard_text(
                self._reports, self.state, self._sending, self.word)
            self._notes.append(self._disregard.text)

    @property
    def _may_run(self) -> bool:
        """Whether a stop has anything to do, as far as is known."""
        return (self._sending in (ControlAction.ENABLE, ControlAction.QUICK_STOP)
                or not self.confirmed_off)

    def _confirmed(self, pattern: StatusPattern | None, wanted: bool) -> bool:
        """Return whether the drive, knowing the current word, reports a condition (or cannot)."""
        return self._sent if pattern is None else self._reports.confirmed(pattern, wanted)

    def _resettable(self) -> bool:
        """Return whether the drive, knowing ``disable``, reports a fault that can be reset."""
        return self._sent if self._table.fault is None else self._reports.resettable

    def _send(self, action: ControlAction) -> None:
        """Set which action the current word serves."""
        self._sending = action
        self._seen_enabled.clear()
        self._reached = self._reached and action is ControlAction.ENABLE
        self._choose()

    def _choose(self) -> None:
        """Choose the word for what is wanted; a new one has yet to leave."""
        under_way = self._operation
        word = self._rules.word(
            self._sending, asked=None if under_way is None else under_way.action)
        if word != self.word:
            self.word = word
            self._sent = False
            self._reports.forget_answers()
            self._disregard.forget()

    def _end(self, success: bool, message: Sentence, *, stays: bool = False,
             by_fault: bool = False) -> None:
        """Complete what is under way, if anything; unless its word stays, ``disable`` follows."""
        under_way, self._operation = self._operation, None
        if under_way is not None:
            self._answers.answer(under_way, success, message, by_fault=by_fault)
        if not stays:
            self._send(ControlAction.DISABLE)
