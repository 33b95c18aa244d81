# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What shows that a bridge lives although it does not answer.

On a busy computer that takes a while: the request waits for a thread of the bridge, or the
answer for one of ours. A bridge that publishes diagnostics, or whose process on this host uses
processor time, is waited for; one that is suspended or gone does neither.
"""

from collections.abc import Callable, Iterable
from typing import Any

from rclpy.qos import QoSProfile

from drive_can_bridge.process.presence import bridges, Present, short
from drive_can_bridge.ros.client.client_node import HasEnd
from drive_can_bridge.ros.client.subscriptions import Inbox

#: s for which a sign counts
RECENT = 3.0
#: s between two looks at a process: it uses tens of ms of processor time meanwhile
LOOK_PERIOD = 0.5
_DIAGNOSTICS_DEPTH = 50


def processor_time(process: int) -> int | None:
    """Return the processor time of a process, in ticks; None: there is no such process."""
    try:
        with open(f'/proc/{process}/stat', encoding='utf-8', errors='replace') as file:
            words = file.read().rpartition(')')[2].split()
        return int(words[11]) + int(words[12])
    except (OSError, ValueError, IndexError):
        return None


class Signs:
    """
    Looks for signs of life, from the moment that it is made.

    :param client_node: of ours.
    :param present: returns the bridges of this host.
    :param taken: returns the processor time of a process; None: there is no such process.
    """

    def __init__(self, client_node: HasEnd,
                 present: Callable[[], Iterable[Present]] = bridges,
                 taken: Callable[[int], int | None] = processor_time) -> None:
        from diagnostic_msgs.msg import DiagnosticArray
        self._present, self._taken = present, taken
        self._said: dict[str, float] = {}       # by the beginning of the names of its statuses
        self._used: dict[str, tuple[int | None, float]] = {}    # by name: ticks, and since when
        self._looked_at = -LOOK_PERIOD
        self._now = 0.0
        self._began: float | None = None
        self._inbox = Inbox(client_node, DiagnosticArray, '/diagnostics',
                            QoSProfile(depth=_DIAGNOSTICS_DEPTH), self._take)

    def look(self, now: float) -> None:
        """Handle what has arrived, and check the processes of this host."""
        self._now = now
        if self._began is None:
            self._began = now
        self._inbox.look()
        if now < self._looked_at + LOOK_PERIOD:
            return
        self._looked_at = now
        for each in self._present():
            ticks = self._taken(each.process)
            known = self._used.get(each.name)
            if known is None:
                self._used[each.name] = ticks, -RECENT
            elif ticks is not None and ticks != known[0]:
                self._used[each.name] = ticks, now

    def lives(self, bridge: str) -> bool:
        """
        Return whether a bridge gave a sign just now, or there was no time yet for one.

        On a busy computer this process is stalled as well: between its first look and the one
        before there may be all the time that a bridge has to answer.
        """
        since = self._now - RECENT
        if self._began is None or self._began > since:
            return True
        return (self._said.get(bridge.lstrip('/'), since) > since
                or self._used.get(short(bridge), (None, since))[1] > since)

    def close(self) -> None:
        """Unsubscribe."""
        self._inbox.close()

    def _take(self, message: Any) -> None:
        for status in message.status:
            self._said[status.name.partition(':')[0]] = self._now
