# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is installed: versions agree, and nothing is left behind."""

import ast
from collections.abc import Iterable
import importlib.metadata
import importlib.util
import json
import os
from pathlib import Path
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from types import ModuleType
from typing import Any
from unittest import mock
from xml.etree import ElementTree

import pytest
from setuptools import Distribution

import drive_can_bridge
from drive_can_bridge import compiled, resources

CHECKOUT = Path(__file__).resolve().parent.parent
PACKAGE = CHECKOUT / 'drive_can_bridge'

#: the name of a distribution for pip, and the rosdep key of the same thing
ROSDEP_KEYS = {
    'python-can': 'python3-can',
    'PyYAML': 'python3-yaml',
    'jsonschema': 'python3-jsonschema',
    'rich': 'python3-rich',
    'pyserial': 'python3-serial',
    'argcomplete': 'python3-argcomplete',
    'matplotlib': 'python3-matplotlib',
    'scapy': 'python3-scapy',
}
#: extras of which rosdep knows all, and those of which it knows nothing
WITH_KEYS, WITHOUT_KEYS = ('completion', 'plot', 'wireshark'), ('eds', 'panel')


@pytest.fixture
def arguments(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return what setup.py tells setuptools."""
    monkeypatch.chdir(CHECKOUT)
    with mock.patch('setuptools.setup') as setup:
        runpy.run_path(str(CHECKOUT / 'setup.py'))
    setup.assert_called_once()
    return dict(setup.call_args.kwargs)


@pytest.fixture
def manifest() -> ElementTree.Element:
    """Return the root of package.xml."""
    return ElementTree.parse(CHECKOUT / 'package.xml').getroot()


def files_below(directory: Path) -> list[Path]:
    """List what somebody wrote below a directory, leaving out what tools leave there."""
    return [
        path for path in sorted(directory.rglob('*'))
        if path.is_file() and not any(
            part == '__pycache__' or part.startswith('.')
            for part in path.relative_to(directory).parts)
    ]


def test_versions_agree(arguments: dict[str, Any], manifest: ElementTree.Element) -> None:
    assert arguments['version'] == drive_can_bridge.__version__
    assert manifest.findtext('version') == drive_can_bridge.__version__


def test_changelog_tells_of_this_version() -> None:
    changelog = (CHECKOUT / 'CHANGELOG.rst').read_text(encoding='utf-8')
    sections = re.findall(r'^(Forthcoming|\d+\.\d+\.\d+) ?.*\n-+$', changelog, re.MULTILINE)
    assert sections
    assert sections[0] in ('Forthcoming', drive_can_bridge.__version__)


def test_name_and_license_agree(
    arguments: dict[str, Any], manifest: ElementTree.Element,
) -> None:
    assert arguments['name'] == manifest.findtext('name') == PACKAGE.name
    assert arguments['license'] == manifest.findtext('license')
    assert (CHECKOUT / 'resource' / PACKAGE.name).is_file()


def test_every_folder_with_python_is_an_installed_package(arguments: dict[str, Any]) -> None:
    folders = {path.parent for path in files_below(PACKAGE) if path.suffix == '.py'}
    without_init = [folder for folder in folders if not (folder / '__init__.py').is_file()]
    assert not without_init
    names = {'.'.join(folder.relative_to(CHECKOUT).parts) for folder in folders}
    assert set(arguments['packages']) == names


def test_every_other_file_in_the_package_is_installed(arguments: dict[str, Any]) -> None:
    installed: set[Path] = set()
    for package, patterns in arguments['package_data'].items():
        for pattern in patterns:
            installed.update(CHECKOUT.joinpath(*package.split('.')).glob(pattern))
    others = {path for path in files_below(PACKAGE) if path.suffix != '.py'}
    assert others <= installed


@pytest.mark.parametrize('top', ['config', 'launch'])
def test_every_shared_file_is_installed(arguments: dict[str, Any], top: str) -> None:
    installed = {
        (target, source) for target, sources in arguments['data_files'] for source in sources}
    for path in files_below(CHECKOUT / top):
        source = path.relative_to(CHECKOUT)
        target = f'share/{PACKAGE.name}/{source.parent.as_posix()}'
        assert (target, source.as_posix()) in installed


def test_ros_finds_the_package(arguments: dict[str, Any]) -> None:
    targets = dict(arguments['data_files'])
    marker = f'resource/{PACKAGE.name}'
    assert targets['share/ament_index/resource_index/packages'] == [marker]
    assert 'package.xml' in targets[f'share/{PACKAGE.name}']


def test_environment_hooks_put_the_executables_on_the_path(arguments: dict[str, Any]) -> None:
    installed = {f'{target}/{Path(source).name}': (CHECKOUT / source).read_text(encoding='utf-8')
                 for target, sources in arguments['data_files'] for source in sources}
    hook = f'share/{PACKAGE.name}/environment/path'
    # colcon: the prefix's setup.* read the one, the package's own the other
    hooks = json.loads((CHECKOUT / 'colcon.pkg').read_text(encoding='utf-8'))['hooks']
    assert hooks == [f'{hook}.dsv', f'{hook}.sh']
    # any other installation
    assert installed[f'share/{PACKAGE.name}/package.dsv'] == f'source;{hook}.dsv\n'
    scripts = f'lib/{PACKAGE.name}'
    assert f'install_scripts=$base/{scripts}\n' in (CHECKOUT / 'setup.cfg').read_text()
    assert installed[f'{hook}.dsv'] == f'prepend-non-duplicate;PATH;{scripts}\n'
    assert installed[f'{hook}.sh'].endswith(
        f'_colcon_prepend_unique_value PATH "$COLCON_CURRENT_PREFIX/{scripts}"\n')


def test_readme_shows_the_version_that_it_installs() -> None:
    readme = (CHECKOUT / 'README.md').read_text(encoding='utf-8')
    told = re.findall(r'^drive_can --version +# (.*)$', readme, re.MULTILINE)
    assert told == [f'drive_can {drive_can_bridge.__version__} (pure Python)'] * 2


@pytest.mark.parametrize(('extra', 'package'), [
    ('eds', 'canopen>=2.3'), ('panel', 'nicegui<4,>=3'), ('plot', 'matplotlib')])
def test_an_extra_that_is_missing_comes_with_one_line(
    monkeypatch: pytest.MonkeyPatch, extra: str, package: str,
) -> None:
    monkeypatch.setattr('importlib.metadata.requires', lambda _: [
        'rich', 'canopen>=2.3; extra == "eds"', "nicegui<4,>=3 ; extra == 'panel'",
        'matplotlib; extra == "plot"', 'matplotlib; extra == "test"'])
    assert resources.command_that_brings(extra) == shlex.join(
        [sys.executable, '-m', 'pip', 'install', package])


def test_an_extra_of_sources_that_nobody_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(name: str) -> list[str]:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr('importlib.metadata.requires', unknown)
    assert resources.command_that_brings('eds').endswith("pip install 'drive_can_bridge[eds]'")


def test_executables_have_a_function_behind_them(arguments: dict[str, Any]) -> None:
    scripts = arguments['entry_points']['console_scripts']
    assert {script.split(' = ')[0] for script in scripts} == {'drive_can_bridge', 'drive_can'}
    for script in scripts:
        module, function = script.split(' = ')[1].split(':')
        source = CHECKOUT.joinpath(*module.split('.')).with_suffix('.py')
        tree = ast.parse(source.read_text(encoding='utf-8'))
        names = [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]
        assert function in names


#: as pip writes an executable; the user presses Ctrl-C while it is being loaded
EARLY_INTERRUPT = """
import os, signal, sys
class Keyboard:
    def find_spec(self, name, path, target=None):
        if name == 'drive_can_bridge.core':
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Keyboard())
from {module} import {function}
sys.exit({function}())
"""


@pytest.mark.usefixtures('programs')
@pytest.mark.parametrize(('name', 'words', 'code', 'errors'), [
    ('drive_can', ['validate', 'nothing.yaml'], 130, 'drive_can validate: interrupted\n'),
    ('drive_can', ['monitor'], 0, ''), ('drive_can_bridge', ['--help'], 0, '')])
def test_interrupt_while_it_is_loaded(arguments: dict[str, Any], name: str, words: list[str],
                                      code: int, errors: str) -> None:
    if name == 'drive_can_bridge':
        pytest.importorskip('rclpy')
    scripts = dict(each.split(' = ') for each in arguments['entry_points']['console_scripts'])
    module, function = scripts[name].split(':')
    done = subprocess.run(
        [sys.executable, '-c', EARLY_INTERRUPT.format(module=module, function=function), *words],
        capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (code, errors)


def test_pip_and_rosdep_bring_the_same(
    arguments: dict[str, Any], manifest: ElementTree.Element,
) -> None:
    extras = arguments['extras_require']
    assert set(extras) == {*WITH_KEYS, *WITHOUT_KEYS, 'ros', 'ros-kilted', 'test'}
    by_pip = {re.split('[<>=~!]', entry)[0] for entry in [
        *arguments['install_requires'], *(each for name in WITH_KEYS for each in extras[name])]}
    by_rosdep = {
        node.text for node in manifest.iter('exec_depend')
        if (node.text or '').startswith('python3-')}
    assert {ROSDEP_KEYS[name] for name in by_pip} == by_rosdep


def test_placeholders_stand_where_contributing_says() -> None:
    text = (CHECKOUT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
    named = re.findall('`([^`]+)`', ''.join(
        line for line in text.splitlines() if line.startswith('| address')))
    holders = [path.relative_to(CHECKOUT).as_posix() for pattern in ('*', 'docs/*.md')
               for path in CHECKOUT.glob(pattern) if path.is_file()
               and b'drive-can-bridge.invalid' in path.read_bytes()]
    assert {*holders, 'CONTRIBUTING.md'} == {*named, 'CONTRIBUTING.md'}


def test_drive_can_installs_without_ros(arguments: dict[str, Any]) -> None:
    needed = arguments['install_requires']
    assert not [entry for entry in needed if entry.startswith(('ros', 'rcl'))]
    for extra in 'ros', 'ros-kilted':
        assert any(entry.startswith('ros-rclpy') for entry in arguments['extras_require'][extra])


def test_sources_carry_their_licence() -> None:
    bare = []
    for top in ('drive_can_bridge', 'launch', 'test', 'bench', '.ci'):
        for path in files_below(CHECKOUT / top):
            if path.suffix != '.py' or path.stat().st_size == 0:
                continue
            head = path.read_text(encoding='utf-8').splitlines()[:2]
            if not any('Apache License, Version 2.0' in line for line in head):
                bare.append(path.relative_to(CHECKOUT).as_posix())
    assert not bare


def installed_copy_of_resources(prefix: Path) -> ModuleType:
    """Load the module out of a prefix as pip or colcon would fill it."""
    site_packages = prefix / 'lib' / 'python3.99' / 'site-packages' / PACKAGE.name
    site_packages.mkdir(parents=True)
    copy = site_packages / 'resources.py'
    copy.write_bytes((PACKAGE / 'resources.py').read_bytes())
    spec = importlib.util.spec_from_file_location('resources_of_a_prefix', copy)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_checkout_finds_its_own_files() -> None:
    assert resources.share_directory() == CHECKOUT
    assert resources.profiles_directory() == CHECKOUT / 'config' / 'profiles'
    for path in (CHECKOUT / 'config').glob('*.yaml'):
        assert resources.config_file(path.name) == path


def test_an_installed_copy_finds_the_files_of_its_prefix(tmp_path: Path) -> None:
    module = installed_copy_of_resources(tmp_path)
    share = tmp_path / 'share' / PACKAGE.name
    (share / 'config' / 'profiles').mkdir(parents=True)
    assert module.share_directory() == share


def test_a_copy_without_files_says_where_it_looked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    module = installed_copy_of_resources(tmp_path)
    monkeypatch.setattr(module, '_indexed_share_directory', lambda: None)
    monkeypatch.setattr('sys.prefix', str(tmp_path / 'elsewhere'))
    with pytest.raises(FileNotFoundError, match='elsewhere'):
        module.share_directory()


def test_an_unknown_file_is_answered_with_the_known_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / 'config').mkdir()
    (tmp_path / 'config' / 'known.yaml').touch()
    monkeypatch.setattr(resources, 'share_directory', lambda: tmp_path)
    with pytest.raises(FileNotFoundError, match=r'no other\.yaml in .*, which has: known\.yaml'):
        resources.config_file('other.yaml')


# -- the compiled build ---------------------------------------------------------------------------


@pytest.fixture
def script() -> dict[str, Any]:
    """Return the names of setup.py."""
    with mock.patch('setuptools.setup'):
        return runpy.run_path(str(CHECKOUT / 'setup.py'))


def test_what_may_be_compiled_is_there_once_each_with_a_reason(script: dict[str, Any]) -> None:
    for module, why in script['COMPILED'].items():
        assert (PACKAGE / f'{module}.py').is_file() and why


def test_nothing_is_compiled_unless_asked_for(
        monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    monkeypatch.delenv('DRIVE_CAN_COMPILED', raising=False)
    arguments = request.getfixturevalue('arguments')
    assert arguments['ext_modules'] == arguments['setup_requires'] == []
    assert not any('mypy' in each for each in arguments['install_requires'])


def test_no_library_stands_beside_sources_that_may_change() -> None:
    """Python would take it instead of them."""
    assert compiled.build() == 'pure Python'
    assert not [path for path in files_below(PACKAGE) if path.suffix == '.so']


def set_up(folder: Path, words: Iterable[str], **environment: str,
           ) -> 'subprocess.CompletedProcess[str]':
    """Call setup.py of a copy, with a builder of another version."""
    checkout = folder / 'checkout'
    shutil.copytree(CHECKOUT, checkout, ignore=shutil.ignore_patterns(
        '.*', '*.egg-info', '__pycache__', 'test', 'bench', 'docs', 'findings', 'build', 'view'))
    (folder / 'mypy-0.0.1.dist-info').mkdir()
    (folder / 'mypy-0.0.1.dist-info' / 'METADATA').write_text('Name: mypy\nVersion: 0.0.1\n')
    inherited = {key: value for key, value in os.environ.items() if key != 'DRIVE_CAN_COMPILED'}
    return subprocess.run(
        [sys.executable, 'setup.py', *words], cwd=checkout, text=True, capture_output=True,
        env={**inherited, 'PYTHONPATH': str(folder), **environment}, check=False)


def test_what_follows_a_checkout_installs_as_pure_python(tmp_path: Path, programs: None) -> None:
    """The part of setup.py develop, and so of colcon build --symlink-install, that compiles."""
    done = set_up(tmp_path, ('build_ext', '--inplace'))
    assert done.returncode == 0, done.stderr
    assert not list(tmp_path.rglob('*.so'))


@pytest.mark.parametrize(('words', 'told'), [
    (('build_ext', '--inplace'), 'beside sources that change'),
    (('develop', '--no-deps', '--install-dir', 'bin'), 'beside sources that change'),
    (('build', '--build-base', 'built'), 'needs mypy=='),
    (('install', '--prefix', 'there', '--record', 'record'), 'needs mypy=='),
])
def test_a_build_that_cannot_be_compiled_says_how_to_go_on_and_installs_nothing(
        words: tuple[str, ...], told: str, tmp_path: Path, programs: None) -> None:
    done = set_up(tmp_path, words, DRIVE_CAN_COMPILED='1')
    checkout = tmp_path / 'checkout'
    assert done.returncode != 0
    last = done.stderr.strip().splitlines()[-1]
    assert told in last and 'Without DRIVE_CAN_COMPILED' in last
    assert 'Traceback' not in done.stderr
    assert not [path for path in tmp_path.rglob('*') if path.suffix in ('.so', '.egg-link')]
    assert not [path for path in (checkout / 'there').rglob('*') if path.is_file()]


def test_no_library_of_before_is_left_beside_what_is_installed(
        script: dict[str, Any], tmp_path: Path) -> None:
    suffix = script['EXTENSION_SUFFIXES'][0]
    folder = tmp_path / PACKAGE.name / 'core'
    folder.mkdir(parents=True)
    for name in (f'session{suffix}', 'session.py'):
        (folder / name).touch()
    for name in (f'{PACKAGE.name}__mypyc{suffix}', f'other{suffix}'):
        (tmp_path / name).touch()
    command = script['InstallLibrary'](Distribution())
    command.build_dir, command.install_dir = str(tmp_path / 'nothing'), str(tmp_path)
    command.install()
    assert [path.name for path in folder.iterdir()] == ['session.py']
    assert {path.name for path in tmp_path.iterdir()} == {PACKAGE.name, f'other{suffix}'}
