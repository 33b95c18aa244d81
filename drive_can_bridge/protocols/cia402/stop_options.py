# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a drive does at a stop, in words, as its 605Ah, 605Bh, 605Ch and 6007h say."""

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.protocols.cia402 import states

_HOW = {0: 'power off, it coasts', 1: 'slow-down ramp', 2: 'quick-stop ramp', 3: 'current limit',
        4: 'voltage limit', 5: 'slow-down ramp, then holds', 6: 'quick-stop ramp, then holds',
        7: 'current limit, then holds', 8: 'voltage limit, then holds'}
_RAMP_OR_NOT = {0: 'power off, it coasts', 1: 'slow-down ramp, then power off'}
_BRIDGE_LOST = {0: 'nothing', 1: 'fault', 2: 'power off, it coasts', 3: 'quick stop'}
#: what each object is about, and what its values mean
OPTIONS = {states.QUICK_STOP_OPTION: ('quick stop', _HOW),
           states.DISABLE_OPTION: ('disable operation', {**_RAMP_OR_NOT, 1: 'slow-down ramp'}),
           states.SHUTDOWN_OPTION: ('shutdown', _RAMP_OR_NOT),
           states.ABORT_CONNECTION_OPTION: ('the loss of the bridge', _BRIDGE_LOST)}


def in_words(index: int, value: int) -> str:
    """Return in words what an object makes a drive do: ``quick-stop ramp (605Ah = 2)``."""
    _, meanings = OPTIONS[index]
    return f'{meanings.get(value, "as the manual says")} ({index:04X}h = {value})'


def unknown(index: int, value: int) -> Sentence:
    """Return that the standard does not have a value; '' if it has. Negative: the maker's own."""
    event, meanings = OPTIONS[index]
    return NOTHING if value < 0 or value in meanings else sentences.stop_option_unknown(
        index, value, event)


def stops_by(options: dict[int, int], bridge_lost: str) -> str:
    """
    Return what quick stop and disable do on a drive.

    :param options: what the objects say, by index.
    :param bridge_lost: what stops it when the bridge dies; '': not known yet.
    """
    return '; '.join([f'{name}: {in_words(index, options[index])}'
                      for index, (name, _) in OPTIONS.items() if index in options] + (
                          [f'bridge lost: {bridge_lost}'] if bridge_lost else [])) or 'not known'
