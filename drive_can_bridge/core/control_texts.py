# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is said of a drive with a control word: its state, and why it does not follow."""

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.profile import ControlTable
from drive_can_bridge.core.sentences import NOTHING, Sentence
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
               acknowledged: bool, more: Sentence = NOTHING) -> Sentence:
    """
    Say that nothing was confirmed in time, and as much as is known of the reason.

    :param sending: what the current control word is for.
    :param pulsed: the pulse that resets a fault has left.
    :param acknowledged: ``sent`` says that the drive has acknowledged the word.
    :param more: what the family knows.
    """
    if pulsed and reports.answered:
        return sentences.fault_present(timeout, reports.text)
    remarks: list[Sentence] = []
    if not sent:
        remarks.append(sentences.word_not_acknowledged(word) if acknowledged else
                       sentences.word_not_sent(word))
    elif not reports.answered:
        remarks.append(sentences.no_status_since(word))
    elif reports.says(table.enabled):
        remarks.append(sentences.word_not_followed(word))
    if sending is ControlAction.QUICK_STOP:     # which is what keeps it there
        remarks.append(sentences.word_stays() if reports.says(table.braking) else
                       sentences.now_disable())
    elif wording is not None and reports.telling is not None:
        hint = wording.hint(reports.telling)
        remarks += [hint] if hint else []
    return sentences.stuck(timeout, state, reports.text, [*remarks, more] if more else remarks)


def success_text(table: ControlTable, sending: ControlAction, state: str) -> Sentence:
    """Name the state reached, or say that nobody knows."""
    return (sentences.state_not_reported(sending.value) if table.enabled is None else
            sentences.state_reached(state))


def disregard_text(reports: StatusReports, state: str, sending: ControlAction,
                   word: int) -> Sentence:
    """Say that a drive runs on although it shall not, and what to do."""
    return sentences.disregards(state, reports.text, sending.value, word)
