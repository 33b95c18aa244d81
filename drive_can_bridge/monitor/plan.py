# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Whose samples to receive.

A message that nobody looks at costs its bridge and its receiver as much as any other. A few drives
are no burden; fifteen with 200 exchanges a second each are. So there is a budget: what is looked
at closely is always sampled, the others take turns.
"""

from collections.abc import Collection, Mapping, Sequence

#: messages per second
BUDGET = 1000.0
#: s of a turn: discovery, and some samples for whoever looks four times a second
TURN = 1.5


class SamplingPlan:
    """Chooses drives, anew for every turn."""

    def __init__(self, budget: float = BUDGET) -> None:
        self._budget = budget
        self._turn_ends = 0.0
        self._next = 0
        self._chosen: frozenset[str] = frozenset()

    def choose(self, rates: Mapping[str, float], focus: Collection[str], now: float,
               ) -> frozenset[str]:
        """
        Return the drives to be sampled.

        :param rates: exchanges per second of all drives; 0 while unknown, or offline.
        :param focus: drives that are looked at closely.
        """
        known = {name for name in rates if name in focus}
        if now < self._turn_ends and known <= self._chosen <= rates.keys():
            return self._chosen
        self._turn_ends = now + TURN
        chosen = set(known)
        left = self._budget - sum(rates[name] for name in known)
        names: Sequence[str] = [name for name in rates if name not in known]
        for _ in names:
            name = names[self._next % len(names)]
            # one in turn at least, or nobody ever would be
            if rates[name] > left and len(chosen) > len(known):
                break
            left -= rates[name]
            chosen.add(name)
            self._next += 1
        self._chosen = frozenset(chosen)
        return self._chosen
