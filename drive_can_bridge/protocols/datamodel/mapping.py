# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The two maps of a drive: which parameters the slots of its cyclic telegrams stand for.

Reg.122 to 125 name the parameters of the cyclic request, Reg.126 to 129 those of the cyclic
response, slot 0 first. The first entry that is 0 ends a map: that slot and all later ones are
ignored (request) or undetermined (response), whatever the later entries say (manual, "Frame
ciclico master -> slave" and "slave -> master", with the examples Reg.122 = 50, Reg.123 = 0 and
Reg.126 = 209, Reg.127 = 210, Reg.128 = 0).

The manual also calls these parameters P0040 to P0047 in its byte tables. Reg.n is what goes over
the wire; nothing here ever touches 40 to 47.
"""

from collections.abc import Sequence

from drive_can_bridge.protocols.datamodel.extended import SLOTS

REQUEST_MAP_BASE = 122
RESPONSE_MAP_BASE = 126


def effective(entries: Sequence[int]) -> tuple[int, ...]:
    """Return the entries that count: those before the first 0."""
    length = entries.index(0) if 0 in entries else len(entries)
    return tuple(entries[:length])


def padded(numbers: Sequence[int]) -> tuple[int, ...]:
    """Fill a map with zeros up to its four slots."""
    return tuple(numbers) + (0,) * (SLOTS - len(numbers))


def differences(request: Sequence[int], response: Sequence[int] | None, *,
                wanted_request: Sequence[int], wanted_response: Sequence[int]) -> list[str]:
    """
    Compare a drive's maps with the configured ones.

    A response map may be longer than configured: the surplus is not looked at. A longer request
    map is refused, since the drive would take our zeros for values.

    :param response: None where it was not read.
    :return: one phrase per map that differs, for a message to the user.
    """
    found = []
    if effective(request) != tuple(wanted_request):
        found.append(f'request map is {_text(effective(request))}, '
                     f'configured {_text(wanted_request)}')
    if response is not None and (
            effective(response)[:len(wanted_response)] != tuple(wanted_response)):
        found.append(f'response map is {_text(effective(response))}, '
                     f'configured {_text(wanted_response)}')
    return found


def _text(numbers: Sequence[int]) -> str:
    return ', '.join(map(str, numbers)) if numbers else 'empty'
