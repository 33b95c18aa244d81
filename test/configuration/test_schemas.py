# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The shipped JSON Schemas: up to date, correct, and in agreement with the shipped examples."""

from dataclasses import asdict
import json
from pathlib import Path
import re
from typing import Any

from jsonschema import Draft202012Validator
import pytest
from saying import says
import yaml

from drive_can_bridge.configuration import schema
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.configuration.problems import Tree
from drive_can_bridge.configuration.schema import check_schema, resolved
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.resources import share_directory

CONFIG = share_directory() / 'config'
EXAMPLES = sorted(CONFIG.glob('*.yaml'))
PROFILES = sorted(CONFIG.glob('profiles/*.yaml'))


@pytest.mark.parametrize('name', [schema.PARAMETER_FILE, schema.PROFILE])
def test_shipped_files_are_up_to_date(name: str) -> None:
    """To write them anew: ``python3 -m drive_can_bridge.configuration.schema``."""
    path = Path(schema.__file__).parent / 'schemas' / name
    assert path.read_text(encoding='utf-8') == schema.shipped()[name]


def test_profiles_may_name_every_family() -> None:
    protocols = schema.profile_schema()['properties']['protocols']
    assert protocols['items']['enum'] == list(FAMILIES)
    assert protocols['description'] == 'The protocol families that the drive type speaks.'


def test_pages_know_every_family() -> None:
    checkout = Path(__file__).resolve().parents[2]
    rows = re.findall(r'^\| `(\w+)` \|.*\[notes\]\((docs/\w+\.md)\)',
                      (checkout / 'README.md').read_text(encoding='utf-8'), re.MULTILINE)
    assert [name for name, _ in rows] == list(FAMILIES)
    for name, page in rows:
        assert f'`protocol: {name}`' in (checkout / page).read_text(encoding='utf-8')


@pytest.mark.parametrize('document', [schema.load(schema.PARAMETER_FILE), schema.profile_schema()])
def test_is_a_schema(document: dict[str, Any]) -> None:
    Draft202012Validator.check_schema(document)


#: keys without a default
REQUIRED = {('cia402', 'mode')}


@pytest.mark.parametrize('family', FAMILIES.values())
def test_keys_of_families_have_defaults_that_fit(family: Any) -> None:
    made = asdict(family.make_options(1, {}))
    assert set(made) == set(family.options_schema)
    for key, option in family.options_schema.items():
        value = list(made[key]) if isinstance(made[key], tuple) else made[key]
        assert option.get('default', value) == value
        assert Draft202012Validator(option).is_valid(value) or (family.name, key) in REQUIRED
        assert option['description']


@pytest.mark.parametrize('path', [*EXAMPLES, *PROFILES], ids=lambda path: path.name)
def test_examples_begin_with_their_schema(path: Path) -> None:
    first = path.read_text(encoding='utf-8').splitlines()[0]
    prefix = '# yaml-language-server: $schema='
    assert first.startswith(prefix)
    target = (path.parent / first.removeprefix(prefix)).resolve()
    document = json.loads(target.read_text(encoding='utf-8'))
    # The way an editor uses it: any JSON Schema implementation, plain YAML values.
    errors = list(Draft202012Validator(document).iter_errors(yaml.safe_load(path.read_text())))
    assert errors == []


def test_editors_see_mistakes() -> None:
    text = (CONFIG / 'demo.yaml').read_text().replace('station: 1', 'statoin: 1')
    validator = Draft202012Validator(schema.load(schema.PARAMETER_FILE))
    assert len(list(validator.iter_errors(yaml.safe_load(text)))) == 2
    text = text.replace('/**/drive_can_bridge', '/**')
    assert len(list(validator.iter_errors(yaml.safe_load(text)))) == 2


@pytest.mark.parametrize('path', EXAMPLES, ids=lambda path: path.name)
def test_examples_are_all_right(path: Path) -> None:
    assert configuration_from_file(path).warnings == ()


def test_example_shows_every_key_of_a_drive() -> None:
    document = yaml.safe_load((CONFIG / 'example.yaml').read_text())
    parameters = document['/**/drive_can_bridge']['ros__parameters']
    family = FAMILIES['datamodel_extended']
    known = set(schema.definition('drive')['properties'])
    foreign = {key for other in FAMILIES.values() for key in other.options_schema}
    assert set(parameters['drives']['conveyor']) == (
        known - foreign | set(family.options_schema))
    given = {**parameters['drives']['conveyor']}
    for key, value in {**schema.defaults('drive'),
                       **asdict(family.make_options(1, {}))}.items():
        if key not in ('cyclic_request', 'cyclic_response') and key in given:
            assert given[key] == value, key


class OtherFamily:
    """As much of a family as the schema needs."""

    name = 'other'
    options_schema = {
        'mapping': {'type': 'integer', 'default': 1},
        'layout': {'type': 'string', 'default': 'a'},
    }


def test_keys_of_several_families() -> None:
    families: list[Any] = [FAMILIES['datamodel_extended'], OtherFamily()]
    document = schema.compose(schema.load('base.json'), families)
    Draft202012Validator.check_schema(document)

    def wrong(**keys: object) -> list[Sentence]:
        drive = {'bus': 'main', 'station': 1, 'profile': 'x', **keys}
        tree = Tree(drive)
        check_schema(tree, resolved(document['$defs']['drive'], document['$defs']))
        return [problem.text for problem in tree.problems]

    assert wrong(protocol='other', mapping=2, layout='b') == []
    assert wrong(protocol='datamodel_extended', mapping='assume') == []
    assert wrong(protocol='other', mapping='assume') == [
        says('wrong_type', key='mapping', value='assume', kind='a string', allowed='an integer')]
    assert wrong(protocol='datamodel_extended', layout='a') == [
        says('key_of_others', key='layout', owners='other', family='datamodel_extended')]
    assert wrong(protocol='other', length_policy='strict') == [
        says('key_of_others', key='length_policy', owners='datamodel_extended', family='other')]
