# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Who a drive is: the parameters of its profile's section ``identity``, as one text.

They are read once whenever the drive comes online, one after the other, by requests like those of
any user: each waits its turn, so that neither cycles nor users are held up by more than one read.
What could not be read is left out of the text, and tried again when the drive comes online the
next time; a drive that answers none of them is not asked for all.
"""

from collections.abc import Callable
from functools import partial

from drive_can_bridge.core.profile import Profile
from drive_can_bridge.core.requests import Failure, Outcome, ReadRequest, ReadValue
from drive_can_bridge.core.words import value_text

#: reads in a row that failed, after which the drive is left alone
FAILURES_MAX = 2


class IdentityReader:
    """
    Asks, and puts the answers into words. In the executor's thread.

    :param submit: hands a request to the drive's session, and calls back with its outcomes.
    :param online: tells whether the drive is; it is asked nothing otherwise.
    :param tell: takes the text, ``firmware=10205 serial_number=4711``; '' while it is not known.
    :param warn: takes what could not be read, in words.
    """

    def __init__(self, profile: Profile, *,
                 submit: Callable[[ReadRequest, Callable[[tuple[Outcome, ...]], None]], None],
                 online: Callable[[], bool], tell: Callable[[str], None],
                 warn: Callable[[str], None]) -> None:
        self._parameters = tuple(profile.parameters[name] for name in profile.identity)
        self._submit = submit
        self._online = online
        self._tell = tell
        self._warn = warn
        self._attempt = 0
        self._known: list[str] = []
        self._failures = 0

    def read(self) -> None:
        """Ask the drive. Whatever was known is not: it may be another one now."""
        self._attempt += 1
        self._known.clear()
        self._failures = 0
        if self._parameters:
            self._tell('')
            self._ask(self._attempt, 0)

    def _ask(self, attempt: int, place: int) -> None:
        self._submit(ReadRequest((self._parameters[place],)),
                     partial(self._take, attempt, place))

    def _take(self, attempt: int, place: int, outcomes: tuple[Outcome, ...]) -> None:
        if attempt != self._attempt or not self._online():
            return  # the next time that it comes online, all of this begins anew
        parameter, outcome = self._parameters[place], outcomes[0]
        if isinstance(outcome, ReadValue):
            self._failures = 0
            value = value_text(parameter.value_from_raw(outcome.raw))
            self._known.append(f'{parameter.name}={value}')
        elif isinstance(outcome, Failure):
            self._failures += 1
            self._warn(f'identity: {parameter.name} ({parameter.address}): {outcome.reason}')
        if place + 1 < len(self._parameters) and self._failures < FAILURES_MAX:
            self._ask(attempt, place + 1)
        else:
            self._tell(' '.join(self._known))
