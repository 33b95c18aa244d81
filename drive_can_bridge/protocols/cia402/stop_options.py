# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a drive does at a stop, in words, as its 605Ah, 605Bh, 605Ch say."""

from drive_can_bridge.protocols.cia402 import states

_HOW = {0: 'power off, it coasts', 1: 'slow-down ramp', 2: 'quick-stop ramp', 3: 'current limit',
        4: 'voltage limit', 5: 'slow-down ramp, then holds', 6: 'quick-stop ramp, then holds',
        7: 'current limit, then holds', 8: 'voltage limit, then holds'}
_RAMP_OR_NOT = {0: 'power off, it coasts', 1: 'slow-down ramp, then power off'}
_STOPS = (('quick stop', states.QUICK_STOP_OPTION, _HOW),
          ('disable operation', states.DISABLE_OPTION,
           {**_RAMP_OR_NOT, 1: 'slow-down ramp'}),
          ('shutdown', states.SHUTDOWN_OPTION, _RAMP_OR_NOT))


def stops_by(options: dict[int, int], bridge_lost: str) -> str:
    """
    Return what quick stop and disable do on a drive.

    :param options: what the objects say, by index.
    :param bridge_lost: what stops it when the bridge dies; '': not known yet.
    """
    known = [(name, index, meanings) for name, index, meanings in _STOPS if index in options]
    return '; '.join([
        f'{name}: {meanings.get(options[index], "as the manual says")} '
        f'({index:04X}h = {options[index]})' for name, index, meanings in known] + (
            [f'bridge lost: {bridge_lost}'] if bridge_lost else [])) or 'not known'
