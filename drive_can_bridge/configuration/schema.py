# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The JSON Schemas of the parameter file and of profiles.

They serve twice: the check below runs on them, and editors use the shipped files for completion
(``# yaml-language-server: $schema=…``). The schema of the parameter file is put together from a
base and from the keys of every protocol family; that of profiles names the families. The results
are shipped as files, which a test compares. To write them anew:
``python3 -m drive_can_bridge.configuration.schema``.
"""

from collections.abc import Mapping
from copy import deepcopy
from functools import lru_cache
from importlib import resources
import json
import re
from types import MappingProxyType
from typing import Any

from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.family import Family

Schema = dict[str, Any]

#: keys that some family has for itself
ALL_OPTIONS = frozenset(key for family in FAMILIES.values() for key in family.options_schema)

PARAMETER_FILE = 'parameter_file.schema.json'
PROFILE = 'profile.schema.json'
_BASE = 'base.json'
_FOLDER = resources.files(f'{__package__}') / 'schemas'
_FAMILY_LIST = re.compile(r'("protocols": \{.*?"enum": )\[[^]]*\]', re.DOTALL)


def load(name: str) -> Schema:
    """Load one of the shipped schema files."""
    schema: Schema = json.loads((_FOLDER / name).read_text(encoding='utf-8'))
    return schema


@lru_cache(maxsize=None)
def parameter_file_schema() -> Schema:
    """Return the schema of the parameter file, with the keys of all families."""
    return compose(load(_BASE), list(FAMILIES.values()))


@lru_cache(maxsize=None)
def profile_schema() -> Schema:
    """Return the schema of a profile, with the names of all families."""
    return json.loads(shipped()[PROFILE])  # type: ignore[no-any-return]


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
            key: family.options_schema.get(key) or _forbidden(key, family, families)
            for key, options in variants.items()
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


def _forbidden(key: str, family: Family, families: list[Family]) -> Schema:
    """Accept nothing. Not by ``false``: jsonschema forgets the path of what that refuses."""
    owners = ', '.join(other.name for other in families if key in other.options_schema)
    message = f'a key of {owners}, allowed with {family.name} is to leave it out'
    return {'not': {}, 'errorMessage': message}


def definition(name: str) -> Schema:
    """Return one of the definitions of the parameter file's schema: ``bus``, ``drive``."""
    found: Schema = parameter_file_schema()['$defs'][name]
    return found


@lru_cache(maxsize=None)
def defaults(name: str) -> Mapping[str, Any]:
    """Return the default values of a definition's keys (those that have one)."""
    return MappingProxyType({
        key: option['default'] for key, option in definition(name)['properties'].items()
        if isinstance(option, dict) and 'default' in option})


@lru_cache(maxsize=None)
def _numbers(name: str) -> frozenset[str]:
    """Return the keys of a definition that want a number, for which an integer is accepted."""
    return frozenset(key for key, option in definition(name)['properties'].items()
                     if isinstance(option, dict) and option.get('type') == 'number')


def complete(name: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return the values of a definition's keys: those given, else the defaults.

    :param given: values that fit the definition; other keys are left out.
    """
    known, numbers = definition(name)['properties'], _numbers(name)
    return {key: float(value) if key in numbers else value
            for key, value in {**defaults(name), **given}.items() if key in known}


def shipped() -> dict[str, str]:
    """Return what the shipped schema files have to contain, by their names."""
    profile = (_FOLDER / PROFILE).read_text(encoding='utf-8')
    families = json.dumps(list(FAMILIES))
    return {
        PARAMETER_FILE: json.dumps(
            parameter_file_schema(), indent=2, ensure_ascii=False) + '\n',
        PROFILE: _FAMILY_LIST.sub(lambda found: f'{found[1]}{families}', profile, count=1)}


def main() -> None:
    """Write the shipped schemas."""
    for name, text in shipped().items():
        with open(str(_FOLDER / name), 'w', encoding='utf-8') as file:
            file.write(text)


if __name__ == '__main__':
    main()
