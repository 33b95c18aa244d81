# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The lifecycle of a drive as a script: what is done with it, one thing after the other.

A family writes it down as one generator. It yields a procedure of the acyclic channel, and is sent
what that returned; or the time until which it waits, and is sent the time when it goes on. What
has to be fast (cycles, answers, the control word) goes on beside it.

Found, lost, bus back, a stall: whatever makes the conversation restart *starts* a script,
which ends the one before where it stands. So a position in the sequence is a line of the
generator, and never a flag.
"""

from collections.abc import Generator
from functools import partial
import math
from typing import Any

from drive_can_bridge.protocols.channel import Channel

#: yields procedures of the channel, and times in s
Script = Generator[Any, Any, None]


class Lifecycle:
    """
    Runs one script: a part of the session.

    What a script has asked for goes on to its end in the channel when another one is started, but
    tells nobody; what the new one asks for follows then.

    :ivar due: until when it waits; infinity: for something else.
    """

    def __init__(self, channel: Channel[Any, Any]) -> None:
        self._channel = channel
        self._script: Script | None = None
        self.due = math.inf
        self._asking = False    # a procedure is in the channel, of this script or one before
        self._next: Generator[Any, Any, Any] | None = None      # of this one, waits for that

    def start(self, script: Script, now: float) -> None:
        """Begin, instead of what there was."""
        self._script, self.due, self._next = script, math.inf, None
        self._go_on(script, None, now)

    def end(self) -> None:
        """End it where it stands, without the results that it waits for."""
        self._script, self.due, self._next = None, math.inf, None

    def stop(self) -> None:
        """End it where it stands. The channel was cleared."""
        self.end()
        self._asking = False

    def handle_timer(self, now: float) -> None:
        """Go on, if it has waited for this time."""
        if now >= self.due and self._script is not None:
            self.due = math.inf
            self._go_on(self._script, now, now)

    def _go_on(self, script: Script, found: Any, now: float) -> None:
        try:
            wanted = script.send(found)
        except StopIteration:
            return
        if script is not self._script:      # what it did has begun or ended one
            return
        if isinstance(wanted, (int, float)):
            self.due = wanted
        else:
            self._next = wanted
            self._ask(now)

    def _ask(self, now: float) -> None:
        procedure, script = self._next, self._script
        if procedure is not None and script is not None and not self._asking:
            self._next, self._asking = None, True
            self._channel.run(procedure, partial(self._take, script), now)

    def _take(self, script: Script, found: Any) -> None:
        self._asking, now = False, self._channel.now
        if script is self._script:
            self._go_on(script, found, now)
        else:
            self._ask(now)
