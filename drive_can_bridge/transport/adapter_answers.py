# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What an SLCAN adapter says to the frames that it was handed.

It refuses one by a BEL, when its queue is full or it is off the bus; that comes later than the
frame was written. Some adapters confirm what they take by CR, ``z`` CR or ``Z`` CR, others do not.
"""

import math

REFUSED = '\a'
#: frames refused in a row, and s that this has to last, until nothing leaves any more
REFUSED_MAX = 4
REFUSED_TIME = 0.05


class AdapterAnswers:
    """
    The answers of one adapter since it was opened.

    :ivar refused: frames that it did not take.
    """

    __slots__ = ('_in_row', '_since', '_unanswered', 'refused')

    def __init__(self) -> None:
        self.refused = 0
        self._unanswered = 0    # frames that a BEL may be about: it also refuses other commands
        self._in_row = 0
        self._since = math.inf

    def sent(self) -> None:
        """Record a frame that was written."""
        self._unanswered += 1

    def take(self, line: str, now: float) -> None:
        """Take a line of the adapter, with its end."""
        if not line.endswith(REFUSED):
            self._in_row = 0    # it took one, or hears somebody
        elif self._unanswered:
            self._unanswered -= 1
            self.refused += 1
            self._since = self._since if self._in_row else now
            self._in_row += 1

    def takes_nothing(self, now: float) -> bool:
        """Tell whether it refuses whatever it is handed."""
        return self._in_row >= REFUSED_MAX and now - self._since >= REFUSED_TIME
