# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Whatever stands in a file or in overrides: an answer, or ConfigurationError. Nothing else."""

from pathlib import Path

from configuration_builders import FILE, PROFILE, write
from hypothesis import given, HealthCheck, settings, strategies as st

from drive_can_bridge.configuration.load import (
    configuration_from_file, configuration_from_overrides,
)
from drive_can_bridge.core.errors import ConfigurationError

#: twice as many as elsewhere: each is quick
EXAMPLES = 2 * settings().max_examples
FIXTURE_IS_FINE = settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=EXAMPLES)

#: pieces that mean something to YAML, to rcl or to us
PIECES = st.sampled_from([
    '\n', ' ', '  ', '    ', '\t', ': ', ':', '- ', '[', ']', '{', '}', ', ', '&a', '*a', '!!str ',
    '? ', '|\n', '"', "'", '#', '---\n', '...\n', '%YAML 1.1\n', '\0', '\ufeff', '<<', '.', '\\',
    'ros__parameters', 'buses', 'drives', 'main', 'conveyor', 'table', 'station', '1', '1e999',
    '-1', '0x10', 'yes', 'null', '.nan', 'speed', 'parameters', 'number', 'bits', 'control'])
SNIPPETS = st.lists(PIECES | st.text(max_size=3), max_size=12).map(''.join)


@st.composite
def mutated(draw: st.DrawFn, text: str) -> str:
    """Replace a few parts of a good text."""
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.integers(0, 12)))
        text = text[:start] + draw(SNIPPETS) + text[end:]
    return text


def check(path: Path) -> None:
    try:
        configuration_from_file(path)
    except ConfigurationError as error:
        assert error.problems
        for line in error.problems:
            assert line
            assert all(character.isprintable() for character in line), line


@FIXTURE_IS_FINE
@given(data=st.binary(max_size=200))
def test_any_bytes(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / 'f.yaml'
    path.write_bytes(data)
    check(path)


@FIXTURE_IS_FINE
@given(text=mutated(FILE))
def test_any_parameter_file(tmp_path: Path, text: str) -> None:
    path = write(tmp_path)
    path.write_text(text.replace('table', str(tmp_path / 'table.yaml')),
                    encoding='utf-8', errors='surrogatepass')
    check(path)


@FIXTURE_IS_FINE
@given(profile=mutated(PROFILE))
def test_any_profile(tmp_path: Path, profile: str) -> None:
    path = write(tmp_path)
    (tmp_path / 'table.yaml').write_text(profile, encoding='utf-8', errors='surrogatepass')
    check(path)


NAMES = st.lists(st.sampled_from([
    'buses', 'drives', 'main', 'a', 'interface', 'channel', 'bus', 'station', 'period', 'joint',
    'name', 'profile', 'protocol', 'cyclic_request', 'autostart', '', 'x y', 'qos_overrides']),
    min_size=1, max_size=4).map('.'.join)
VALUES = (st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
          | st.sampled_from(['main', 'virtual', 'datamodel_extended', 'datamodel_example'])
          | st.lists(st.text(max_size=3), max_size=2) | st.lists(st.integers(), max_size=2))


@settings(max_examples=EXAMPLES)
@given(overrides=st.dictionaries(NAMES, VALUES, max_size=8))
def test_any_overrides(overrides: dict[str, object]) -> None:
    try:
        configuration_from_overrides(overrides)
    except ConfigurationError as error:
        assert error.problems
