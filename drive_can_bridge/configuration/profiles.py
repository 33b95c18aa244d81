# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Find and read profiles.

``profile:`` is a name that is looked up as NAME.yaml, an absolute path, or a path that is relative
to the parameter file that sets it.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
import hashlib
import os
from pathlib import Path as FilePath
import stat

from drive_can_bridge.configuration.parameter_file import PARAMETERS_KEY
from drive_can_bridge.configuration.problems import Problem, Tree
from drive_can_bridge.configuration.profile_check import LoadedProfile, profile_from_tree
from drive_can_bridge.configuration.yaml_nodes import (
    BrokenYaml, NodeKind, read_documents, Rules, TreeReader)
from drive_can_bridge.core import complaints
from drive_can_bridge.core.complaints import suggestion
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.resources import profiles_directory

SUFFIX = '.yaml'


#: returns the directory of the file that sets the profile of a drive to a value; None: no file
Setter = Callable[[str, str], FilePath | None]


def place_profiles(tree: Tree, directory_of: Setter) -> None:
    """Make the relative paths of profiles in a tree absolute, or record why that is impossible."""
    drives = tree.data.get('drives')
    for name, drive in drives.items() if isinstance(drives, dict) else ():
        profile = drive.get('profile') if isinstance(drive, dict) else None
        if not isinstance(profile, str) or '/' not in profile or os.path.isabs(profile):
            continue
        directory = directory_of(name, profile)
        meant = os.path.abspath(os.path.join(directory or '', profile))
        if directory is None:
            tree.wrong(('drives', name, 'profile'), complaints.no_absolute_path(
                name=profile, meant=meant))
        elif _everybody_writes(directory):
            tree.wrong(('drives', name, 'profile'), complaints.open_directory(
                name=profile, meant=meant))
        else:
            drive['profile'] = meant
            continue
        tree.cut(('drives', name, 'profile'))


def _everybody_writes(directory: FilePath) -> bool:
    try:
        return bool(os.stat(directory).st_mode & stat.S_IWOTH)
    except OSError:
        return False    # it is gone: nothing will be found there


class ProfileStore:
    """
    The profiles of one configuration; each file is read once.

    :param directories: searched in order, before the directory shipped with the package; empty
        entries are ignored.
    """

    def __init__(self, directories: Sequence[str]) -> None:
        self._directories = [FilePath(entry) for entry in directories if entry]
        try:
            self._directories.append(profiles_directory())
        except FileNotFoundError:
            # An incomplete installation; profiles given by path still work.
            pass
        self._loaded: dict[FilePath, LoadedProfile] = {}

    @property
    def trees(self) -> list[Tree]:
        """The profiles read so far, with what was found in them."""
        return [loaded.tree for loaded in self._loaded.values()]

    def load(self, name: str) -> LoadedProfile | Sentence:
        """
        Return a profile, or why there is none.

        A profile that was found is returned even when it has problems: see ``trees``.
        """
        path = self._find(name)
        if isinstance(path, str):
            return path
        if path not in self._loaded:
            try:
                self._loaded[path] = _with_digest(read_profile(path), path)
            except OSError as error:
                return complaints.cannot_be_read(path=path, why=error.strerror)
        return self._loaded[path]

    def _find(self, name: str) -> FilePath | Sentence:
        if '/' in name:
            path = FilePath(name)
            return path if _is_file(path) else complaints.no_file(name=name)
        for directory in self._directories:
            path = directory / f'{name}{SUFFIX}'
            if _is_file(path):
                return path
            if os.path.exists(path):    # a pipe, say: its contents are not waited for
                return complaints.cannot_be_read(path=path, why='not a regular file')
        if name.endswith(SUFFIX):
            return complaints.name_with_suffix(name=name, suffix=SUFFIX)
        known = sorted({path.stem for directory in self._directories if os.path.isdir(directory)
                        for path in directory.glob(f'*{SUFFIX}')})
        places = ', '.join(map(str, self._directories)) or 'no directory'
        hint = suggestion(name, known) if known else complaints.no_profile_at_all()
        if name.lower().endswith(('.eds', '.dcf')):
            hint = complaints.to_be_imported(name=name)
        return complaints.unknown_profile(name=name, hint=hint, places=places)


def _with_digest(loaded: LoadedProfile, path: FilePath) -> LoadedProfile:
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return replace(loaded, profile=replace(loaded.profile, sha256=digest))


def _is_file(path: FilePath) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_profile(path: FilePath) -> LoadedProfile:
    """
    Read a profile file.

    :raises OSError: the file cannot be read.
    """
    file = str(path)
    try:
        documents = read_documents(path)
    except BrokenYaml as error:
        return _unusable(file, error.line, error.why)
    if not documents or documents[0].root.kind is not NodeKind.MAPPING:
        return _unusable(file, 1, complaints.no_profile())
    root = documents[0].root
    if any(below.text == PARAMETERS_KEY for _, value in root.pairs for below, _ in value.pairs):
        return _unusable(file, root.line, complaints.is_parameter_file())
    reader = TreeReader(file, Rules.PROFILE)
    reader.read(root)
    tree = reader.tree
    tree.problems[:0] = reader.refused
    if len(documents) > 1:
        tree.problems.append(
            Problem(file, documents[1].line, 'yaml', complaints.second_document()))
    return profile_from_tree(tree)


def _unusable(file: str, line: int, message: Sentence) -> LoadedProfile:
    tree = Tree({}, file, damaged={()})
    loaded = profile_from_tree(tree)
    # what follows from a file that could not be read is not worth mentioning
    tree.problems[:] = [Problem(file, line, 'yaml', message)]
    return loaded
