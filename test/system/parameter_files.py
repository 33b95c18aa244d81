# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Parameter files for the tests that start the executables."""

from pathlib import Path
from typing import Any

import plant


#: generous: nothing here may depend on how busy the machine is
CONVEYOR = {**plant.CONVEYOR, 'period': 0.02, 'command_timeout': 5.0, 'missed_limit': 25,
            'parameter_timeout': 0.3}
#: waits for long
LIFT = {**plant.LIFT, 'period': 0.02, 'missed_limit': 100, 'parameter_timeout': 10.0,
        'control_timeout': 20.0}
#: the conveyor on another station, with nothing to spare: it is there to be silent
NEIGHBOUR = {**CONVEYOR, 'station': 2}


def bridge_file(directory: Path, *, channel: str | Path | None = None,
                interface: str = 'slcan', node: str = '/**/drive_can_bridge',
                bus: dict[str, Any] | None = None,
                drives: dict[str, dict[str, Any]] | None = None, **parameters: Any) -> Path:
    """
    Write a parameter file with one bus, ``main``, and the conveyor unless told otherwise.

    :param channel: None: the link that a simulator keeps in the same directory.
    :param bus: further keys of the bus, or other values.
    """
    buses = {'main': {
        'interface': interface, 'channel': str(channel or directory / 'links' / 'main'),
        'bitrate': 125_000, 'reconnect_period': 0.2, **(bus or {})}}
    file = directory / 'bridge.yaml'
    text = plant.text(drives or {'conveyor': CONVEYOR}, node=node, **{
        'diagnostics_period': 0.2, 'buses': buses, **parameters})
    file.write_text(text, encoding='utf-8')
    return file
