# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a drive was told last, whatever its frames look like."""

from collections.abc import Sequence

from drive_can_bridge.core.parameters import Parameter


class LastSent:
    """
    Setpoints and control word as they stood in the frames that carried them last.

    :ivar parameters: all that a drive can be told, in the order of its frames.
    :ivar raws: the raw integer of each; None: not sent since activation. Another tuple after each
        change, and the same one as long as nothing changes.
    :ivar times: how often frames with new contents have carried each, for those who wait for one.
    """

    __slots__ = ('_widths', 'parameters', 'raws', 'times')

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        self.parameters = tuple(parameters)
        #: of each: its bits, and the one of them that is the sign, as masks
        self._widths = [((1 << parameter.type.bits) - 1,
                         1 << parameter.type.bits - 1 if parameter.type.signed else 0)
                        for parameter in self.parameters]
        self.raws: tuple[int | None, ...] = ()
        self.times = [0] * len(self.parameters)
        self.clear()

    def clear(self) -> None:
        """Record that nothing was sent yet."""
        self.raws = (None,) * len(self.parameters)

    def take(self, words: Sequence[int], first: int = 0) -> None:
        """
        Record what a frame carries.

        :param words: raw integers, or the words on the wire.
        :param first: place of the first of them in ``parameters``.
        """
        widths = self._widths[first:] if first else self._widths
        fresh: tuple[int | None, ...] = tuple([
            ((word & mask) ^ sign) - sign for word, (mask, sign) in zip(words, widths)])
        known = self.raws
        if len(fresh) < len(known):
            fresh = known[:first] + fresh + known[first + len(fresh):]
        times = self.times
        for place in range(first, first + min(len(words), len(widths))):
            times[place] += 1
        if fresh != known:
            self.raws = fresh
