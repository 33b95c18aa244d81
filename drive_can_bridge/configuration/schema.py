# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The JSON Schemas of the parameter file and of profiles.

They serve twice: the check below runs on them, and editors use the shipped files for completion
(``# yaml-language-server: $schema=…``). The schema of the parameter file is put together from a
base and from the keys of every protocol family; the result is shipped as a file, which a test
compares. To write it anew: ``python3 -m drive_can_bridge.configuration.schema``.
"""

from collections.abc import Mapping
from copy import deepcopy
from functools import lru_cache
from importlib import resources
import json
from typing import Any

from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.family import Family

Schema = dict[str, Any]

#: keys that some family has for itself
ALL_OPTIONS = frozenset(key for family in FAMILIES.values() for key in family.options_schema)

PARAMETER_FILE = 'parameter_file.schema.json'
PROFILE = 'profile.schema.json'
_BASE = 'base.json'
#: accepts nothing. Not ``false``: jsonschema forgets the path of what that refuses
FORBIDDEN: Schema = {'not': {}}


def load(name: str) -> Schema:
    """Load one of the shipped schema files."""
    folder = resources.files(f'{__package__}') / 'schemas'
    schema: Schema = json.loads((folder / name).read_text(encoding='utf-8'))
    return schema


@lru_cache(maxsize=None)
def parameter_file_schema() -> Schema:
    """Return the schema of the parameter file, with the keys of all families."""
    return compose(load(_BASE), list(FAMILIES.values()))


@lru_cache(maxsize=None)
def profile_schema() -> Schema:
    """Return the schema of a profile."""
    return load(PROFILE)


def compose(base: Schema, families: list[Family]) -> Schema:
    """
    Add the keys of the families to the base.

    A key stands among the properties of a drive, so that editors know it whatever the protocol;
    where the protocol is given, keys of other families are forbidden and a key that families
    understand differently takes the meaning of this one.
    """
    schema = deepcopy(base)
    schema.pop('$comment', None)
    drive = schema['$defs']['drive']
    drive['properties']['protocol']['enum'] = [family.name for family in families]
    conditions = []
    variants: dict[str, list[Schema]] = {}
    for family in families:
        for key, option in family.options_schema.items():
            known = variants.setdefault(key, [])
            if option not in known:
                known.append(option)
    for key, options in variants.items():
        drive['properties'][key] = options[0] if len(options) == 1 else True
    for family in families:
        special = {
            key: family.options_schema.get(key, FORBIDDEN) for key, options in variants.items()
            if key not in family.options_schema or len(options) > 1}
        if special:
            conditions.append({
                'if': {'required': ['protocol'],
                       'properties': {'protocol': {'const': family.name}}},
                'then': {'properties': special},
            })
    if conditions:
        drive['allOf'] = conditions
    return schema


def definition(name: str) -> Schema:
    """Return one of the definitions of the parameter file's schema: ``bus``, ``drive``."""
    found: Schema = parameter_file_schema()['$defs'][name]
    return found


def defaults(name: str) -> dict[str, Any]:
    """Return the default values of a definition's keys (those that have one)."""
    return {key: deepcopy(option['default']) for key, option in definition(name)['properties']
            .items() if isinstance(option, dict) and 'default' in option}


def as_numbers(name: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Make floats of the integers that were given where a definition wants a number."""
    properties = definition(name)['properties']
    return {key: float(value) if properties.get(key, {}).get('type') == 'number' else value
            for key, value in values.items()}


def text(schema: Schema) -> str:
    """Return a schema as the text of its shipped file."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + '\n'


def main() -> None:
    """Write the shipped schema of the parameter file."""
    target = resources.files(f'{__package__}') / 'schemas' / PARAMETER_FILE
    with open(str(target), 'w', encoding='utf-8') as file:
        file.write(text(parameter_file_schema()))


if __name__ == '__main__':
    main()
