# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The control and status words of NORD inverters, built in: no profile has to tell them.

The steps and rules of :mod:`drive_can_bridge.core.control` hold. In the terms of the inverter:

* ``disable`` is 047Eh. It also brings an inverter out of "switch-on disabled", which nothing else
  does; so ENABLE waits for "ready to switch on" and then sends 047Fh, which switches on and
  enables operation.
* A drive counts as stopped when bit 2 (output on) is clear. In "quick stop", and on the ramp that
  047Eh begins, it is still set. So the quick stop word stays until the drive stands.
* A fault is acknowledged by the rising edge of bit 7, once. In "fault reaction" the drive still
  stops; the edge would be lost, and waits for "fault".

A broadcast group has one control word for several inverters (:class:`GroupControl`): a condition
holds when it holds for all of them, and a fault of one is a fault of the group.
"""

from collections.abc import Callable
from dataclasses import dataclass

from drive_can_bridge.core.control import ControlAction, ControlMachine, ControlTicket
from drive_can_bridge.core.profile import ControlTable, StatusPattern
from drive_can_bridge.protocols.cannord.states import (
    ACKNOWLEDGE, is_faulted, parameter_set_bits, QUICK_STOP, READY, RUN, State, state_of,
    STATUS_WORD,
)

OUTPUT_ON = 0x0004
_VOLTAGE_ENABLED = 0x0010
_NO_QUICK_STOP = 0x0020
_BUS_CONTROL = 0x0200


def control_table(parameter_set: int) -> ControlTable:
    """Return words and conditions in the form in which profiles give them."""
    chosen = parameter_set_bits(parameter_set)
    return ControlTable(
        parameter='', disable=READY | chosen, enable=RUN | chosen,
        quick_stop=QUICK_STOP | chosen, reset_fault=ACKNOWLEDGE | chosen,
        status_parameter=STATUS_WORD,
        ready=StatusPattern(0x007F, 0x0031), enabled=StatusPattern(0x007F, 0x0037),
        fault=StatusPattern(0x0008, 0x0008))


class CannordControl(ControlMachine):
    """
    The machine for one inverter.

    :param parameter_set: 1 to 4, bits 14 and 15 of every control word.
    :param timeout: seconds until an unconfirmed request fails.
    """

    def __init__(self, *, parameter_set: int, timeout: float) -> None:
        super().__init__(control_table(parameter_set), timeout=timeout)

    @property
    def state(self) -> str:
        """State of the inverter by its name in the manual, or ``unknown`` without a status."""
        return 'unknown' if self._raw is None else state_of(self._raw).value

    def _confirmed_off(self) -> bool:
        return self._answer is not None and not self._answer & OUTPUT_ON

    def _confirmed_resettable(self) -> bool:
        return (super()._confirmed_resettable() and self._answer is not None
                and state_of(self._answer) is not State.FAULT_REACTION)

    def _overdue_text(self) -> str:
        return f'{super()._overdue_text()}{self._hint()}'

    def _hint(self) -> str:
        """Say what usually keeps an inverter in this state; '' where nothing is known."""
        return '' if self._raw is None else hint(self._raw)


def hint(status: int) -> str:
    """Say what a status word tells about why an inverter does not go on; '' for nothing."""
    if is_faulted(status):
        return ''
    if not status & _VOLTAGE_ENABLED:
        return '; voltage is disabled: look at the digital inputs with that function'
    if not status & _NO_QUICK_STOP:
        return '; a quick stop is active: look at the digital inputs with that function'
    if not status & _BUS_CONTROL:
        return '; the bus is not in control: look at P509 and P510'
    return ''


@dataclass
class _MemberStatus:
    """What is known of one inverter of a group."""

    raw: int | None = None      # the last status word
    answer: int | None = None   # the last one since the current control word left


class GroupControl(CannordControl):
    """
    The machine for the inverters of a broadcast group.

    Tell it who is there (:meth:`member_found`, :meth:`member_lost`) and what each one reports
    (:meth:`member_status`) instead of calling ``status_received``.

    :param members: names, the leader's first.
    """

    def __init__(self, members: list[str], *, parameter_set: int, timeout: float) -> None:
        super().__init__(parameter_set=parameter_set, timeout=timeout)
        self._members = members
        self._present: dict[str, _MemberStatus] = {}

    def member_found(self, name: str) -> None:
        """Take note that an inverter of the group is online."""
        self._present[name] = _MemberStatus()

    def member_lost(self, name: str) -> None:
        """Take note that an inverter is offline. The others do not run without it."""
        if self._present.pop(name, None) is None:
            return
        self._fault = None if self._fault is None else self._any_fault()
        self._raw = self._telling()
        if self._reached or (self._operation is not None
                             and self._operation.action is ControlAction.ENABLE):
            text = f'{name} offline'
            if self._reached:
                self._notes.append(f'enable withdrawn: {text}; only ~/enable starts the group '
                                   'again')
            self._end(False, text)
        self._advance()

    def member_status(self, name: str, raw: int, now: float) -> None:
        """Take the status word of an inverter."""
        status = self._present.get(name)
        if status is None:
            return
        self.handle_timer(now)
        status.raw = raw
        if self._sent:
            status.answer = self._answer = raw
        self._raw = self._telling()
        self._watch_fault(raw)
        self._watch_enabled(raw)
        self._advance()
        self._watch_disabled(now)

    def request(self, action: ControlAction, now: float) -> ControlTicket:
        if action is ControlAction.ENABLE:
            missing = [name for name in self._members if name not in self._present]
            if missing:
                ticket = ControlTicket(action)
                self._complete(ticket, False, f'{", ".join(missing)} offline')
                return ticket
        return super().request(action, now)

    def withdraw(self, reason: str, now: float) -> None:
        super().withdraw(reason, now)
        for status in self._present.values():
            status.raw = status.answer = None

    @property
    def state(self) -> str:
        """The common state, or the states of all of them by name."""
        states = {name: 'unknown' if status.raw is None else state_of(status.raw).value
                  for name, status in self._present.items()}
        if len(set(states.values())) == 1:
            return next(iter(states.values()))
        return ', '.join(f'{name}: {state}' for name, state in states.items()) or 'unknown'

    # -- conditions over all of them --------------------------------------------------------------

    def _any_fault(self) -> bool:
        return any(status.raw is not None and is_faulted(status.raw)
                   for status in self._present.values())

    def _telling(self) -> int | None:
        """Return the status word that says most: of a fault, else of whoever lags behind."""
        raws = [status.raw for status in self._present.values() if status.raw is not None]
        for mask, value in ((0x0008, 0x0008), (0x0004, 0x0000)):
            for raw in raws:
                if raw & mask == value:
                    return raw
        return raws[0] if raws else None

    def _watch_fault(self, raw: int) -> None:
        # the group is rid of a fault when its last inverter is
        if is_faulted(raw) or not self._any_fault():
            super()._watch_fault(raw)

    def _all(self, condition: Callable[[int], bool]) -> bool:
        """Tell whether all that are there, knowing the current word, fulfil a condition."""
        return bool(self._present) and all(
            status.answer is not None and condition(status.answer)
            for status in self._present.values())

    def _confirmed(self, pattern: StatusPattern | None, wanted: bool) -> bool:
        if pattern is None:
            return super()._confirmed(pattern, wanted)
        if pattern is self._table.fault and wanted:
            # one is enough, but all must have seen the word: the edge comes for all of them
            return self._all(lambda _: True) and any(
                is_faulted(status.answer or 0) for status in self._present.values())
        return self._all(lambda answer: pattern.matches(answer) is wanted)

    def _confirmed_off(self) -> bool:
        return self._all(lambda answer: not answer & OUTPUT_ON)

    def _still_on(self) -> bool:
        # they answer in turn: who has not answered yet says nothing
        return any(status.answer is not None and status.answer & OUTPUT_ON
                   for status in self._present.values())

    def _confirmed_resettable(self) -> bool:
        return (self._confirmed(self._table.fault, True)
                and self._all(lambda answer: state_of(answer) is not State.FAULT_REACTION))

    # -- effects ----------------------------------------------------------------------------------

    def _send(self, action: ControlAction) -> None:
        changes = self._words[action] != self.word
        super()._send(action)
        if changes:
            for status in self._present.values():
                status.answer = None

    @property
    def _status_text(self) -> str:
        words = [f'{name} {"unknown" if status.raw is None else f"{status.raw:04X}h"}'
                 for name, status in self._present.items()]
        return f'status words: {", ".join(words)}' if words else 'no status word'
