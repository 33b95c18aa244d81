# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Profiles that are in effect, and those that nobody reads.

What is loaded is as the wheels have it: Jazzy (rmw_fastrtps 8.4.3, Fast DDS 2.14.5) and Kilted
(9.3.3, 3.2.3, whose adapter still reads the older variable), and packages for Ubuntu.
"""

from pathlib import Path

import pytest

from drive_can_bridge.cli.main import main
from drive_can_bridge.process.fast_dds import IgnoredProfiles, Middleware, running
from drive_can_bridge.resources import config_file

OLD, NEW = 'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE'
OLD_FILE, NEW_FILE = 'DEFAULT_FASTRTPS_PROFILES.xml', 'DEFAULT_FASTDDS_PROFILES.xml'
LINE = '7f5c8a400000-7f5c8a9d1000 r-xp 00000000 08:01 1310733                    {}\n'
#: version -> how its library is called, which variables its adapter reads by itself
FOUND = {
    '2.14': ('/venv/lib/libfastrtps.so.2.14', b''),
    '2.14 of Ubuntu': ('/opt/ros/jazzy/lib/libfastrtps.so.2.14.4', b''),
    '2.6': ('/opt/ros/humble/lib/libfastrtps.so.2.6.9', b''),
    '3.2': ('/venv/lib/libfastdds.so.3.2', OLD.encode()),
    '3.2 in a wheel': ('/venv/x.libs/libfastdds-1592532c.so.3.2.3', OLD.encode()),
    # as it will be: the older variable is gone
    '3.6': ('/opt/ros/lyrical/lib/libfastdds.so.3.6', b''),
}


def loaded(folder: Path, version: str) -> Middleware:
    """Return what runs where this version is loaded."""
    library, text = FOUND[version]
    adapter = folder / 'librmw_fastrtps_shared_cpp.so'
    adapter.write_bytes(b'\x7fELF\0' + text + b'\0')
    maps = folder / 'maps'
    maps.write_text(''.join(LINE.format(path) for path in (
        '/venv/lib/libstd_msgs__rosidl_typesupport_fastrtps_c.so', '/venv/lib/libfastcdr.so.2',
        adapter, library)), encoding='utf-8')
    return running('rmw_fastrtps_cpp', maps)


@pytest.fixture(name='tls')
def _tls(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    folder = tmp_path / 'security'
    assert main(['security', str(config_file('demo.yaml')), '-o', str(folder)]) == 0
    return folder / 'tls_bridge.xml'


@pytest.mark.parametrize(('version', 'name', 'variables', 'shipped'), [
    ('2.14', 'Fast DDS 2.14', (OLD,), 'fast_dds_2.xml'),
    ('2.14 of Ubuntu', 'Fast DDS 2.14', (OLD,), 'fast_dds_2.xml'),
    ('2.6', 'Fast DDS 2.6', (OLD,), 'fast_dds_2.xml'),
    ('3.2', 'Fast DDS 3.2', (NEW, OLD), 'fast_dds_3.xml'),
    ('3.2 in a wheel', 'Fast DDS 3.2', (NEW, OLD), 'fast_dds_3.xml'),
    ('3.6', 'Fast DDS 3.6', (NEW,), 'fast_dds_3.xml')])
def test_what_each_version_reads(tmp_path: Path, version: str, name: str,
                                 variables: tuple[str, ...], shipped: str) -> None:
    middleware = loaded(tmp_path, version)
    assert (middleware.name, middleware.variables) == (name, variables)
    assert middleware.release is not None
    assert config_file(middleware.release.shipped).name == shipped
    environment: dict[str, str] = {}
    middleware.use(Path('/ours.xml'), environment)
    assert environment == {variables[0]: '/ours.xml'}


def test_words_of_the_other_version_are_in_no_file() -> None:
    """Each version refuses the whole file for one of them (tried with 2.14.5 and 3.2.3)."""
    older = config_file('fastdds/fast_dds_2.xml').read_text(encoding='utf-8')
    newer = config_file('fastdds/fast_dds_3.xml').read_text(encoding='utf-8')
    word, changed = 'nackSupressionDuration', 'nack_supression_duration'
    assert word in older and changed in newer and changed not in older
    # else they say the same
    assert newer.rpartition('-->')[2] == older.rpartition('-->')[2].replace(word, changed)


@pytest.mark.parametrize(('version', 'given', 'expected'), [
    ('2.14', {NEW: 'own.xml'}, [IgnoredProfiles(NEW, 'own.xml', OLD, False)]),
    ('2.14', {OLD: 'own.xml'}, []),
    ('2.14', {OLD: '', NEW: ''}, []),
    # one file by both is read
    ('2.14', {OLD: 'own.xml', NEW: 'own.xml'}, []),
    ('2.14', {OLD: 'own.xml', NEW: 'other.xml'}, [IgnoredProfiles(NEW, 'other.xml', OLD, False)]),
    ('3.2', {OLD: 'own.xml', NEW: 'other.xml'}, []),
    ('3.6', {OLD: 'own.xml'}, [IgnoredProfiles(OLD, 'own.xml', NEW, False)])])
def test_what_is_not_in_effect(tmp_path: Path, version: str, given: dict[str, str],
                               expected: list[IgnoredProfiles]) -> None:
    assert list(loaded(tmp_path, version).ignored(given, tmp_path)) == expected


@pytest.mark.parametrize(('version', 'variable', 'instead'), [
    ('2.14', NEW, OLD), ('3.6', OLD, NEW)])
def test_protection_that_is_not_in_effect(tmp_path: Path, tls: Path, version: str, variable: str,
                                          instead: str) -> None:
    middleware = loaded(tmp_path, version)
    for file in str(tls), 'security/tls_bridge.xml', 'security/tls_client.xml':
        assert list(middleware.ignored({variable: file}, tmp_path)) == [
            IgnoredProfiles(variable, file, instead, True)]
    # another file that is in effect protects nobody
    assert list(middleware.ignored({variable: str(tls), instead: 'own.xml'}, tmp_path)) == [
        IgnoredProfiles(variable, str(tls), instead, True)]
    assert not list(middleware.ignored({instead: str(tls)}, tmp_path))
    # edited since
    tls.write_text(tls.read_text(encoding='utf-8').replace('5100', '5200'), encoding='utf-8')
    assert next(middleware.ignored({variable: str(tls)}, tmp_path)).protects


@pytest.mark.parametrize(('version', 'lies_there', 'read'), [
    ('2.14', NEW_FILE, OLD_FILE), ('3.2', OLD_FILE, NEW_FILE)])
def test_a_file_in_the_working_directory(tmp_path: Path, tls: Path, version: str,
                                         lies_there: str, read: str) -> None:
    middleware = loaded(tmp_path, version)
    assert not middleware.has_profiles({}, tmp_path)
    (tmp_path / lies_there).write_bytes(tls.read_bytes())
    assert not middleware.has_profiles({}, tmp_path)
    assert list(middleware.ignored({}, tmp_path)) == [IgnoredProfiles(lies_there, lies_there,
                                                                      read, True)]
    (tmp_path / lies_there).rename(tmp_path / read)
    assert middleware.has_profiles({}, tmp_path)
    assert not list(middleware.ignored({}, tmp_path))


@pytest.mark.parametrize('identifier', ['rmw_cyclonedds_cpp', 'rmw_unheard_of'])
def test_another_middleware_reads_none(tmp_path: Path, tls: Path, identifier: str) -> None:
    middleware = running(identifier)
    assert middleware.name in ('Cyclone DDS', identifier)
    assert list(middleware.ignored({OLD: str(tls), NEW: 'own.xml'}, tmp_path)) == [
        IgnoredProfiles(OLD, str(tls), '', True), IgnoredProfiles(NEW, 'own.xml', '', False)]


def test_a_version_that_nobody_can_tell(tmp_path: Path, tls: Path) -> None:
    """Nothing is claimed, and nothing set."""
    for maps in tmp_path / 'none', tls:
        middleware = running('rmw_fastrtps_cpp', maps)
        assert middleware.release is None
        assert not list(middleware.ignored({OLD: str(tls), NEW: 'own.xml'}, tmp_path))


def test_a_file_that_is_none(tmp_path: Path) -> None:
    """Fast DDS says so in a line of its own and goes on without, TLS or not."""
    middleware = loaded(tmp_path, '2.14')
    (tmp_path / 'own.xml').touch()
    assert not list(middleware.missing({OLD: 'own.xml', NEW: '/none'}, tmp_path))
    for none in '/none', '.':
        assert list(middleware.missing({OLD: none}, tmp_path)) == [(OLD, none)]
    # nobody waits for a pipe
    assert not next(middleware.ignored({NEW: '/dev/stdin'}, tmp_path)).protects
