# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Build script of the ROS 2 package (ament_python), usable with plain pip too.

All meta data stands here, because colcon reads it from here. ``setup.cfg`` only tells where
``ros2 run`` looks for executables.

With DRIVE_CAN_COMPILED=1 in the environment what is installed has a library beside each module of
:data:`COMPILED`, which Python takes instead of it (docs/performance.md). Compiled by mypyc, all of
them or none, and never into a checkout.
"""

from importlib.machinery import EXTENSION_SUFFIXES
import os
from pathlib import Path
import re
import shutil
import sys
import sysconfig
from tempfile import TemporaryDirectory

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.install_lib import install_lib
from setuptools.errors import BaseError, SetupError

PACKAGE = 'drive_can_bridge'
HERE = Path(__file__).parent
#: the one builder that it is tried with
BUILDER = 'mypy==2.4.1'
#: whether an environment is made for this build, with what it asks for
BY_PIP = 'setuptools.build_meta' in sys.modules
#: what each frame or cycle runs through; the rest is not worth it, and stays Python
COMPILED = {
    'core/command_age': 'each look at the commands that wait',
    'core/command_interlock': 'each cycle and sample: whether commands reach the drive',
    'core/control_machine': 'each cycle: the control word; each status word',
    'core/drive_services': 'each command and request',
    'core/fault_watch': 'each sample: whether the drive has a fault',
    'core/frame': 'what all of them hand on',
    'core/holding': 'each command: a setpoint',
    'core/neutral_stop': 'each answer: whether a stop waits for it',
    'core/outbox': 'each frame that is sent',
    'core/process_image': 'each cycle: what was sent last',
    'core/reporter': 'each sample: the list of events',
    'core/session': 'each frame and each time that something is due',
    'core/setpoints': 'each cycle: expiry; each command',
    'core/statistics': 'two samples in each exchange',
    'core/stop_duty': 'each frame that is sent, each answer',
    'exchange/exchange': 'the threads of a bus: each frame, each pass',
    'exchange/member': 'each frame and each timer: sending and telling',
    'protocols/acyclic_output': 'each answer to a cycle: whether a word has its setpoints',
    'protocols/answers': 'each answer to a cycle',
    'protocols/channel': 'each pass: whether a request is due',
    'protocols/cyclic_exchange': 'each cycle',
    'protocols/datamodel/extended_session': 'the family with the most drives on a bus',
    'protocols/datamodel/process_words': 'each of its telegrams',
    'protocols/exchange_book': 'each cycle and each answer: when the next is due',
    'protocols/lifecycle': 'each pass: whether the script of a drive is due',
    'ros/commands': 'each command',
    'ros/drive_node': 'each sample and each command',
    'ros/polled_topics': 'each cycle: what waits on command topics',
    'ros/prepared': 'each message that is published as bytes',
    'ros/samples': 'each sample',
    'ros/stamps': 'the stamp of each sample',
    'transport/end_point': 'what a port is made of',
    'transport/link': 'each frame that is received or sent',
    'transport/port': 'likewise',
    'transport/raw_socket': 'each frame of SocketCAN',
}


def version() -> str:
    """Read the version without importing the package, whose dependencies may be missing yet."""
    text = (HERE / PACKAGE / '__init__.py').read_text(encoding='utf-8')
    match = re.search(r"^__version__ = '([^']+)'$", text, re.MULTILINE)
    if match is None:
        raise RuntimeError(f'no __version__ in {PACKAGE}/__init__.py')
    return match.group(1)


def shared_tree(top: str) -> list[tuple[str, list[str]]]:
    """List every file below a directory, for installation at the same place in the share."""
    folders: dict[str, list[str]] = {}
    for path in sorted((HERE / top).rglob('*')):
        relative = path.relative_to(HERE)
        hidden = any(part.startswith('.') or part == '__pycache__' for part in relative.parts)
        if path.is_file() and not hidden:
            folder = f'share/{PACKAGE}/{relative.parent.as_posix()}'
            folders.setdefault(folder, []).append(relative.as_posix())
    return list(folders.items())


def wheels(rclpy: str, messages: str) -> list[str]:
    """Require the packages of one distribution by their versions."""
    return [f'ros-rclpy[fastrtps]=={rclpy}', *(
        f'ros-{name}-msgs=={messages}' for name in ('diagnostic', 'sensor', 'std')),
        f'ros-std-srvs=={messages}']


def wants_compiled() -> bool:
    """Return whether the environment asks for compiled modules."""
    return os.environ.get('DRIVE_CAN_COMPILED', '') not in ('', '0')


def go_on(problem: str) -> SetupError:
    """Return the error of a build that was asked to compile and cannot: nothing is installed."""
    return SetupError(f'{problem}. Without DRIVE_CAN_COMPILED in the environment it installs as '
                      'pure Python, which does the same and takes more of the processor')


def check_tools(compiler: str) -> None:
    """See whether there is what compiles, before anything is made."""
    try:
        from importlib.metadata import version as installed
        found = f'mypy=={installed("mypy")}'
    except ImportError:     # PackageNotFoundError is one
        found = 'none is installed'
    if found != BUILDER:
        raise go_on(f'DRIVE_CAN_COMPILED is set, and needs {BUILDER} ({found}): '
                    f'{sys.executable} -m pip install {BUILDER}')
    if shutil.which(compiler) is None:
        raise go_on(f'DRIVE_CAN_COMPILED is set, and needs a C compiler, "{compiler}" '
                    '(Debian, Ubuntu: apt install gcc)')
    if not Path(sysconfig.get_path('include'), 'Python.h').is_file():
        raise go_on(f'DRIVE_CAN_COMPILED is set, and needs the headers of {sys.executable} '
                    '(Debian, Ubuntu: apt install python3-dev)')


class CompileModules(build_ext):
    """Compile what :data:`COMPILED` names; all of it, or nothing is installed."""

    def run(self) -> None:
        """Make C of the modules in a folder of its own, and libraries of that."""
        if not self.extensions:     # setup.py develop asks for it in any case
            return
        if self.inplace or getattr(self, 'editable_mode', False):
            raise go_on(
                'DRIVE_CAN_COMPILED is set for an installation that follows this checkout (pip '
                'install -e, colcon build --symlink-install): libraries would stay as they are '
                'beside sources that change. Install without that')
        check_tools((sysconfig.get_config_var('CC') or 'cc').split()[0])
        # of a build before, when other modules were compiled
        remove_libraries(Path(self.build_lib))
        with TemporaryDirectory() as folder:
            try:
                self.distribution.ext_modules = compiled_modules(folder)
                self.distribution.reinitialize_command(self)
                self.ensure_finalized()
                super().run()
            except (BaseError, SystemExit) as error:
                remove_libraries(Path(self.build_lib))
                raise go_on(f'could not compile: {error}') from error


def compiled_modules(folder: str) -> list[Extension]:
    """Return what is to be built; its sources are in ``folder``."""
    from mypyc.build import mypycify
    asked = re.search(r'-O(\d)', os.environ.get('CFLAGS', ''))     # 0 compiles soonest
    modules = list(mypycify(
        [
            # no settings, and no package that is here by chance: the same code everywhere
            '--config-file=', '--no-site-packages', '--ignore-missing-imports',
            f'--cache-dir={folder}/cache',
            *(f'{PACKAGE}/{module}.py' for module in COMPILED),
        ],
        target_dir=folder, group_name=PACKAGE, debug_level='0',
        opt_level=asked[1] if asked else '2'))
    for module in modules:      # what -Wall says of generated C concerns nobody, and takes longest
        module.extra_compile_args.append('-Wno-all')
    return modules


def remove_libraries(folder: Path) -> None:
    """Remove all compiled modules in a folder into which something is installed."""
    for suffix in EXTENSION_SUFFIXES:
        # what all of them consist of stands beside the package
        for library in [*(folder / PACKAGE).rglob(f'*{suffix}'),
                        *folder.glob(f'{PACKAGE}__mypyc*{suffix}')]:
            library.unlink()


class InstallLibrary(install_lib):
    """Install; no library of before may be left beside a source that has changed."""

    def install(self) -> 'list[str]':
        """Copy what was built."""
        remove_libraries(Path(self.install_dir))
        return list(super().install() or ())


setup(
    name=PACKAGE,
    version=version(),
    description='Bridge motor drives on CAN buses to ROS 2',
    url='https://drive-can-bridge.invalid',
    license='Apache-2.0',
    author='the drive_can_bridge authors',
    maintainer='the drive_can_bridge authors',
    maintainer_email='maintainers@drive-can-bridge.invalid',
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={
        PACKAGE: ['py.typed'],
        f'{PACKAGE}.configuration': ['schemas/*.json'],
        f'{PACKAGE}.panel': ['static/*'],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        # colcon.pkg names the environment hooks to colcon, package.dsv to other installations.
        (f'share/{PACKAGE}', ['package.xml', 'resource/package.dsv']),
        (f'share/{PACKAGE}/environment', [
            'resource/environment/path.dsv', 'resource/environment/path.sh']),
        *shared_tree('config'),
        *shared_tree('launch'),
    ],
    zip_safe=False,
    # it only says that there will be some, and so that the wheel is of this machine
    ext_modules=[Extension(f'{PACKAGE}.compiled', [])] if wants_compiled() else [],
    cmdclass={'build_ext': CompileModules, 'install_lib': InstallLibrary},
    # pip has it for the time of the build; colcon has what is installed
    setup_requires=[BUILDER] if wants_compiled() and BY_PIP else [],
    python_requires='>=3.10',
    # rclpy is missing here on purpose: rosdep brings it, and drive_can works without it.
    install_requires=[
        'python-can>=4.3',
        'PyYAML',
        'jsonschema',
        'rich',
        'pyserial',
    ],
    extras_require={
        # ROS 2 as wheels, for machines without a ROS installation: Jazzy, or Kilted.
        'ros': wheels('7.1.6', '5.3.6'),
        'ros-kilted': wheels('9.1.2', '5.5.1'),
        # EDS and DCF files as profiles. No rosdep key: without it, CSV tables can be imported.
        'eds': ['canopen>=2.3'],
        # completion in the shell; rosdep brings it
        'completion': ['argcomplete'],
        # drive_can panel: the drives in a browser. No rosdep key either.
        'panel': ['nicegui>=3,<4'],
        # pictures of drive_can decode --plot; rosdep brings it
        'plot': ['matplotlib'],
        # captures of Wireshark in drive_can decode; rosdep brings it
        'wireshark': ['scapy>=2.5'],
        'test': [
            # No rosdep keys for some of them: the tests run without them, only fewer, or slower.
            'argcomplete',
            'canopen>=2.3',
            'canopen-asyncio==2.4.1',
            'durand==0.5.0',
            'hypothesis',
            'matplotlib',
            BUILDER,
            'pytest',
            'pytest-timeout',
            'scapy>=2.5',
            'setuptools',
            'uc2canopen==0.2.3',
        ],
    },
    entry_points={
        'console_scripts': [
            f'drive_can_bridge = {PACKAGE}.ros.start:main',
            f'drive_can = {PACKAGE}.cli.start:main',
        ],
    },
)
