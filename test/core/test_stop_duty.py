# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The rule book of stops: lived through, and changed row by row, which has to be seen."""

from extent import some
import pytest
from rule_checker import changed, check, KINDS, Violation

from drive_can_bridge.core import stop_duty
from drive_can_bridge.core.stop_duty import Debt, Do, Happened, ROWS, Rule, RULES


@pytest.mark.parametrize('kind', KINDS)
def test_rules_hold_in_every_order(kind: str) -> None:
    assert check(kinds=(kind,)) > 250


def test_longer_sequences_bring_nothing_new() -> None:
    """What is said of all sequences of six moves holds for longer ones."""
    assert check(depth=9) > check()


def test_any_changed_rule_is_seen() -> None:
    """Each rule, missing, with another debt, or with something else to be done."""
    everything = [*changed()]
    assert len(everything) == len(RULES) * (len(Debt) + len(Do) - 1)
    for name, table in some(everything, 3):
        try:
            check(table)
        except Violation:
            continue
        pytest.fail(f'not seen: {name}')


def test_what_tells_of_the_last_word_shows_nothing_of_one_before(
        monkeypatch: pytest.MonkeyPatch) -> None:
    """An answer to what runs it, or silence, says nothing of a channel that was stopped."""
    monkeypatch.setattr(stop_duty, 'OF_THE_LAST', ())
    with pytest.raises(Violation):
        check()


def test_shortest_story_is_told() -> None:
    table = dict(RULES)
    table[Debt.STOP_SENT, Happened.SILENT] = Rule(Debt.NONE, Do.NOTHING)
    with pytest.raises(Violation, match=(
            r"cycles alone: .*, after \[\('run.*', 'cycle'\), \('stop.*', 'cycle'\), "
            r"\('silent', ''\)\]")):
        check(table)


def test_each_rule_stands_once() -> None:
    assert len(RULES) == sum(len(row.debts) for row in ROWS)
    for row in ROWS:
        assert row.carries and row.becomes not in row.debts, row
        assert row.becomes is not None or row.do is not Do.NOTHING, row
