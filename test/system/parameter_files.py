# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Parameter files for the tests that start the executables."""

from pathlib import Path
from typing import Any

import yaml


class _Dumper(yaml.SafeDumper):
    """Without aliases: rcl knows none."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


CONVEYOR = {
    'bus': 'main', 'protocol': 'datamodel_extended', 'station': 1, 'profile': 'datamodel_example',
    'period': 0.02, 'cyclic_request': ['speed_setpoint', 'torque_limit'],
    'cyclic_response': ['actual_speed', 'motor_current', 'status_word'],
    # generous: nothing here may depend on how busy the machine is
    'command_timeout': 5.0, 'missed_limit': 25, 'parameter_timeout': 0.3,
}
#: the same on another station, with nothing to spare: it is there to be silent
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
    content = {
        'diagnostics_period': 0.2,
        'buses': {'main': {
            'interface': interface, 'channel': str(channel or directory / 'links' / 'main'),
            'bitrate': 125_000, 'reconnect_period': 0.2, **(bus or {})}},
        'drives': drives or {'conveyor': CONVEYOR},
        **parameters,
    }
    file = directory / 'bridge.yaml'
    text = yaml.dump({node: {'ros__parameters': content}}, Dumper=_Dumper, sort_keys=False)
    file.write_text(text, encoding='utf-8')
    return file
