# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Check a tree against a JSON Schema, and say what is wrong in sentences of our own.

What is wrong is also cut out of the tree and marked as damaged, so that the checks that follow
find either good values or none.
"""

from collections.abc import Callable, Iterator
import math
import re
from typing import Any

from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError
from jsonschema.validators import extend

from drive_can_bridge.configuration.problems import Path, Tree
from drive_can_bridge.configuration.schema import Schema
from drive_can_bridge.core.words import describe_type, hint, show, suggestion, value_text

#: gives another sentence for an error, or None to keep the usual one; '' hides it
Override = Callable[[Path, Any, str], 'str | None']

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


def check_schema(tree: Tree, schema: Schema, start: str = '', *,
                 override: Override | None = None) -> None:
    """
    Check a tree, note what is wrong in it, and cut that out.

    :param schema: a whole schema document.
    :param start: name of the definition that describes the tree; '' for the document itself.
    :param override: see :data:`Override`; called with path, value and the violated keyword.
    """
    root: Schema = {'$ref': f'#/$defs/{start}', '$defs': schema['$defs']} if start else schema
    found: list[tuple[Path, str, Path]] = []
    for error in _Validator(root).iter_errors(tree.data):
        for path, message, at in _sentences(error, tree):
            changed = override(path, error.instance, str(error.validator)) if override else None
            found.append((path, message if changed is None else changed, at))
    for path, message, at in found:
        tree.cut(path)
        if message:
            tree.wrong(path, message, at=at)


def check_value(value: Any, schema: Schema) -> str | None:
    """Say what is wrong with a single value; None: nothing."""
    for error in _Validator(schema).iter_errors(value):
        return _message(error)
    return None


def _sentences(error: ValidationError, tree: Tree) -> Iterator[tuple[Path, str, Path]]:
    """Yield path of the culprit, sentence, and path of the line for every part of an error."""
    path: Path = tuple(error.absolute_path)
    if error.validator == 'required':
        for key in error.validator_value:
            here = (*path, key)
            if key in error.instance or here in tree.damaged or path in tree.incomplete:
                continue
            # Called once per missing key, with all keys each time: name only this one.
            if f"'{key}'" in error.message:
                option = error.schema.get('properties', {}).get(key)
                yield here, f'missing, allowed is {allowed(option)}', here
    elif error.validator == 'additionalProperties':
        known = error.schema.get('properties', {})
        patterns = error.schema.get('patternProperties', ())
        for key in error.instance:
            if key not in known and not any(re.search(pattern, key) for pattern in patterns):
                yield (*path, key), f'unknown key, {suggestion(str(key), known)}', (*path, key)
    elif 'propertyNames' in error.relative_schema_path:
        here = (*path, error.instance)
        yield here, _message(error), here
    elif path and isinstance(path[-1], int):
        yield path[:-1], _message(error), path
    else:
        yield path, _message(error), path


def _message(error: ValidationError) -> str:
    value, schema = error.instance, error.schema
    if error.validator == 'not' and 'errorMessage' in schema:
        return str(schema['errorMessage'])
    if error.validator == 'type':
        if isinstance(value, float) and not math.isfinite(value):
            return f'{show(value)} is not a finite number, allowed is {allowed(schema)}'
        shown = describe_type(value)
        if isinstance(value, (bool, int, float, str)):
            shown = f'{show(value)} is {shown}'
        return f'{shown}, allowed is {allowed(schema)}'
    if error.validator == 'enum':
        remark = hint(value, schema['enum']) if isinstance(value, str) else ''
        return f'{show(value)} is unknown{remark}, allowed is {allowed(schema)}'
    if error.validator in ('minimum', 'maximum'):
        return f'{show(value)} is out of range, allowed is {allowed(schema)}'
    if error.validator == 'not':
        return f'{show(value)} is useless, allowed is any other number'
    if error.validator == 'minLength':
        return 'an empty string, allowed is text'
    if error.validator in ('minItems', 'maxItems'):
        least, most = schema.get('minItems', 0), schema.get('maxItems')
        count = str(least) if least == most else f'at least {least}'
        return f'a list of {len(value)} values, allowed are {count}'
    if error.validator == 'minProperties':
        return 'an empty mapping, allowed is at least one entry'
    if error.validator == 'maxProperties':
        return f'a mapping of {len(value)} entries, allowed are at most {schema["maxProperties"]}'
    return f'{show(value)} is wrong, allowed is {allowed(schema)}'


def allowed(schema: Any) -> str:
    """Say in words what a schema accepts."""
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
