# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which profiles the Fast DDS of this process reads, and ours for it.

Fast DDS 2 and 3 read another variable and another file of the working directory, and use other
words: a file with one word of the other version is refused whole. What is not read is ignored
in silence, which with TLS means that every node gets in. Which version runs is seen in what this
process has loaded.

To be used before ``rclpy.init``, in a process where rclpy has loaded its middleware.
"""

from collections.abc import Iterator, Mapping, MutableMapping
from dataclasses import dataclass
from pathlib import Path
import re

#: what a process has loaded
MAPS = Path('/proc/self/maps')
#: the names in a profile that protects: how ``drive_can security`` calls transport and participant
MARK = b'drive_can_tls'
#: a profile has some thousand bytes; looked at is no more than this
_SIZE_MAX = 1 << 20
_LIBRARY = re.compile(r'/libfast(?:rtps|dds)(?:-\w+)?\.so\.(\d+)\.(\d+)')
#: the adapter of ROS, which hands files on to Fast DDS by itself
_ADAPTER = re.compile(r'(/\S*/librmw_fastrtps_shared_cpp\S*\.so\S*)')
_OTHERS = {'rmw_cyclonedds_cpp': 'Cyclone DDS', 'rmw_connextdds': 'Connext DDS',
           'rmw_zenoh_cpp': 'Zenoh'}


@dataclass(frozen=True, slots=True)
class Release:
    """
    The profile settings that one major version reads.

    :ivar variable: with the name of a file.
    :ivar file: that it takes from the working directory.
    :ivar shipped: our profile for it, below ``config``.
    """

    variable: str
    file: str
    shipped: str


RELEASES = {
    2: Release('FASTRTPS_DEFAULT_PROFILES_FILE', 'DEFAULT_FASTRTPS_PROFILES.xml',
               'fastdds/fast_dds_2.xml'),
    3: Release('FASTDDS_DEFAULT_PROFILES_FILE', 'DEFAULT_FASTDDS_PROFILES.xml',
               'fastdds/fast_dds_3.xml')}


@dataclass(frozen=True, slots=True)
class IgnoredProfiles:
    """
    Profiles that the user has set, and that are not read.

    :ivar name: the variable, or the file in the working directory.
    :ivar file: which one that is.
    :ivar instead: the variable or name that would be read; '' if none is.
    :ivar protects: whether it is one of ``drive_can security``.
    """

    name: str
    file: str
    instead: str
    protects: bool


@dataclass(frozen=True, slots=True)
class Middleware:
    """
    The middleware of this process.

    :ivar name: ``Fast DDS 2.14``.
    :ivar release: what it reads; None: nothing of this.
    :ivar also: variables that are read besides.
    """

    name: str
    release: Release | None = None
    also: tuple[str, ...] = ()

    @property
    def variables(self) -> tuple[str, ...]:
        """The variables that are in effect."""
        return self.also if self.release is None else (self.release.variable, *self.also)

    def ignored(self, environment: Mapping[str, str], folder: Path) -> Iterator[IgnoredProfiles]:
        """Yield what is set, or lies in the working directory, and is not in effect."""
        read = {Path(folder, environment[name]) for name in self.variables
                if environment.get(name)}
        for release in RELEASES.values():
            named = environment.get(release.variable, '')
            if named and release.variable not in self.variables and (
                    Path(folder, named) not in read):
                yield IgnoredProfiles(release.variable, named,
                                      self.release.variable if self.release else '',
                                      _protects(Path(folder, named)))
            if release is not self.release and Path(folder, release.file).is_file():
                yield IgnoredProfiles(release.file, release.file,
                                      self.release.file if self.release else '',
                                      _protects(Path(folder, release.file)))

    def has_profiles(self, environment: Mapping[str, str], folder: Path) -> bool:
        """Return whether the user has profiles of their own, which are in effect."""
        return self.release is not None and (
            any(environment.get(name) for name in self.variables)
            or Path(folder, self.release.file).exists())

    def missing(self, environment: Mapping[str, str], folder: Path) -> Iterator[tuple[str, str]]:
        """Yield variables in effect whose file is missing, and the file."""
        for name in self.variables:
            named = environment.get(name, '')
            if named and not Path(folder, named).is_file():
                yield name, named

    def use(self, profiles: Path, environment: MutableMapping[str, str]) -> None:
        """Set the profiles file for it."""
        if self.release is not None:
            environment[self.release.variable] = str(profiles)


def running(identifier: str, maps: Path = MAPS) -> Middleware:
    """
    Return the middleware that this process has loaded.

    :param identifier: of the middleware, from rclpy.
    """
    if 'fastrtps' not in identifier:
        return Middleware(_OTHERS.get(identifier, identifier))
    try:
        loaded = maps.read_text(encoding='utf-8', errors='replace')
    except OSError:     # not on Linux
        loaded = ''
    found = _LIBRARY.search(loaded)
    if found is None:
        # the version is unknown: nothing is claimed, and our profiles cannot be used
        return Middleware('Fast DDS', None, tuple(
            release.variable for release in RELEASES.values()))
    release = RELEASES.get(int(found[1]), RELEASES[max(RELEASES)])
    adapter = _ADAPTER.search(loaded)
    text = _content(Path(adapter[1])) if adapter is not None else b''
    return Middleware(f'Fast DDS {found[1]}.{found[2]}', release, tuple(
        each.variable for each in RELEASES.values()
        if each is not release and each.variable.encode() in text))


def _protects(path: Path) -> bool:
    return MARK in _content(path)


def _content(path: Path) -> bytes:
    """Return the beginning of a file; empty where there is none."""
    try:
        if not path.is_file():  # a pipe would be waited for
            return b''
        with path.open('rb') as file:
            return file.read(_SIZE_MAX)
    except OSError:
        return b''
