# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the words of a command may be: drives and parameters, of a file or of a running bridge."""

from argparse import Namespace
from typing import Any

from drive_can_bridge.cli.drives import matching
from drive_can_bridge.client.opening import find_source


def complete_words(prefix: str, parsed_args: Namespace, **_: Any) -> list[str]:
    """Propose drives for the first word, and names of their parameters after it."""
    try:
        source = find_source(getattr(parsed_args, 'params_file', None),
                             namespace=getattr(parsed_args, 'namespace', None))
        try:
            names = list(source.names)
            words = [word for word in parsed_args.words or () if word != prefix]
            drives = matching(names, words[0]) if words else []
            found = [] if words else names
            for drive in drives or (names if len(names) == 1 else []):
                listed = source.parameter_names(drive)
                found += [f'{name}=' for name in listed] \
                    if parsed_args.subcommand == 'write' else listed
        finally:
            source.close()
    except Exception:  # noqa: BLE001  nothing may be written into the line that is typed
        return []
    return found


def complete_drives(prefix: str, parsed_args: Namespace, **_: Any) -> list[str]:
    """Propose drives; where none begins so, the shell proposes files."""
    try:
        source = find_source(getattr(parsed_args, 'params_file', None),
                             namespace=getattr(parsed_args, 'namespace', None))
        try:
            return list(source.names)
        finally:
            source.close()
    except Exception:  # noqa: BLE001  nothing may be written into the line that is typed
        return []
