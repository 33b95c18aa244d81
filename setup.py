# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Build script of the ROS 2 package (ament_python), usable with plain pip too.

All meta data stands here, because colcon reads it from here. ``setup.cfg`` only tells where
``ros2 run`` looks for executables.
"""

from pathlib import Path
import re

from setuptools import find_packages, setup

PACKAGE = 'drive_can_bridge'
HERE = Path(__file__).parent


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
            'mypy',
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
