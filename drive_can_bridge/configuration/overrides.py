# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The parameter overrides of a node (flat, dotted names) as a tree."""

from array import array
from collections.abc import Mapping
from typing import Any

from drive_can_bridge.configuration.problems import Path, Tree


def tree_from_overrides(overrides: Mapping[str, object]) -> Tree:
    """
    Nest dotted names.

    rcl turns ``[]`` into a parameter without type, which rclpy shows as None; hence None is the
    empty list. A name that is a value and holds others is noted as a problem.
    """
    tree = Tree({})
    holders: dict[Path, str | int] = {}
    # In the order of the file, but a value is met before what it would hold.
    for name in sorted(overrides, key=lambda name: name.count('.')):
        parts = name.split('.')
        # Topic names in QoS overrides may have dots; they are not ours to take apart.
        path: Path = (name,) if parts[0] == 'qos_overrides' else tuple(parts)
        target: Any = tree.data
        for depth, part in enumerate(path[:-1]):
            target = target.setdefault(part, {})
            if not isinstance(target, dict):
                holders.setdefault(path[:depth + 1], path[depth + 1])
                break
        else:
            target[path[-1]] = _plain(overrides[name])
    for path, below in holders.items():
        tree.wrong(path, f"has a value, and '{below}' below it; allowed is one of them")
    return tree


def _plain(value: object) -> object:
    if value is None:
        return []
    if isinstance(value, (tuple, array)):
        return list(value)
    return value
