# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The rule book of stops: what a drive was commanded, and whether a stop is pending.

*Whatever was commanded to run is commanded to stop.* May a drive be running by command, and was
it commanded to stop? Cycles command it, and separately an acyclic control word, and
acyclic setpoints. Each of these *channels* has a :class:`Debt`. Sessions report what has
:class:`Happened`; the table :data:`ROWS` has the debt from then on, and what the session
has to :class:`Do`. That is decided, and a debt changed, nowhere else. What is not in the
table changes nothing.

.. code-block:: text

                  a frame that      a stop             an answer
                  may run it left   left               to that
       NONE ───────────────► RUNS ──────────► STOP_SENT ──────────► NONE
                              │ silent            │ silent           ▲
                              ▼                   ▼                  │ an answer, or a stop
                       RUNS_UNHEARD ─────────► UNHEARD ──────────────┘ that was confirmed
                                    a stop left

``OWED`` is the only debt of a drive that acknowledges its commands, until it has acknowledged
what stops it.

``test/rule_checker.py`` runs all sequences of events against a motor that obeys whatever
arrives, and is red when a single row is changed.
"""

from collections.abc import Collection, Hashable
from enum import Enum, IntEnum
from typing import NamedTuple

#: the channel of cycles
CYCLE = 'cycle'
#: the control word, where it travels by itself
CONTROL_WORD = 'control word'


class Debt(Enum):
    """The pending stop of one channel that commands the drive separately."""

    __hash__ = object.__hash__      # in C: looked up with every frame

    NONE = 'nothing'
    OWED = 'told to run by a write that is acknowledged, as what stops it will be'
    RUNS = 'told to run, by something that nobody acknowledges'
    RUNS_UNHEARD = 'told to run, and silent since'
    STOP_SENT = 'told to stop, and nothing has shown that it arrived'
    UNHEARD = 'told to stop, and silent since'


class Happened(Enum):
    """What happened: to one channel, or (from ``STOPPED`` on) to the drive."""

    __hash__ = object.__hash__

    RUN_WRITTEN = 'a write that may run it goes out, and will be acknowledged'
    RUN_LEFT = 'a frame has left that holds anything but neutral and disable'
    STOP_LEFT = 'neutral, or disable, has left; where writes are acknowledged: was'
    MISROUTED = 'cycles up to now may have reached other parameters than they were meant for'
    STOPPED = 'it has confirmed to have nothing but neutral and disable'
    ANSWERED = 'it has answered what it was told last'
    SILENT = 'it does not answer, or no answer can come'
    LOST = 'it was online, and has not answered often enough'
    UNANSWERED = 'its cycles since it was lost were not answered, either'
    MAPS_DIFFER = 'its maps are not those that its cycles are made for'
    STARTED = 'the conversation restarts: start, bus back, stall, restart'
    SHOWED_UP = 'an offline drive gives a sign of life'
    ENDS = 'the activation ends'
    LEFT_ALONE = 'nothing more will be sent: the end, or a lost bus'
    SAID = 'the activation has ended, and a stop that failed in it was told'
    ACTIVATED = 'an activation begins'


class Do(IntEnum):
    """What a session has to do; the last of them where channels differ."""

    NOTHING = 0
    #: by cycles where the request map is known to agree, else by number; a stop by number that is
    #: not confirmed is reported
    STOP = 1
    #: not by cycles: they do not reach it; families without acyclic writes warn at once that it
    #: may still be running
    STOP_BY_NUMBER = 2
    #: warn that it may still be running
    WARN = 3


class DutyRow(NamedTuple):
    """
    One rule.

    :ivar debts: it holds for these.
    :ivar becomes: the debt from then on; None: it stays.
    :ivar carries: the rule of the contract behind it.
    """

    debts: tuple[Debt, ...]
    happened: Happened
    becomes: Debt | None
    do: Do
    carries: str


class Rule(NamedTuple):
    """What follows when an event meets a pending stop: the new debt, and what has to be done."""

    becomes: Debt
    do: Do


_NONE, _OWED, _RUNS = Debt.NONE, Debt.OWED, Debt.RUNS
_RUNS_UNHEARD, _STOP_SENT, _UNHEARD = Debt.RUNS_UNHEARD, Debt.STOP_SENT, Debt.UNHEARD
#: commanded to run, and not to stop since, as far as is known
OWING = (_OWED, _RUNS, _RUNS_UNHEARD, _UNHEARD)
#: commanded to run, and not to stop since, for certain
RUNNING = (_OWED, _RUNS, _RUNS_UNHEARD)
#: what stopped it has not been shown to have arrived
UNSHOWN = (_RUNS, _RUNS_UNHEARD, _STOP_SENT, _UNHEARD)
#: what concerns the command that was sent last
OF_THE_LAST: Collection[Happened] = (Happened.ANSWERED, Happened.UNANSWERED)
_ANY = (_OWED, _RUNS, _RUNS_UNHEARD, _STOP_SENT, _UNHEARD)

_WHATEVER = 'Whatever was told to run is told to stop'
_ACKNOWLEDGED = ('Stop writes are read back or acknowledged: no answer, or another value, is a '
                 'warning that names the drive and says that it may still be running')
_SHOWN = 'A drive gets up to three neutral cycles more until one is answered'
_SILENT = ('A drive that falls silent together with its stop is named as one that may still be '
           'running')
_ROUTE = ('The cyclic frame where the request map is known to agree, else acyclic writes by '
          'parameter number, which no map can misroute')
_BEGUN = ('It is told so while its maps are read again, after a bus came back, after a stall, '
          'while its rounds are held back')
_END = ('At deactivation, signals or a fatal error the bridge sends neutral setpoints and the '
        'disable word')
_NAMED = ('It is named as one that may still be running, too, when the bridge ends while the bus '
          'is lost or takes nothing')
_THIS = 'A drive that this activation has told anything but neutral and disable'

ROWS: tuple[DutyRow, ...] = (
    # what leaves
    DutyRow((_NONE,), Happened.RUN_WRITTEN, _OWED, Do.NOTHING, _ACKNOWLEDGED),
    DutyRow((_NONE,), Happened.RUN_LEFT, _RUNS, Do.NOTHING, _THIS),
    DutyRow((_STOP_SENT,), Happened.RUN_LEFT, _RUNS, Do.NOTHING, _THIS),
    DutyRow((_UNHEARD,), Happened.RUN_LEFT, _RUNS_UNHEARD, Do.NOTHING, _THIS),
    DutyRow((_OWED,), Happened.STOP_LEFT, _NONE, Do.NOTHING, _ACKNOWLEDGED),
    DutyRow((_RUNS,), Happened.STOP_LEFT, _STOP_SENT, Do.NOTHING, _SHOWN),
    DutyRow((_RUNS_UNHEARD,), Happened.STOP_LEFT, _UNHEARD, Do.NOTHING, _SILENT),
    # what comes back
    DutyRow(_ANY, Happened.STOPPED, _NONE, Do.NOTHING, _ACKNOWLEDGED),
    DutyRow((_STOP_SENT,), Happened.ANSWERED, _NONE, Do.NOTHING, _SHOWN),
    DutyRow((_UNHEARD,), Happened.ANSWERED, _NONE, Do.NOTHING, _SHOWN),
    # what does not
    DutyRow((_RUNS,), Happened.SILENT, _RUNS_UNHEARD, Do.NOTHING, _SILENT),
    DutyRow((_STOP_SENT,), Happened.SILENT, _UNHEARD, Do.NOTHING, _SILENT),
    DutyRow(_ANY, Happened.LOST, None, Do.STOP, _WHATEVER),
    DutyRow(OWING, Happened.UNANSWERED, None, Do.STOP, _WHATEVER),  # neutral cycles go on
    DutyRow((_STOP_SENT,), Happened.UNANSWERED, _UNHEARD, Do.STOP_BY_NUMBER, _SILENT),
    # stopped before the session turns to something else
    DutyRow((_STOP_SENT,), Happened.MISROUTED, _RUNS, Do.NOTHING, _ROUTE),
    DutyRow((_RUNS, _STOP_SENT), Happened.MAPS_DIFFER, None, Do.STOP, _ROUTE),
    DutyRow((_RUNS_UNHEARD, _UNHEARD), Happened.MAPS_DIFFER, None, Do.STOP_BY_NUMBER, _ROUTE),
    DutyRow(OWING, Happened.STARTED, None, Do.STOP, _BEGUN),
    DutyRow((_OWED, _RUNS_UNHEARD, _UNHEARD), Happened.SHOWED_UP, None, Do.STOP_BY_NUMBER,
            _WHATEVER),
    DutyRow((_RUNS,), Happened.SHOWED_UP, _RUNS_UNHEARD, Do.STOP_BY_NUMBER, _WHATEVER),
    DutyRow((_STOP_SENT,), Happened.SHOWED_UP, _UNHEARD, Do.STOP_BY_NUMBER, _WHATEVER),
    DutyRow(OWING, Happened.ENDS, None, Do.STOP, _END),
    DutyRow(OWING, Happened.LEFT_ALONE, None, Do.WARN, _NAMED),
    # what is over
    DutyRow(_ANY, Happened.SAID, _NONE, Do.NOTHING, _NAMED),
    DutyRow(_ANY, Happened.ACTIVATED, _NONE, Do.NOTHING, _THIS),
)

RULES: dict[tuple[Debt, Happened], Rule] = {
    (debt, row.happened): Rule(row.becomes or debt, row.do) for row in ROWS for debt in row.debts}


class StopDuty:
    """
    The pending stops of one drive, channel by channel: the only place where they are kept.

    :ivar stop_pending: it was commanded to run by at least one channel, and to stop since only in
        vain.
    :ivar unacknowledged: a channel without acknowledgements commanded it to run, and nothing shows
        that its stop has arrived.
    """

    __slots__ = ('_debts', '_rules', 'stop_pending', 'unacknowledged')

    def __init__(self, rules: dict[tuple[Debt, Happened], Rule] = RULES) -> None:
        self._rules = rules
        self._debts: dict[Hashable, Debt] = {}      # channels with a pending stop
        self.stop_pending = self.unacknowledged = False

    @property
    def may_run(self) -> bool:
        """Whether nothing has shown that the drive does not run by command."""
        return bool(self._debts)

    def runs(self, channel: Hashable) -> bool:
        """Return whether a channel has commanded it to run, and not to stop since."""
        return self._debts.get(channel) in RUNNING

    def channel(self, channel: Hashable, happened: Happened) -> Do:
        """Record what happened to one channel; return what has to be done."""
        debt = self._debts.get(channel, _NONE)
        rule = self._rules.get((debt, happened))
        if rule is None:
            return Do.NOTHING
        if rule.becomes is not debt:
            self._change(channel, rule.becomes)
            self._look()
        return rule.do

    def happened(self, happened: Happened) -> Do:
        """Record what happened to the drive; return what has to be done."""
        do, debts, changed = Do.NOTHING, self._debts, False
        if not debts:
            return do
        # while another channel commands it to run, neither an answer nor silence is about the stop
        blind = happened in OF_THE_LAST and any(debt in RUNNING for debt in debts.values())
        for channel, debt in list(debts.items()):
            rule = self._rules.get((debt, happened))
            if rule is not None and not (blind and rule.becomes is not debt):
                if rule.becomes is not debt:
                    self._change(channel, rule.becomes)
                    changed = True
                do = max(do, rule.do)
        if changed:
            self._look()
        return do

    def _change(self, channel: Hashable, debt: Debt) -> None:
        if debt is _NONE:
            del self._debts[channel]
        else:
            self._debts[channel] = debt

    def _look(self) -> None:
        debts = self._debts.values()
        self.stop_pending = any(debt in OWING for debt in debts)
        self.unacknowledged = any(debt in UNSHOWN for debt in debts)
