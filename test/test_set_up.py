# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The environment of a checkout (``.ci/setup``), in each order in which people come to it.

Real virtual environments of a small checkout, without a pip of their own (which takes seconds);
instead of it something that only writes down what was to be installed. Whatever happens, no
package that somebody added is lost.
"""

from contextlib import suppress
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[1]
PYTHON = '{}.{}'.format(*sys.version_info)
#: what is put before the interpreter's own packages: a pip that downloads nothing, and a ROS
PIP = """
import os, pathlib, sys
with open(os.environ['INSTALLED'], 'a') as file:
    print(pathlib.Path(sys.prefix).name, sys.argv[-1], file=file)
(pathlib.Path(sys.prefix) / 'bin' / 'drive_can').write_text(f'#!{sys.executable}')
for line in os.environ.get('PIP_SAYS', '').splitlines():
    if line == 'wait':      # until somebody has looked, and let go
        open(os.environ['INSTALLED'] + '.go').read()
    else:
        print(line, flush=True)
sys.exit(int(os.environ.get('PIP_FAILS', 0)))
"""
VENV = """
import sys
sys.path = [path for path in sys.path if path != sys.path[0] and not path.endswith('/pip')]
del sys.modules['venv']
import venv
venv.main(['--without-pip', *sys.argv[1:]])
"""

pytestmark = pytest.mark.real


class Checkout:
    """
    A checkout in which people type ``make demo`` and ``make test``.

    :param place: an empty folder for it, and for what it needs.
    """

    def __init__(self, place: Path) -> None:
        self.place, self.top = place, place / 'checkout'
        self.installed = place / 'installed'
        (self.top / '.ci').mkdir(parents=True)
        for name in ('setup', 'clean', 'retry'):
            shutil.copy(ROOT / '.ci' / name, self.top / '.ci')
        for name in ('setup.py', 'setup.cfg', 'pyproject.toml'):
            (self.top / name).touch()
        for package, text in {'pip/pip': PIP, 'pip/venv': VENV, 'ros/rclpy': ''}.items():
            (place / package).mkdir(parents=True)
            (place / package / '__init__.py').touch()
            (place / package / '__main__.py').write_text(text)
        self.installed.touch()

    def run(self, *command: str, python: str = sys.executable, ros: str = '', wheels: str = '',
            fails: bool = False) -> subprocess.CompletedProcess[str]:
        """Run a command of ``.ci``; with a sourced ROS 2, other wheels, or a pip that fails."""
        return subprocess.run(
            [self.top / '.ci' / command[0], *(python,)[:command[0] == 'setup'], '.venv',
             *command[1:]],
            env={**self.environment(ros), 'PIP_FAILS': str(int(fails)),
                 **({'ROS_DISTRO_WHEELS': wheels} if wheels else {})},
            text=True, capture_output=True, check=False)

    def environment(self, ros: str = '') -> dict[str, str]:
        """Return the environment of its commands; with a sourced ROS 2."""
        path = [str(self.place / each) for each in ('pip', *(('ros',) if ros else ()))]
        inherited = {name: value for name, value in os.environ.items()
                     if name not in ('ROS_DISTRO', 'ROS_DISTRO_WHEELS', 'VIRTUAL_ENV',
                                     'PYTHONHOME')}
        return {**inherited, 'PYTHONPATH': os.pathsep.join(path),
                'INSTALLED': str(self.installed), **({'ROS_DISTRO': ros} if ros else {})}

    def set_up(self, *part: str, python: str = sys.executable, ros: str = '',
               wheels: str = '') -> str:
        """Return the folder that is used, in which somebody then adds a package."""
        done = self.run('setup', *part, python=python, ros=ros, wheels=wheels)
        assert done.returncode == 0, done.stderr
        folder = done.stdout.strip()
        added = self.top / folder / 'added_by_somebody'
        added.touch()
        return folder

    def activated(self, folder: str = '.venv') -> str:
        """Return the python that a shell finds in an activated environment."""
        return str(self.top / folder / 'bin' / 'python3')

    def what_was_installed(self) -> list[str]:
        """Return folder and target of each run of pip since the last look."""
        lines = self.installed.read_text().splitlines()
        self.installed.write_text('')
        return lines

    def kept(self) -> bool:
        """Return whether each environment still has what was added."""
        folders = [path for path in self.top.glob('.venv*') if path.is_dir()]
        return bool(folders) and all((path / 'added_by_somebody').exists() for path in folders)


@pytest.fixture
def checkout(tmp_path: Path, programs: None) -> Checkout:
    return Checkout(tmp_path)


def test_demo_then_test_then_demo(checkout: Checkout) -> None:
    assert checkout.set_up('demo') == '.venv'
    assert checkout.set_up() == '.venv'
    # an environment with everything stays one, and what is up to date is left in peace
    assert checkout.set_up('demo') == '.venv'
    assert checkout.set_up() == '.venv'
    assert checkout.what_was_installed() == ['.venv .[ros]', '.venv .[ros,test,panel]']
    assert checkout.kept()


def test_an_activated_environment_is_itself(checkout: Checkout) -> None:
    checkout.set_up()
    checkout.what_was_installed()
    assert checkout.set_up('demo', python=checkout.activated()) == '.venv'
    assert checkout.set_up(python=checkout.activated()) == '.venv'
    assert checkout.set_up() == '.venv'
    assert checkout.what_was_installed() == [] and checkout.kept()


def test_changed_requirements_only_add(checkout: Checkout) -> None:
    checkout.set_up('demo')
    (checkout.top / 'setup.py').write_text('changed')
    assert checkout.set_up('demo', python=checkout.activated()) == '.venv'
    assert checkout.what_was_installed() == ['.venv .[ros]'] * 2 and checkout.kept()


def test_sourced_ros_has_its_own(checkout: Checkout) -> None:
    assert checkout.set_up() == '.venv'
    sourced = f'.venv-sourced-jazzy-{PYTHON}'
    assert checkout.set_up('demo', ros='jazzy') == sourced
    assert checkout.set_up() == '.venv' and checkout.set_up('demo', ros='jazzy') == sourced
    assert checkout.what_was_installed() == ['.venv .[ros,test,panel]', f'{sourced} .']
    assert checkout.kept()


def test_each_distribution_has_its_own(checkout: Checkout) -> None:
    assert checkout.set_up('demo') == '.venv'
    wheels, sourced = f'.venv-wheels-kilted-{PYTHON}', f'.venv-sourced-kilted-{PYTHON}'
    assert checkout.set_up(wheels='kilted') == wheels
    assert checkout.set_up('demo', ros='kilted') == sourced
    # which is what the sourced one is, whatever is asked for
    assert checkout.set_up('demo', ros='kilted', wheels='kilted') == sourced
    assert checkout.set_up('demo', wheels='jazzy') == '.venv'
    assert checkout.what_was_installed() == [
        '.venv .[ros]', f'{wheels} .[ros-kilted,test,panel]', f'{sourced} .']
    # an activated one is itself, as long as the same is asked for
    assert checkout.set_up('demo', python=checkout.activated(wheels), wheels='kilted') == wheels
    assert checkout.what_was_installed() == [] and checkout.kept()


@pytest.mark.parametrize(('given', 'words'), [
    ({'ros': 'humble'}, 'ROS 2 humble is sourced: source jazzy or kilted or none, in a new shell'),
    ({'wheels': 'humble'}, 'ROS_DISTRO_WHEELS=humble: there are wheels of jazzy kilted'),
    ({'ros': 'jazzy', 'wheels': 'kilted'},
     'ROS 2 jazzy is sourced: for the wheels of kilted open a new shell without')])
def test_a_distribution_that_cannot_be_had(checkout: Checkout, given: dict[str, str],
                                           words: str) -> None:
    done = checkout.run('setup', 'demo', **given)
    assert (done.returncode, done.stdout, done.stderr) == (1, '', f'setup: {words}\n')


def test_another_python_has_its_own(checkout: Checkout) -> None:
    other = next((str(path) for version in ('3.10', '3.12', '3.13') if version != PYTHON
                  for path in Path.home().glob(f'.pyenv/versions/{version}.*/bin/python')), None)
    if other is None:
        pytest.skip('no other Python here')
    assert checkout.set_up('demo') == '.venv'
    own = checkout.set_up('demo', python=other)
    assert own.startswith('.venv-wheels-jazzy-3.') and not own.endswith(PYTHON)
    # whichever is activated, PYTHON= decides
    assert checkout.set_up('demo', python=checkout.activated(own)) == own
    assert checkout.set_up('demo') == '.venv' and checkout.kept()


def test_one_that_somebody_else_made_is_left_alone(checkout: Checkout) -> None:
    (checkout.top / '.venv').mkdir()
    (checkout.top / '.venv' / 'added_by_somebody').touch()
    done = checkout.run('setup')
    assert done.stdout.strip() == f'.venv-wheels-jazzy-{PYTHON}'
    assert '.venv was not made by this script, and stays as it is' in done.stderr
    assert os.listdir(checkout.top / '.venv') == ['added_by_somebody']


def test_one_of_the_version_before_is_kept(checkout: Checkout) -> None:
    checkout.set_up('demo')
    (checkout.top / '.venv' / '.made_by_setup').unlink()
    (checkout.top / '.venv' / '.ready').write_bytes(
        f'wheels 3.11.7\n{sys.executable} {checkout.top}\0want\0demo\0'.encode())
    assert checkout.set_up('demo') == '.venv'
    assert checkout.set_up('demo') == '.venv'
    assert checkout.what_was_installed() == ['.venv .[ros]'] * 2 and checkout.kept()


def test_a_copied_checkout_has_a_copy_of_its_own(checkout: Checkout) -> None:
    checkout.set_up('demo')
    commands = checkout.top / '.venv' / 'bin'
    (commands / 'added').write_text(f'#!{commands}/python3\n')
    before, original = (commands / 'added').read_text(), checkout.top
    checkout.top = checkout.place / 'copy'
    shutil.copytree(original, checkout.top, symlinks=True)
    assert checkout.set_up('demo') == '.venv'
    assert checkout.set_up('demo') == '.venv'
    assert checkout.what_was_installed() == ['.venv .[ros]'] * 2 and checkout.kept()
    copied = checkout.top / '.venv' / 'bin'
    assert (copied / 'added').read_text() == f'#!{copied}/python3\n'
    assert str(original) not in (copied / 'activate').read_text()
    assert (commands / 'added').read_text() == before


def test_what_was_interrupted_goes_on(checkout: Checkout) -> None:
    assert checkout.run('setup', 'demo', fails=True).returncode == 1
    assert checkout.set_up('demo') == '.venv'
    # broken off while the environment itself was made
    (checkout.top / '.venv' / '.ready').unlink()
    (checkout.top / '.venv' / 'bin' / 'python').unlink()
    assert checkout.set_up('demo') == '.venv' and checkout.kept()


def test_progress_and_failure_in_words(checkout: Checkout) -> None:
    failed = checkout.run('setup', 'demo', fails=True)
    assert failed.returncode == 1 and not failed.stdout
    assert 'could not install; the whole story is in .venv/setup.log' in failed.stderr
    assert 'done after' in checkout.run('setup', 'demo').stderr


def test_progress_never_stands_still(checkout: Checkout) -> None:
    """The folder does not grow while pip fetches, which is everything before it installs any."""
    gate = Path(f'{checkout.installed}.go')
    os.mkfifo(gate)
    says = ('Collecting a\n  Downloading a.whl (1 MB)\nCollecting b\nwait\n'
            'Installing collected packages: a, b\nwait')
    with subprocess.Popen(
            [checkout.top / '.ci' / 'setup', sys.executable, '.venv', 'demo'],
            env={**checkout.environment(), 'PIP_SAYS': says, 'SETUP_PAUSE': '0.05'},
            text=True, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL,
            start_new_session=True) as setting_up:
        assert setting_up.stderr is not None
        try:
            for wanted in (r'setup: \d+ s, fetching: 3 files so far',
                           r'setup: \d+ s, installing: \d+ MB so far'):
                # however long the environment takes before: a busy machine shows many lines
                assert any(re.match(wanted, line) for line in setting_up.stderr)
                gate.write_text('')
            assert setting_up.wait() == 0
        finally:
            with suppress(ProcessLookupError):
                os.killpg(setting_up.pid, signal.SIGKILL)


def test_clean_removes_what_was_made_here_and_is_not_used(checkout: Checkout) -> None:
    checkout.set_up('demo')
    (checkout.top / '.venv-mine').mkdir()
    with subprocess.Popen([checkout.activated(), '-c', 'input()'], stdin=subprocess.PIPE) as used:
        done = checkout.run('clean')
        assert done.returncode == 1 and f'it is used by process {used.pid};' in done.stderr
        assert (checkout.top / '.venv').exists()
        used.communicate(b'\n')
    done = checkout.run('clean')
    assert done.returncode == 0 and '.venv-mine stays: it was not made here' in done.stderr
    assert not (checkout.top / '.venv').exists() and (checkout.top / '.venv-mine').exists()
