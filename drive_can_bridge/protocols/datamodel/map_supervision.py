# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Watch over the two maps of a drive: read them, compare them, rewrite them where that is wanted.

The maps are read before the first cyclic frame, once a second from then on, and afresh whenever
the session starts over. What a look finds is told to the session, which decides whether to cycle.

With ``mapping: configure`` a difference is followed by a rewrite, and the rewrite by another look:
nothing is believed that was not read. Map entries are kept in EEPROM, whose cells wear. So the
pause before the next rewrite doubles from one to the next, whether it failed or was undone by
somebody else, until the maps have been right for a minute.
"""

from collections.abc import Callable
from enum import Enum
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import Event, MappingDiffered, MappingWritten
from drive_can_bridge.core.sentences import NOTHING, Sentence
from drive_can_bridge.protocols.datamodel import procedures
from drive_can_bridge.protocols.datamodel.channel import AcyclicChannel
from drive_can_bridge.protocols.datamodel.mapping import differences, effective

#: s between two looks at the maps
MAPPING_PERIOD = 1.0
#: longest pause between map rewrites
REWRITE_PAUSE_MAX = 60.0
#: so many looks at the maps in a row may go unanswered until that is told
SILENT_LOOKS = 3


class Verdict(Enum):
    """What a look at the maps found."""

    AGREE = 'agree'
    DIFFER = 'differ'
    SILENT = 'no answer'


class MapSupervision:
    """
    Looks at the maps of one drive.

    :param emit: takes events for the user.
    :param judged: takes each verdict, with the difference in words and the time; it may move
        :attr:`look_at`.
    :ivar look_at: when the next look is due; infinity: none is planned.
    :ivar request_agrees: the last look found the request map to be right, and it stays: cyclic
        requests reach the parameters that they are meant for.
    :ivar silent_looks: so many in a row went unanswered.
    """

    def __init__(self, channel: AcyclicChannel, *, request_base: int, response_base: int,
                 request: tuple[int, ...], response: tuple[int, ...], rewrite: bool,
                 emit: Callable[[Event], None],
                 judged: Callable[[Verdict, str, float], None]) -> None:
        self.look_at = math.inf
        self.request_agrees = False
        self.silent_looks = 0
        self._channel = channel
        self._bases = request_base, response_base
        self._request = request
        self._response = response
        self._rewrite = rewrite
        self._emit = emit
        self._judged = judged
        self._running = False
        self._outdated = False  # what is being read counts no more
        self._agreed = False  # the drive is being cycled, unless it is lost meanwhile
        self._told = ''
        self._pause = MAPPING_PERIOD
        self._rewritten_at = -math.inf

    def next_timer(self) -> float:
        """Return when the next look is due."""
        return self.look_at

    def handle_timer(self, now: float) -> None:
        """Read the maps, unless that is under way."""
        self.look_at = math.inf
        if not self._running:
            self._running = True
            self._outdated = False
            needed = self._request if self._agreed else None
            self._channel.run(
                procedures.read_maps(*self._bases, needed=needed), self._read, now)

    def look_afresh(self, now: float) -> None:
        """Read the maps; an answer that may be on its way already does not count."""
        self._outdated = self._running
        self._agreed = False
        self.handle_timer(now)

    def stop(self) -> None:
        """Plan nothing any more. The channel was cleared."""
        self.look_at = math.inf
        self._running = self._agreed = False

    @property
    def unknown(self) -> Sentence:
        """Say that nobody knows whether the maps are still right; '' as long as somebody may."""
        return NOTHING if self.silent_looks < SILENT_LOOKS else sentences.maps_unknown(
            self.silent_looks)

    # -- inside -----------------------------------------------------------------------------------

    def _read(self, maps: procedures.Maps | None) -> None:
        now = self._channel.now
        self._running = False
        if self._outdated:
            self.handle_timer(now)
            return
        self.look_at = now + MAPPING_PERIOD
        found = '' if maps is None else '; '.join(differences(
            maps.request, maps.response,
            wanted_request=self._request, wanted_response=self._response))
        self.request_agrees = (maps is not None and effective(maps.request) == self._request
                               and not self._rewrite)
        if not found and (maps is None or maps.response is None):
            self.silent_looks += 1
            self._judged(Verdict.SILENT, '', now)
            return
        self.silent_looks = 0
        self._agreed = not found
        if not found:
            self._told = ''
            if now - self._rewritten_at > REWRITE_PAUSE_MAX:
                self._pause = MAPPING_PERIOD
            self._judged(Verdict.AGREE, '', now)
            return
        self._judged(Verdict.DIFFER, found, now)
        if not self._rewrite:
            self._tell(sentences.maps_found(found))
        elif now >= self._rewritten_at + self._pause:
            self._begin_rewrite(now)
        else:
            self.look_at = self._rewritten_at + self._pause
            self._tell(sentences.maps_wait(found, self._pause))

    def _begin_rewrite(self, now: float) -> None:
        if self._rewritten_at > -math.inf:
            self._pause = min(2 * self._pause, REWRITE_PAUSE_MAX)
        self.look_at = math.inf
        self._running = True
        self._channel.run(
            procedures.write_maps(*self._bases, request=self._request, response=self._response),
            self._rewritten, now)

    def _rewritten(self, failure: Sentence) -> None:
        now = self._rewritten_at = self._channel.now
        self._running = False
        if failure:
            self._tell(sentences.maps_not_written(failure))
            self.look_at = now + self._pause
            return
        self._emit(MappingWritten(sentences.maps_written(self._request, self._response)))
        self._told = ''
        self.handle_timer(now)

    def _tell(self, text: Sentence) -> None:
        """Report a difference, once."""
        if text != self._told:
            self._emit(MappingDiffered(text))
        self._told = text
