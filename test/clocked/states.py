# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The states of managed nodes, as REP 2002 and rcl_lifecycle have them."""

STATES = {0: 'unknown', 1: 'unconfigured', 2: 'inactive', 3: 'active', 4: 'finalized',
          10: 'configuring', 11: 'cleaningup', 12: 'shuttingdown', 13: 'activating',
          14: 'deactivating', 15: 'errorprocessing'}

_OUTCOMES = ('transition_success', 'transition_failure', 'transition_error')


def _transition(number: int, label: str, begin: int, during: int, first: int,
                *ends: int) -> list[tuple[int, str, int, int]]:
    """Return a transition, and what it may end with: success, failure, error."""
    return [(number, label, begin, during),
            *((first + place, outcome, during, end)
              for place, (outcome, end) in enumerate(zip(_OUTCOMES, ends)))]


#: rcl_lifecycle's default_state_machine.c: number, label, from, to
TRANSITIONS = [
    *_transition(1, 'configure', 1, 10, 10, 2, 1, 15),
    *_transition(2, 'cleanup', 2, 11, 20, 1, 2, 15),
    *_transition(3, 'activate', 2, 13, 30, 3, 2, 15),
    *_transition(4, 'deactivate', 3, 14, 40, 2, 3, 15),
    *_transition(5, 'shutdown', 1, 12, 50),
    *_transition(6, 'shutdown', 2, 12, 50),
    *_transition(7, 'shutdown', 3, 12, 50, 4, 4, 15),
    (60, 'transition_success', 15, 1), (61, 'transition_failure', 15, 4),
    (62, 'transition_error', 15, 4)]
