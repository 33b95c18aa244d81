# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The JSON Schemas of the parameter file and of profiles, and the check of a tree against them.

Editors use the shipped files for completion (``# yaml-language-server: $schema=…``); a test
compares them. To write them again: ``python3 -m drive_can_bridge.configuration.schema``. The keys
of every protocol family are put into the schema of the parameter file.

What is wrong is reported in sentences of our own, cut out of the tree and marked as damaged, so
that later checks find either good values or none.
"""

from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from functools import lru_cache
from importlib import resources
import json
import math
import re
from types import MappingProxyType
from typing import Any

from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError
from jsonschema.validators import extend

from drive_can_bridge.configuration.problems import Path, Tree
from drive_can_bridge.core import complaints
from drive_can_bridge.core.complaints import hint, suggestion
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.sentences import uncoded
from drive_can_bridge.core.text import describe_type, nearest, value_text
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.family import Family

Schema = dict[str, Any]
#: gives another sentence for an error, or None to keep the usual one; NOTHING hides it
Override = Callable[[Path, Any, str], Sentence | None]

_TYPE_WORDS = {
    'boolean': 'true or false', 'integer': 'an integer', 'number': 'a number',
    'string': 'a string', 'array': 'a list', 'object': 'a mapping',
}


def _is_integer(_: Any, value: Any) -> bool:
    # JSON Schema calls 1.0 an integer; a ROS parameter is one type or the other.
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(_: Any, value: Any) -> bool:
    return _is_integer(_, value) or (isinstance(value, float) and math.isfinite(value))


_Validator = extend(
    Draft202012Validator,
    type_checker=Draft202012Validator.TYPE_CHECKER.redefine_many(
        {'integer': _is_integer, 'number': _is_number}))


def check_schema(tree: Tree, schema: Schema, *, override: Override | None = None) -> None:
    """
    Check a tree, record what is wrong in it, and cut that out.

    :param schema: without references, see :func:`resolved`.
    :param override: see :data:`Override`; called with path, value and the violated keyword.
    """
    found: list[tuple[Path, Sentence, Path]] = []
    for error in _Validator(schema).iter_errors(tree.data):
        for path, message, at in _sentences(error, tree):
            changed = override(path, error.instance, str(error.validator)) if override else None
            found.append((path, message if changed is None else changed, at))
    told: set[Path] = set()
    for path, message, at in found:
        tree.cut(path)
        if message and at not in told:  # of the wrong type, and out of range besides
            tree.wrong(path, message, at=at)
            told.add(at)


def check_value(value: Any, schema: Schema) -> Sentence | None:
    """Return what is wrong with a single value; None: nothing."""
    for error in _Validator(schema).iter_errors(value):
        return _message(error)
    return None


def _sentences(error: ValidationError, tree: Tree) -> Iterator[tuple[Path, Sentence, Path]]:
    """Yield path of the culprit, sentence, and path of the line for every part of an error."""
    path: Path = tuple(error.absolute_path)
    if error.validator == 'required':
        meant = _meant(error, path, tree)
        if meant is not None:
            lacking = [key for key in error.validator_value if key not in error.instance]
            yield path, complaints.other_entry_meant(lacking=', '.join(lacking), near=meant), path
            return
        for key in error.validator_value:
            here = (*path, key)
            if key in error.instance or here in tree.damaged or path in tree.incomplete:
                continue
            # Called once per missing key, with all keys each time: name only this one.
            if f"'{key}'" in error.message:
                option = error.schema.get('properties', {}).get(key)
                theirs = complaints.called_otherwise(key, (
                    str(each) for each in error.instance
                    if each not in error.schema.get('properties', {})))
                # where others are known, an unknown key is reported with what it should be
                plain = theirs is None or error.schema.get('additionalProperties') is False
                yield here, complaints.missing(allowed=allowed(option)) if plain else (
                    complaints.missing_called(allowed=allowed(option), theirs=theirs, ours=key)
                ), here
    elif error.validator == 'additionalProperties':
        known = error.schema.get('properties', {})
        patterns = error.schema.get('patternProperties', ())
        for key in error.instance:
            if key not in known and not any(re.search(pattern, key) for pattern in patterns):
                what = complaints.unknown_key(hint=suggestion(str(key), known))
                yield (*path, key), what, (*path, key)
    elif 'propertyNames' in error.relative_schema_path:
        here = (*path, error.instance)
        yield here, _message(error), here
    elif error.validator == 'minProperties' and any(
            place[:-1] == path for place in tree.damaged):
        yield path, NOTHING, path   # it had some, and what is wrong with them was reported
    elif path and isinstance(path[-1], int):
        yield path[:-1], _message(error), path
    else:
        yield path, _message(error), path


def _meant(error: ValidationError, path: Path, tree: Tree) -> str | None:
    """Return the bus or drive that one lacking most is probably meant to be, if any."""
    required = set(error.validator_value)
    if len(path) != 2 or path in tree.incomplete or any(
            (*path, key) in tree.damaged for key in required):
        return None
    lacking = required.difference(error.instance)
    return nearest(str(path[1]), [
        name for name, entry in tree.data[str(path[0])].items()
        if isinstance(entry, dict) and required <= entry.keys()
    ]) if 2 * len(lacking) >= len(required) else None


def _key_of(error: ValidationError) -> object:
    return error.absolute_path[-1] if error.absolute_path else None


def _message(error: ValidationError) -> Sentence:
    value, schema = error.instance, error.schema
    if error.validator == 'not' and 'errorMessage' in schema:
        message = schema['errorMessage']
        return message if isinstance(message, Sentence) else uncoded(message)
    if error.validator == 'type':
        if isinstance(value, float) and not math.isfinite(value):
            return complaints.not_finite(value=value, allowed=allowed(schema))
        kind = describe_type(value)
        if isinstance(value, bool) and schema.get('type') == 'string':
            return complaints.word_as_bool(value=value, kind=kind, allowed=allowed(schema))
        if isinstance(value, str) and schema.get('type') == 'array':
            return complaints.one_entry(value=value, kind=kind, allowed=allowed(schema))
        number = _number_in(value, schema) if isinstance(value, str) else None
        if number is not None:
            return complaints.number_in_words(value=value, kind=kind, allowed=allowed(schema),
                                              number=value_text(number))
        if isinstance(value, str) and re.fullmatch(r'[-+.0-9]+#.*', value):
            return complaints.comment_without_space(
                value=value, kind=kind, allowed=allowed(schema))
        if isinstance(value, (bool, int, float, str)):
            return complaints.wrong_type(value=value, kind=kind, allowed=allowed(schema))
        return complaints.wrong_kind(kind=kind, allowed=allowed(schema))
    if error.validator == 'enum':
        near = hint(value, schema['enum']) if isinstance(value, str) else NOTHING
        numbered = _NUMBERED.get(value) if isinstance(value, int) else None
        if numbered in schema['enum'] and _key_of(error) == 'mode':
            near = complaints.near(word=numbered)
        return complaints.unknown_word(value=value, near=near, allowed=allowed(schema))
    if error.validator in ('minimum', 'maximum'):
        kilo = 1000 * value
        if (_key_of(error) == 'bitrate'
                and schema.get('minimum', math.inf) <= kilo <= schema.get('maximum', -math.inf)):
            return complaints.out_of_range_in_kilo(
                value=value, allowed=allowed(schema), number=value_text(kilo))
        return complaints.out_of_range(value=value, allowed=allowed(schema))
    if error.validator == 'not':
        return complaints.useless(value=value)
    if error.validator == 'minLength':
        return complaints.empty_string()
    if error.validator in ('minItems', 'maxItems'):
        least, most = schema.get('minItems', 0), schema.get('maxItems')
        count = str(least) if least == most else f'at least {least}'
        return complaints.number_of_values(count=len(value), allowed=count)
    if error.validator == 'minProperties':
        return complaints.empty_mapping()
    if error.validator == 'maxProperties':
        return complaints.too_many_entries(count=len(value), allowed=schema['maxProperties'])
    if error.validator == 'pattern' and isinstance(value, str):
        name = re.sub(r'[^a-z0-9]+', '_', value.lower()).strip('_')
        if name and re.search(error.validator_value, name):
            return complaints.wrong_name(value=value, allowed=allowed(schema), name=name)
    return complaints.wrong(value=value, allowed=allowed(schema))


#: what drives call the modes
_NUMBERED = {number: name for family in FAMILIES.values() if family.mode_key
             for number, name in family.mode_key.names.items()}
_NUMBER = re.compile(r'([0-9]+(?:\.[0-9]+)?) *([A-Za-z/]*)')
_FACTORS = {'': 1.0, 's': 1.0, 'ms': 1e-3, 'us': 1e-6, 'bit/s': 1.0, **{
    f'{letter}{unit}': factor for letter, factor in (('k', 1e3), ('m', 1e6))
    for unit in ('', 'bit', 'bit/s', 'bps', 'baud')}}


def _number_in(text: str, schema: Any) -> float | int | None:
    """Return the number in a text with quotes, or with a unit: ``1M``, ``20ms``."""
    found = _NUMBER.fullmatch(text.strip())
    types = schema.get('type')
    if found is None or types not in ('number', 'integer') or found[2].lower() not in _FACTORS:
        return None
    value = round(float(found[1]) * _FACTORS[found[2].lower()], 9)
    low, high = schema.get('minimum', -math.inf), schema.get('maximum', math.inf)
    if not low <= value <= high or types == 'integer' and not value.is_integer():
        return None
    return int(value) if types == 'integer' else value


def allowed(schema: Any) -> str:
    """Return in words what a schema accepts."""
    if not isinstance(schema, dict):
        return 'a value'
    if 'patternErrorMessage' in schema:
        return str(schema['patternErrorMessage'])
    if 'enum' in schema:
        words = [str(word) for word in schema['enum']]
        return words[0] if len(words) == 1 else f'{", ".join(words[:-1])} or {words[-1]}'
    types = schema.get('type', 'object')
    types = [types] if isinstance(types, str) else types
    text = ' or '.join(_TYPE_WORDS[name] for name in types)
    if types == ['array']:
        items = allowed(schema.get('items'))
        if 'enum' in schema.get('items', {}):
            return f'a list of {items}'
        items = items.removeprefix('an ').removeprefix('a ')
        count = f'{schema["minItems"]} ' if 'maxItems' in schema else ''
        # "an integer of 0 to 7" is one; a list holds several.
        noun, _, limits = items.partition(' of ')
        return f'a list of {count}{noun}s' + (f' of {limits}' if limits else '')
    low, high = schema.get('minimum'), schema.get('maximum')
    if low is not None and high is not None:
        return f'{text} of {value_text(low)} to {value_text(high)}'
    if low is not None:
        return f'{text} of at least {value_text(low)}'
    return text


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


@lru_cache(maxsize=None)
def checked_bridge() -> Schema:
    """Return the schema of a bridge's parameters for :func:`check_schema`."""
    definitions = parameter_file_schema()['$defs']
    bridge: Schema = resolved(definitions['bridge'], definitions)
    return bridge


@lru_cache(maxsize=None)
def checked_profile() -> Schema:
    """Return the schema of a profile for :func:`check_schema`."""
    schema = profile_schema()
    profile: Schema = resolved(schema, schema['$defs'])
    return profile


def resolved(schema: Any, definitions: Schema) -> Any:
    """Replace references by their definitions: jsonschema looks up each one again."""
    if isinstance(schema, list):
        return [resolved(part, definitions) for part in schema]
    if not isinstance(schema, dict):
        return schema
    parts = {key: resolved(part, definitions) for key, part in schema.items()
             if key not in ('$defs', '$ref')}
    if '$ref' in schema:
        name = schema['$ref'].removeprefix('#/$defs/')
        return {**resolved(definitions[name], definitions), **parts}
    return parts


def compose(base: Schema, families: list[Family]) -> Schema:
    """
    Return the base schema with the keys of the families.

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
    """Return a schema that accepts nothing. Not ``false``: jsonschema loses its path."""
    owners = ', '.join(other.name for other in families if key in other.options_schema)
    message = complaints.key_of_others(owners=owners, family=family.name)
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
