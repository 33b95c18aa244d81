# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Which bridges a command may treat as one: the same rules for ROS and for the local way."""

from collections.abc import Callable, Iterable, Mapping, Sequence

from drive_can_bridge.core import sentences
from drive_can_bridge.core.errors import DriveCanError, WhichBridge
from drive_can_bridge.host_texts import is_pattern


class UnknownDrive(DriveCanError):
    """A word is the name of no drive."""


def stand_apart(names: Sequence[str]) -> str:
    """Return why bridges cannot be treated as one; '' if they can."""
    if len({name.rpartition('/')[0] for name in names}) > 1:
        return sentences.several_bridges(names)
    twice = next((name for name in names if names.count(name) > 1), '')
    return twice and sentences.bridges_of_one_name(names.count(twice), twice)


def must_stand_together(names: Sequence[str]) -> None:
    """
    Check that bridges are in one namespace, each with a name of its own.

    :raises WhichBridge: they are not.
    """
    why = stand_apart(names)
    if why:
        raise WhichBridge(why)


def bridges_of(drives: Mapping[str, Iterable[str]]) -> dict[str, str]:
    """
    Return the full name of the bridge of each drive.

    :param drives: names of drives, by the full name of their bridge.
    :raises WhichBridge: two have a drive of one name.
    """
    found: dict[str, str] = {}
    for bridge, names in drives.items():
        for name in names:
            if name in found:
                raise WhichBridge(sentences.drive_of_two_bridges(
                    one=found[name], other=bridge, drive=name))
            found[name] = bridge
    return found


def chosen_drives(words: Sequence[str], namespace: str | None,
                  known: Callable[[str | None], Sequence[str]],
                  matches: Callable[[str, str], bool]) -> list[str]:
    """
    Return the full names of the drives that words mean.

    :param words: names, patterns or full names; a full name says which bridge is meant.
    :param known: returns the full names of all drives in a namespace, or in those of a pattern;
        None: in the only one.
    :param matches: returns whether a word means a drive.
    :raises UnknownDrive: a word names none.
    """
    nodes: dict[str, None] = {}
    looked: dict[str | None, Sequence[str]] = {}
    for word in words:
        place = word.rpartition('/')[0] if word.startswith('/') else namespace
        if place not in looked:
            looked[place] = known(place)
        found = [node for node in looked[place] if matches(word, node)]
        if not found:
            there = ', '.join(node.lstrip('/') for node in looked[place])
            raise UnknownDrive(sentences.no_drive_there(drive=repr(word), there=there))
        nodes.update(dict.fromkeys(found))
    return list(nodes)


def is_some(namespace: str | None) -> bool:
    """Return whether it is a pattern of namespaces."""
    return bool(namespace) and is_pattern(namespace or '')
