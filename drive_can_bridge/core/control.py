# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The machine behind ``~/enable``, ``~/reset_fault`` and ``~/quick_stop`` of one drive.

It decides which control word is sent now. The session of the drive sends that word, reports that
it left (:meth:`~ControlMachine.word_sent`) and what status words come back, and hands the outcome
of each request to whoever asked. What a request does:

.. code-block:: text

    request      control word                     goes on, or is answered, when the status says
    -----------  -------------------------------  ---------------------------------------------
    ENABLE       disable                          ready, not enabled, no fault: goes on
                 enable                           enabled: success, the word stays
    DISABLE      disable                          not enabled: success
    QUICK_STOP   quick_stop                       not enabled: success, disable
    RESET_FAULT  disable (sent once: a new edge)  fault: goes on; no fault: success
                 reset_fault, a pulse             goes on when it has left often enough
                 disable                          no fault: success

Every other end of a request (time-out, fault, withdrawal, replacement) is a failure and leaves
``disable``. So ``enable`` is on the bus only for the sake of an ENABLE that nothing has ended
since; a fault, or a drive that drops out of ``enabled`` by itself, ends it like a stop does.

*Which status counts.* A status word confirms something only if it arrived after the current
control word had left; what was on its way before that tells of older times. A fault counts
always. For the same reason an enabled drive is found "enabled already" only while the control
word is ``enable``: under ``disable`` such a status is about to be outdated, and ENABLE waits for
the drive to let go first.

*A request while another is under way.* The same request again joins the first, and both are
answered together, at the first one's deadline at the latest. Of two different ones:

* DISABLE and QUICK_STOP take effect at once, whatever they interrupt, each other included: the
  newest word of somebody who wants the drive to stop is the one to obey.
* ENABLE and RESET_FAULT are refused while a DISABLE or QUICK_STOP is under way: no start cuts a
  stop short. (A RESET_FAULT with nothing to reset succeeds without disturbing the stop.)
* RESET_FAULT replaces an ENABLE, and the other way round as far as there is no fault.

A request that is refused changes nothing.

*Quick stop of a drive that does not run* is a DISABLE: answered at once where that is known, and
otherwise as soon as the drive confirms it. The same goes for a faulted drive, whose control word
is ``disable`` in any case.

*What a profile does not tell.* Where a condition is missing in the profile, having sent the word
is all the confirmation there is, and the answer says so. A quick stop then keeps its word for the
whole time-out, although it is answered at once: ``disable`` right after it would end the braking
before it began. A drive that does not report faults gets the reset pulse in any case.

*The pulse.* What nobody acknowledges may get lost, and a drive may look at its control word
seldom: so the word leaves :data:`RESET_CYCLES` times, and whoever sends it lets little time pass
between them (:attr:`~ControlMachine.pulsing`). Where a write is acknowledged, one is enough. The
pulse is the same whether or not the fault goes meanwhile; what counts is the status after it.

*Several drives with one control word.* What a status has to confirm, all of them have to
(:mod:`.status_reports`). ENABLE wants all of them to be there, and ends when one is lost.

*A drive that takes no notice.* A word that is written when it changes may get lost on the way.
:attr:`~ControlMachine.unconfirmed` tells the session that the drive, by what it reports since,
does not do as the word says: then the word is written again. A drive that goes on running under
``disable`` for longer than a request may take is told of (:attr:`~ControlMachine.disregard`). One
that says that it refuses the word (:meth:`~ControlMachine.word_refused`) ends what is under way,
with its reason.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
import math

from drive_can_bridge.core.profile import ControlTable, StatusPattern
from drive_can_bridge.core.status_reports import StatusReports, Wording


class ControlAction(Enum):
    """What can be asked of a drive; also names the control words of a profile."""

    ENABLE = 'enable'
    DISABLE = 'disable'
    QUICK_STOP = 'quick_stop'
    RESET_FAULT = 'reset_fault'


#: s that a drive may go on running under ``disable`` at least until that is told
RUNNING_ON_MAX = 1.0
#: how often the reset word leaves where nobody acknowledges it
RESET_CYCLES = 3

_STOPS = (ControlAction.DISABLE, ControlAction.QUICK_STOP)


@dataclass(frozen=True, slots=True, eq=False)
class ControlRequest:
    """Somebody asks for something; answered exactly once. Equal only to itself."""

    action: ControlAction


@dataclass(frozen=True, slots=True)
class ControlCompleted:
    """
    The outcome of a request; each gets exactly one.

    :param message: the state reached, or why it was not, for the answer of the service.
    """

    request: ControlRequest
    success: bool
    message: str


@dataclass(slots=True)
class _Operation:
    """What is under way, and the requests that wait for it."""

    action: ControlAction
    deadline: float
    requests: list[ControlRequest] = field(default_factory=list)
    pulsed: bool = False    # the reset word has left as often as it has to


class ControlMachine:
    """
    Bring one drive to the state that was asked for, by the words and conditions of a table.

    Without input or output: time is the argument ``now``, in seconds of a steady clock. After any
    call, look at :attr:`word`, :meth:`take_completed`, :meth:`take_notes`, :meth:`next_timer`.

    :param timeout: seconds until an unconfirmed request fails.
    :param pulse: how often the reset word leaves.
    :param members: names of the drives, where several share the control word.
    :param wording: what the family knows of status words.
    :ivar table: the words and conditions.
    """

    def __init__(self, table: ControlTable, *, timeout: float, pulse: int = RESET_CYCLES,
                 members: Sequence[str] = (), wording: Wording | None = None) -> None:
        self.table = self._table = table
        self._timeout = timeout
        self._pulse = pulse
        self._pulses_left = 0
        self._words = {
            ControlAction.DISABLE: table.disable,
            ControlAction.ENABLE: table.enable,
        }
        if table.quick_stop is not None:
            self._words[ControlAction.QUICK_STOP] = table.quick_stop
        if table.reset_fault is not None:
            self._words[ControlAction.RESET_FAULT] = table.reset_fault
        self._reports = StatusReports(table, members)
        self._wording = wording
        self._sending = ControlAction.DISABLE   # by name: two words may have the same bits
        self._sent = False                      # the current word left at least once
        self._fault: bool | None = None         # None: not known
        self._reached = False                   # enabled was confirmed for this enable word
        self._runs_on_since = math.inf          # under disable; told when it lasts
        self._disregard = ''
        self._operation: _Operation | None = None
        self._completed: list[ControlCompleted] = []
        self._notes: list[str] = []

    # -- what the session and diagnostics look at -------------------------------------------------

    @property
    def word(self) -> int:
        """Control word to send now."""
        return self._words[self._sending]

    @property
    def at_rest(self) -> bool:
        """The current word tells the drive to stand still: it has the bits of ``disable``."""
        return self.word == self._words[ControlAction.DISABLE]

    @property
    def stopping(self) -> bool:
        """The current word is there to stop a drive: it waits for nobody."""
        return self._sending in _STOPS

    @property
    def pulsing(self) -> bool:
        """The current word is a pulse: it has to leave again soon."""
        return self._sending is ControlAction.RESET_FAULT

    @property
    def operating(self) -> bool:
        """``enable`` is the word sent, and the drive reports enabled (or cannot report it)."""
        return self._reached

    @property
    def off(self) -> bool:
        """The drive reports that it does not drive anything, or cannot and was told so."""
        if self._table.enabled is None:
            return self._sending is ControlAction.DISABLE and self._sent
        return self._reports.off

    @property
    def word_due(self) -> bool:
        """The current word has not left since it changed, or since :meth:`withdraw`."""
        return not self._sent

    @property
    def state(self) -> str:
        """
        State of the drive in words.

        ``fault``, ``enabled``, ``ready``, ``not ready``, ``disabled`` (where the profile has no
        condition for ready), ``enable sent`` and the like (where the drive does not report), or
        ``unknown``.
        """
        if self._wording is not None:
            return self._reports.states(self._wording.state)
        table, says = self._table, self._reports.says
        if any((table.ready, table.enabled, table.fault)) and self._reports.telling is None:
            return 'unknown'
        if says(table.fault):
            return 'fault'
        if says(table.enabled):
            return 'enabled'
        if table.ready is not None and (
                table.enabled is not None or self._sending is ControlAction.DISABLE):
            return 'ready' if says(table.ready) else 'not ready'
        if table.enabled is not None:
            return 'disabled'
        return f'{self._sending.value} sent' if self._sent else 'unknown'

    @property
    def fault(self) -> bool:
        """The drive reports a fault, or did when it was last heard."""
        return self._fault is True

    @property
    def pending(self) -> bool:
        """A request, or a quick stop that is answered already, is under way."""
        return self._operation is not None

    @property
    def unconfirmed(self) -> bool:
        """The drive has reported since the current word left, but not what the word wants."""
        if not self._sent or not self._reports.answered:
            return False
        if self._sending is ControlAction.DISABLE:
            return self._reports.running_on
        # what the drive does not report at all, it cannot confirm; and a pulse has its own end
        return self.pending and not self.pulsing and self._table.enabled is not None

    @property
    def disregard(self) -> str:
        """How the drive goes on running although it shall not, and what to do; '' if not."""
        return self._disregard

    def take_completed(self) -> list[ControlCompleted]:
        """Return the outcomes since the last call."""
        completed, self._completed = self._completed, []
        return completed

    def take_notes(self) -> list[str]:
        """Return what the log should say of the drive since the last call."""
        notes, self._notes = self._notes, []
        return notes

    # -- inputs -----------------------------------------------------------------------------------

    def request(self, request: ControlRequest, now: float) -> None:
        """Take a request; its outcome may be there when this returns."""
        self.handle_timer(now)
        action = request.action
        missing = self._reports.missing if action is ControlAction.ENABLE else ()
        if missing:
            self._complete(request, False, f'{", ".join(missing)} offline')
            return
        if action not in self._words and self._nothing_to_do(action):
            under_way = self._operation
            if action is ControlAction.QUICK_STOP and under_way is not None and (
                    under_way.action not in _STOPS):
                self._end(False, 'replaced by quick_stop')  # what stands is to stay so
            self._complete(request, True, self.state)
            return
        refusal = self._refusal(action)
        if refusal is not None:
            self._complete(request, False, refusal)
            return
        under_way = self._operation
        if under_way is None or under_way.action is not action:
            if action is ControlAction.RESET_FAULT and self._nothing_to_do(action) and (
                    under_way is None or under_way.action in _STOPS):
                self._complete(request, True, self.state)
                return
            may_run = self._may_run
            if under_way is not None:
                self._end(False, f'replaced by {action.value}')
            under_way = self._operation = _Operation(action, now + self._timeout)
            if action is ControlAction.QUICK_STOP and may_run and not self._fault:
                self._send(ControlAction.QUICK_STOP)
            elif action is not ControlAction.ENABLE:    # of an enabled drive: nothing to do
                self._send(ControlAction.DISABLE)
        under_way.requests.append(request)
        self._advance()

    def word_sent(self, now: float) -> None:
        """
        Take note that the current word left.

        Call it each time the bus has taken the word, before the response can arrive; where a write
        is acknowledged, at the acknowledgement. A word that meanwhile is not the current one any
        more does not count.
        """
        self._sent = True           # before the timer, which may change the word
        if self.pulsing:
            self._pulses_left -= 1
        self.handle_timer(now)
        self._advance()

    def status_received(self, raw: int | None, now: float, member: str = '') -> None:
        """
        Take a status word.

        :param raw: None when a response arrived that should hold a status word, but did not.
        :param member: whose it is, where several drives share the control word.
        """
        self.handle_timer(now)
        if self._reports.take(member, raw, counts=self._sent) and raw is not None:
            self._watch_fault(raw)
            self._watch_enabled(raw)
            self._advance()
            self._watch_disabled(now)

    def member_found(self, name: str) -> None:
        """Take note that a member is online."""
        self._reports.find(name)

    def member_lost(self, name: str) -> None:
        """Take note that a member is offline. The others do not run without it."""
        if not self._reports.lose(name):
            return
        self._fault = None if self._fault is None else self._reports.faulted
        under_way = self._operation
        if self._reached or (
                under_way is not None and under_way.action is ControlAction.ENABLE):
            text = f'{name} offline'
            if self._reached:
                self._notes.append(f'enable withdrawn: {text}; only ~/enable starts the group '
                                   'again')
            self._end(False, text)
        self._advance()

    def word_refused(self, word: int, reason: str, now: float) -> None:
        """
        Take note that the drive refused a control word: what is under way fails.

        :param reason: what the drive says, in words.
        """
        self.handle_timer(now)
        if word == self.word and self._operation is not None:
            self._end(False, f'control word {word:04X}h {reason}')

    def handle_timer(self, now: float) -> None:
        """End what is overdue. Calling it early or late does no harm."""
        if now >= self.next_timer():
            self._end(False, self._overdue_text())

    def next_timer(self) -> float:
        """Return when :meth:`handle_timer` has something to do; ``math.inf`` if never."""
        return math.inf if self._operation is None else self._operation.deadline

    def withdraw(self, reason: str, now: float) -> None:
        """
        Go back to ``disable``: the drive went offline or restarted, or the bridge stops.

        Open requests fail with the reason. The status is forgotten, and the word counts as not
        sent: it is :attr:`word_due` again.
        """
        self.handle_timer(now)
        if self._reached:
            self._notes.append(f'enable withdrawn: {reason}; only ~/enable starts the drive again')
        self._end(False, reason)
        self._sent = False
        self._reports.forget()
        self._forget_disregard()
        if not self._fault:         # a known fault stands until the drive says otherwise
            self._fault = None

    # -- rules ------------------------------------------------------------------------------------

    def _nothing_to_do(self, action: ControlAction) -> bool:
        """Tell whether the drive is known to be where an action would bring it."""
        if action is ControlAction.QUICK_STOP:
            return not self._may_run
        return action is ControlAction.RESET_FAULT and self._fault is False

    def _refusal(self, action: ControlAction) -> str | None:
        """Return why a request cannot be taken, in words."""
        if action not in self._words:
            if action is ControlAction.QUICK_STOP:
                return ('no quick stop: the profile has no quick_stop word; '
                        '~/enable false disables the drive')
            return 'no fault reset: the profile has no reset_fault word'
        if action is ControlAction.ENABLE and self._fault:
            return 'fault: reset it first'
        under_way = self._operation
        if under_way is None or under_way.action not in _STOPS or action in _STOPS:
            return None
        if action is ControlAction.RESET_FAULT and self._fault is False:
            return None
        return f'{under_way.action.value} under way: try {action.value} again when it has ended'

    def _advance(self) -> None:
        """Take the next step of what is under way, if the drive confirms the last one."""
        under_way = self._operation
        if under_way is None:
            return
        table = self._table
        if under_way.action is ControlAction.ENABLE:
            if self._sending is ControlAction.DISABLE:
                if (self._confirmed(table.fault, False) and self._confirmed_off()
                        and self._confirmed(table.ready, True)):
                    self._send(ControlAction.ENABLE)
            elif self._confirmed(table.enabled, True):
                self._reached = True
                self._end(True, self._success_text())
        elif under_way.action is ControlAction.RESET_FAULT:
            if self.pulsing:
                if self._pulses_left <= 0:
                    under_way.pulsed = True
                    self._send(ControlAction.DISABLE)
            elif not under_way.pulsed and self._resettable():
                self._pulses_left = self._pulse
                self._send(ControlAction.RESET_FAULT)
            elif self._confirmed(table.fault, False):
                self._end(True, self.state if table.fault is not None else
                          'reset_fault sent; the drive does not report faults')
        elif self._confirmed_off():
            message = self._success_text()
            if table.enabled is None and self._sending is ControlAction.QUICK_STOP:
                self._answer(under_way, True, message)      # keeps braking
            else:
                self._end(True, message)

    def _watch_fault(self, raw: int) -> None:
        """Note a fault that comes or goes; it ends everything but stops and resets."""
        if self._table.fault is None:
            return
        fault = self._table.fault.matches(raw)
        if not fault and (self._fault is False or self._reports.faulted):
            return      # nothing new; or rid of it when the last of them is
        had_fault, self._fault = self._fault, fault
        if not self._fault:
            if had_fault:
                self._notes.append(f'fault gone ({self._reports.text})')
            return
        if not had_fault:
            again = '; only ~/enable starts the drive again' if self._reached else ''
            self._notes.append(f'fault ({self._reports.text}){again}')
        under_way = self._operation
        if under_way is not None and under_way.action is ControlAction.ENABLE:
            self._end(False, f'fault while enabling ({self._reports.text}): reset it first')
        elif self._sending is not ControlAction.RESET_FAULT:
            self._send(ControlAction.DISABLE)

    def _watch_enabled(self, raw: int) -> None:
        """Withdraw the enable word from a drive that dropped out by itself."""
        enabled = self._table.enabled
        if self._reached and enabled is not None and not enabled.matches(raw):
            text = f'no longer enabled, by itself ({self._reports.text})'
            self._notes.append(f'{text}; only ~/enable starts the drive again')
            self._end(False, text)

    def _watch_disabled(self, now: float) -> None:
        """Tell of a drive that runs on although its control word is ``disable``."""
        if (self._sending is not ControlAction.DISABLE or not self._sent or self._fault
                or not self._reports.running_on):
            self._forget_disregard()
            return
        self._runs_on_since = min(self._runs_on_since, now)
        # whoever asked for the stop waits for so long, ramps included
        longest = max(RUNNING_ON_MAX, self._timeout)
        if not self._disregard and now - self._runs_on_since > longest:
            self._disregard = (f'still {self.state} ({self._reports.text}) although its control '
                               f'word is disable ({self.word:04X}h): stop it by other means, or '
                               f'set a control_timeout longer than its ramp')
            self._notes.append(self._disregard)

    def _forget_disregard(self) -> None:
        """Forget that the drive ran on."""
        self._runs_on_since, self._disregard = math.inf, ''

    @property
    def _may_run(self) -> bool:
        """Whether a stop has anything to do, as far as is known."""
        return (self._sending in (ControlAction.ENABLE, ControlAction.QUICK_STOP)
                or not self._confirmed_off())

    def _confirmed(self, pattern: StatusPattern | None, wanted: bool) -> bool:
        """Tell whether the drive, knowing the current word, reports a condition (or cannot)."""
        return self._sent if pattern is None else self._reports.confirmed(pattern, wanted)

    def _confirmed_off(self) -> bool:
        """Tell whether the drive, knowing the current word, reports that it does not run."""
        return self._sent if self._table.enabled is None else self._reports.standing

    def _resettable(self) -> bool:
        """Tell whether the drive, knowing ``disable``, reports a fault that can be reset."""
        return self._sent if self._table.fault is None else self._reports.resettable

    # -- effects ----------------------------------------------------------------------------------

    def _send(self, action: ControlAction) -> None:
        """Make the word of this name the current one."""
        if self._words[action] != self.word:
            self._sent = False
            self._reports.forget_answers()
            self._forget_disregard()
        self._sending = action
        self._reached = self._reached and action is ControlAction.ENABLE

    def _end(self, success: bool, message: str) -> None:
        """Answer what is under way, if anything; only a successful ENABLE keeps its word."""
        under_way, self._operation = self._operation, None
        if under_way is not None:
            self._answer(under_way, success, message)
            if success and under_way.action is ControlAction.ENABLE:
                return
        self._send(ControlAction.DISABLE)

    def _answer(self, operation: _Operation, success: bool, message: str) -> None:
        for request in operation.requests:
            self._complete(request, success, message)
        operation.requests.clear()

    def _complete(self, request: ControlRequest, success: bool, message: str) -> None:
        self._completed.append(ControlCompleted(request, success, message))

    # -- words ------------------------------------------------------------------------------------

    def _success_text(self) -> str:
        """Name the state reached, or say that nobody knows."""
        if self._table.enabled is None:
            return f'{self._sending.value} sent; the drive does not report its state'
        return self.state

    def _overdue_text(self) -> str:
        """Say where the drive is stuck, and what usually keeps one there."""
        raw = self._reports.telling
        hint = '' if self._wording is None or raw is None else self._wording.hint(raw)
        return f'{self._stuck_text()}{hint}'

    def _stuck_text(self) -> str:
        under_way = self._operation
        if under_way is not None and under_way.pulsed and self._reports.answered:
            return f'fault still present after {self._timeout:g} s ({self._reports.text})'
        text = (f'no confirmation in {self._timeout:g} s: '
                f'stuck in state {self.state} ({self._reports.text})')
        if not self._sent:
            return f'{text}; control word {self.word:04X}h could not be sent'
        if not self._reports.answered:
            return f'{text}; no status word since control word {self.word:04X}h'
        if self._reports.says(self._table.enabled):
            return f'{text}; it does not follow control word {self.word:04X}h'
        return text
