# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is said of a drive with a control word: its state, and why it does not follow."""

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.profile import ControlTable
from drive_can_bridge.core.status_reports import StatusReports, Wording


def state_text(reports: StatusReports, table: ControlTable, wording: Wording | None,
               sending: ControlAction, sent: bool) -> str:
    """
    Return the state of a drive in words.

    ``fault``, ``enabled``, ``ready``, ``not ready``, ``disabled`` (where the profile has no
    condition for ready), ``enable sent`` and the like (where the drive does not report), or
    ``unknown``.

    :param sending: what the current control word is for.
    :param sent: it has left.
    """
    if wording is not None:
        return reports.states(wording.state)
    says = reports.says
    if any((table.ready, table.enabled, table.fault)) and reports.telling is None:
        return 'unknown'
    if says(table.fault):
        return 'fault'
    if says(table.enabled):
        return 'enabled'
    if table.ready is not None and (
            table.enabled is not None or sending is ControlAction.DISABLE):
        return 'ready' if says(table.ready) else 'not ready'
    if table.enabled is not None:
        return 'disabled'
    return f'{sending.value} sent' if sent else 'unknown'


def stuck_text(reports: StatusReports, table: ControlTable, wording: Wording | None, state: str,
               timeout: float, sending: ControlAction, word: int, *, sent: bool, pulsed: bool,
               acknowledged: bool) -> str:
    """
    Say that nothing was confirmed in time, and as much as is known of the reason.

    :param sending: what the current control word is for.
    :param pulsed: the pulse that resets a fault has left.
    :param acknowledged: ``sent`` says that the drive has acknowledged the word.
    """
    if pulsed and reports.answered:
        return f'fault still present after {timeout:g} s ({reports.text})'
    text = f'no confirmation in {timeout:g} s: stuck in state {state} ({reports.text})'
    name = f'control word {word:04X}h'
    if not sent:
        text += f'; {name} ' + ('was not acknowledged' if acknowledged else 'could not be sent')
    elif not reports.answered:
        text += f'; no status word since {name}'
    elif reports.says(table.enabled):
        text += f'; it does not follow {name}'
    if sending is ControlAction.QUICK_STOP:     # which is what keeps it there
        return text + ('; the word stays' if reports.says(table.braking) else '; now disable')
    return text if wording is None or reports.telling is None else (
        text + wording.hint(reports.telling))


#: how a refusal begins where a profile has no quick stop; others tell it by this
NO_QUICK_STOP = 'no quick stop: '


def no_word_text(action: ControlAction) -> str:
    """Say that a profile lacks the word for an action, and what there is instead."""
    if action is ControlAction.QUICK_STOP:
        return (f'{NO_QUICK_STOP}the profile has no quick_stop word; '
                '~/enable false disables the drive')
    return 'no fault reset: the profile has no reset_fault word'


def success_text(table: ControlTable, sending: ControlAction, state: str) -> str:
    """Name the state reached, or say that nobody knows."""
    if table.enabled is None:
        return f'{sending.value} sent; the drive does not report its state'
    return state


def disregard_text(reports: StatusReports, state: str, sending: ControlAction,
                   word: int) -> str:
    """Say that a drive runs on although it shall not, and what to do."""
    return (f'still {state} ({reports.text}) although its control word is {sending.value} '
            f'({word:04X}h): stop it by other means, or set a control_timeout longer than its '
            f'ramp')
