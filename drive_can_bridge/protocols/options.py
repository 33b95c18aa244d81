# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The keys that only one protocol family has: one frozen dataclass a family.

The dataclass is the one place that knows type, default, limits and meaning of a key. JSON Schema
and the parameters of the node are made from it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, Field, field, fields
from typing import Any, get_args, get_origin, Literal

_TYPES = {bool: 'boolean', int: 'integer', float: 'number'}
#: several of them, in order
IntegerList = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class FamilyOptions:
    """What stands there for a family that has no keys of its own."""


def option(default: Any, description: str, *, minimum: float | None = None,
           maximum: float | None = None) -> Any:
    """
    Describe a key; the annotation of the field gives its type.

    :param default: None where it depends on the station, see ``Family.make_options``.
    """
    limits = {'minimum': minimum, 'maximum': maximum}
    return field(default=default, metadata={
        'description': description,
        **{key: limit for key, limit in limits.items() if limit is not None}})


def options_schema(options: type[Any]) -> dict[str, Any]:
    """Return the JSON Schema properties of the keys, the family's own before shared ones."""
    ordered = sorted(fields(options), key=lambda entry: entry.name not in options.__annotations__)
    return {entry.name: _schema(entry) for entry in ordered}


def _schema(entry: 'Field[Any]') -> dict[str, Any]:
    description, *limits = entry.metadata.items()
    schema: dict[str, Any] = dict([description])
    if get_origin(entry.type) is Literal:
        schema['enum'] = list(get_args(entry.type))
        schema.update(limits)
    elif entry.type == IntegerList:
        schema.update(type='array', items={'type': 'integer', **dict(limits)})
    else:
        schema['type'] = _TYPES[entry.type]  # type: ignore[index]
        schema.update(limits)
    if entry.default is not None:
        default = entry.default
        schema['default'] = list(default) if isinstance(default, tuple) else default
    return schema


def make_options(options: type[Any], given: Mapping[str, Any]) -> Any:
    """Make the options from values that fit the schema; an integer is accepted for a number."""
    makers = {entry.name: float if entry.type is float else tuple for entry in fields(options)
              if entry.type in (float, IntegerList)}
    return options(**{key: makers[key](value) if key in makers else value
                      for key, value in given.items()})
