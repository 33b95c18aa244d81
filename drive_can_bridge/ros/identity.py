# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Who a drive is: the parameters of its profile's section ``identity``, as one text.

They are read once whenever the drive comes online, by a request like any user's: it waits its turn
and holds up no cycle. What could not be read is left out of the text, and tried again when the
drive comes online the next time.
"""

from collections.abc import Callable

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.core.requests import (
    BRIDGE_INACTIVE, BUS_DOWN, Failure, NO_ANSWER_OFFLINE, Outcome, ReadRequest, ReadValue,
)
from drive_can_bridge.core.words import value_text

#: the drive or its bus has gone, which is told elsewhere
_GONE = frozenset([BRIDGE_INACTIVE, BUS_DOWN, NO_ANSWER_OFFLINE])


class IdentityReader:
    """
    Asks, and puts the answer into words. In the executor's thread.

    :param submit: hands a request to the drive's session, and calls back with one outcome for
        each of its parameters.
    :param tell: takes the text, ``firmware=10205 serial_number=4711``; '' while it is not known.
    :param warn: takes what could not be read, in words.
    """

    def __init__(self, profile: Profile,
                 submit: Callable[[ReadRequest, Callable[[tuple[Outcome, ...]], None]], None],
                 tell: Callable[[str], None], warn: Callable[[str], None]) -> None:
        self._parameters: tuple[Parameter, ...] = tuple(
            profile.parameters[name] for name in profile.identity)
        self._submit = submit
        self._tell = tell
        self._warn = warn

    def read(self, _: object = None) -> None:
        """Ask the drive. Whatever was known is not: it may be another one now."""
        if self._parameters:
            self._tell('')
            self._submit(ReadRequest(self._parameters), self._take)

    def _take(self, outcomes: tuple[Outcome, ...]) -> None:
        known = []
        for parameter, outcome in zip(self._parameters, outcomes):
            if isinstance(outcome, ReadValue):
                value = value_text(parameter.value_from_raw(outcome.raw))
                known.append(f'{parameter.name}={value}')
            elif isinstance(outcome, Failure) and outcome.reason not in _GONE:
                self._warn(f'identity: {parameter.name} ({parameter.address}): {outcome.reason}')
        self._tell(' '.join(known))
