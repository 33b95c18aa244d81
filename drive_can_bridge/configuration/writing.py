# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Parameter files of bridges, written: everything declared, profiles by their absolute paths."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from drive_can_bridge.configuration.load import declared_parameters
from drive_can_bridge.core.configuration import BridgeConfiguration


def of_one_bus(configuration: BridgeConfiguration, name: str) -> BridgeConfiguration:
    """Return what is left of a configuration with one of its buses."""
    return replace(
        configuration, buses={name: configuration.buses[name]},
        drives={drive.name: drive for drive in configuration.drives.values()
                if drive.bus == name})


def write_parameter_file(configuration: BridgeConfiguration, path: Path,
                         node: str = 'drive_can_bridge') -> None:
    """
    Write a configuration as a parameter file of a bridge.

    :param node: the bridge's name, in whatever namespace.
    :raises OSError: it cannot be written.
    """
    tree: dict[str, Any] = {}
    for name, value, *_ in declared_parameters(configuration):
        *above, key = name.split('.')
        place = tree
        for part in above:
            place = place.setdefault(part, {})
        place[key] = value
    path.write_text(yaml.safe_dump(
        {f'/**/{node}': {'ros__parameters': tree}}, sort_keys=False), encoding='utf-8')
