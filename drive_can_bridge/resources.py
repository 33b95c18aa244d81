# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The files of the package: profiles, examples, launch files; and how to install its extras.

They are found in a source checkout (also when installed with ``pip install -e`` or
``colcon build --symlink-install``), in a ROS 2 workspace or distribution, and in whatever prefix
pip installed into, virtual environment or not.
"""

from collections.abc import Iterator
from pathlib import Path
import shlex
import sys

_PACKAGE = 'drive_can_bridge'
_NO_ROS = ('{command}: needs ROS 2 (Python module {module}): source your installation '
           "(/opt/ros/jazzy/setup.bash), or get it as wheels with the extra 'ros' of this package "
           "(pip install '.[ros]')")


def share_directory() -> Path:
    """
    Return the directory that holds ``config`` and ``launch``.

    :raises FileNotFoundError: when there is none; the message names the places.
    """
    candidates = list(_candidates())
    for candidate in candidates:
        if (candidate / 'config' / 'profiles').is_dir():
            return candidate
    places = ', '.join(dict.fromkeys(str(candidate) for candidate in candidates))
    raise FileNotFoundError(f'no config/profiles of {_PACKAGE} in any of: {places}')


def profiles_directory() -> Path:
    """Return the directory of the shipped profiles."""
    return share_directory() / 'config' / 'profiles'


def config_file(name: str) -> Path:
    """
    Return the path of a shipped configuration file.

    :param name: file name below ``config``, with its suffix.
    :raises FileNotFoundError: when there is none; the message names those that exist.
    """
    directory = share_directory() / 'config'
    path = directory / name
    if not path.is_file():
        present = ', '.join(sorted(file.name for file in directory.glob('*.yaml'))) or 'none'
        raise FileNotFoundError(f'no {name} in {directory}, which has: {present}')
    return path


def command_that_brings(extra: str) -> str:
    """Return the command that installs the Python packages of an extra."""
    from importlib.metadata import PackageNotFoundError, requires
    try:
        entries = [entry.partition(';') for entry in requires(_PACKAGE) or ()]
    except PackageNotFoundError:    # sources, not installed
        entries = []
    needed = [entry.strip() for entry, _, condition in entries
              if condition.strip().endswith((f"'{extra}'", f'"{extra}"'))]
    return shlex.join([sys.executable, '-m', 'pip', 'install',
                       *(needed or [f'{_PACKAGE}[{extra}]'])])


def what_is_missing(command: str, error: ImportError) -> str:
    """Return what to install where a module cannot be imported."""
    module = error.name or str(error)
    if module.startswith('drive_can_bridge'):
        return f'{command}: {error}'
    if module.partition('.')[0] in ('can', 'yaml', 'jsonschema'):
        return f'{command}: the Python module {module} is not installed'
    return _NO_ROS.format(command=command, module=module)


def _candidates() -> Iterator[Path]:
    """Yield the possible share directories, nearest to this very module first."""
    module = Path(__file__).resolve()
    checkout = module.parent.parent
    if (checkout / 'package.xml').is_file():
        yield checkout
    # <prefix>/lib/pythonX.Y/site-packages/drive_can_bridge/resources.py: the prefix of this copy
    # of the package, whatever else is installed.
    for parent in module.parents[2:]:
        share = parent / 'share' / _PACKAGE
        if share.is_dir():
            yield share
            break
    indexed = _indexed_share_directory()
    if indexed is not None:
        yield indexed
    yield Path(sys.prefix) / 'share' / _PACKAGE


def _indexed_share_directory() -> Path | None:
    """Ask the ament index, if there is one and it knows the package."""
    try:
        from ament_index_python.packages import get_package_share_directory
    except ImportError:
        return None
    try:
        return Path(get_package_share_directory(_PACKAGE))
    except (LookupError, OSError):
        return None
