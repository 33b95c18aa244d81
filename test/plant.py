# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A plant of small drives for parameter files; how patient they are is each test's business."""

from collections.abc import Mapping
from typing import Any

import yaml

CONVEYOR: dict[str, Any] = {
    'bus': 'main', 'protocol': 'datamodel_extended', 'station': 1, 'profile': 'datamodel_example',
    'cyclic_request': ['speed_setpoint', 'torque_limit'],
    'cyclic_response': ['actual_speed', 'motor_current', 'status_word']}
#: has a control word
LIFT: dict[str, Any] = {
    **CONVEYOR, 'station': 2, 'profile': 'datamodel_control_example',
    'cyclic_request': ['control_word', 'speed_setpoint'],
    'cyclic_response': ['status_word', 'actual_speed']}
MIXER: dict[str, Any] = {
    'bus': 'main', 'protocol': 'cannord', 'station': 50, 'profile': 'nord_sk500e',
    'cyclic_request': ['frequency_setpoint'], 'cyclic_response': ['actual_frequency']}
PUMP: dict[str, Any] = {
    'bus': 'main', 'protocol': 'canopen_pkw', 'station': 5, 'profile': 'tesys_t_ltmr',
    'cyclic_response': ['system_status_1'], 'period': 0.1}
#: a bus that is simulated, and one behind a gateway that is told later
VIRTUAL = {'interface': 'virtual', 'channel': 'x'}
SLCAN = {'interface': 'slcan', 'channel': 'somewhere', 'bitrate': 500_000, 'reconnect_period': 0.2}


class _Dumper(yaml.SafeDumper):
    """Without aliases: rcl knows none."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def text(drives: Mapping[str, Mapping[str, Any]], *, node: str = '/**/drive_can_bridge',
         **parameters: Any) -> str:
    """Return the text of a parameter file."""
    return yaml.dump({node: {'ros__parameters': {**parameters, 'drives': {
        name: dict(keys) for name, keys in drives.items()}}}}, Dumper=_Dumper, sort_keys=False)
