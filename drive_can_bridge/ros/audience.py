# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Whether anybody subscribes: looked up now and then, not for every message."""

from rclpy.publisher import Publisher

#: s between two looks at who subscribes
COUNT_PERIOD = 0.1


class Audience:
    """The subscribers of one topic."""

    def __init__(self, publisher: Publisher) -> None:
        self._publisher = publisher
        self._listens = False
        self._count_at = 0.0

    def listens(self, now: float) -> bool:
        """Tell whether there are any; ``now`` is of the steady clock."""
        if now >= self._count_at:
            self._count_at = now + COUNT_PERIOD
            self._listens = bool(self._publisher.get_subscription_count())
        return self._listens
