# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a node says of itself, for the log: told at once, but never in a flood."""

from collections.abc import Callable
import math

from drive_can_bridge.core.events import Noted

#: s between two notes of a kind at least
NOTE_SPACING = 1.0


class PacedNotes:
    """
    Passes on the first note of each kind, then at most one a second.

    What was held back is counted and told with the newest of its kind: nothing is lost silently.

    :param emit: takes the notes.
    """

    def __init__(self, emit: Callable[[Noted], None]) -> None:
        self._emit = emit
        self._quiet_until: dict[str, float] = {}
        self._held: dict[str, tuple[Noted, int]] = {}   # in the order in which they came last

    def note(self, kind: str, text: str, now: float, *, warning: bool = False) -> None:
        """Tell something, now or later."""
        note = Noted(text, warning=warning)
        if now < self._quiet_until.get(kind, -math.inf):
            _, count = self._held.pop(kind, (None, 0))
            self._held[kind] = note, count + 1
            return
        held = self._held.pop(kind, None)
        self._tell(kind, note, held[1] if held else 0, now)

    def handle_timer(self, now: float) -> None:
        """Tell what was held back for long enough."""
        for kind in [kind for kind in self._held if now >= self._quiet_until[kind]]:
            note, count = self._held.pop(kind)
            self._tell(kind, note, count, now)

    def next_timer(self) -> float:
        """Return when ``handle_timer`` has something to do; infinity: never."""
        return min((self._quiet_until[kind] for kind in self._held), default=math.inf)

    def flush(self, now: float) -> None:
        """Tell everything that was held back: nobody will call any more."""
        self._quiet_until = dict.fromkeys(self._quiet_until, now)
        self.handle_timer(now)

    def _tell(self, kind: str, note: Noted, count: int, now: float) -> None:
        self._quiet_until[kind] = now + NOTE_SPACING
        more = f' ({count} more)' if count else ''
        self._emit(Noted(f'{note.text}{more}', warning=note.warning))
