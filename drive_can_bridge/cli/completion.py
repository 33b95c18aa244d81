# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the words of a command may be: drives and parameters, of a file or of a running bridge."""

from argparse import Namespace
from collections.abc import Callable, Iterable
from contextlib import closing
from typing import Any

from drive_can_bridge.cli.drives import matching
from drive_can_bridge.client.drive import Source
from drive_can_bridge.client.opening import find_source


def complete_words(prefix: str, parsed_args: Namespace, **_: Any) -> list[str]:
    """Propose drives for the first word, and names of their parameters after it."""
    def proposed(source: Source) -> list[str]:
        names = list(source.names)
        words = [word for word in parsed_args.words or () if word != prefix]
        drives = matching(names, words[0]) if words else []
        end = '=' if parsed_args.subcommand == 'write' else ''
        return ([] if words else names) + [
            f'{name}{end}' for drive in drives or (names if len(names) == 1 else [])
            for name in source.parameter_names(drive)]
    return _completed(parsed_args, proposed)


def complete_drives(prefix: str, parsed_args: Namespace, **_: Any) -> list[str]:
    """Propose drives; where none begins so, the shell proposes files."""
    return _completed(parsed_args, lambda source: source.names)


def _completed(args: Namespace, proposed: Callable[[Source], Iterable[str]]) -> list[str]:
    try:
        with closing(find_source(getattr(args, 'params_file', None),
                                 namespace=getattr(args, 'namespace', None))) as source:
            return list(proposed(source))
    except Exception:  # noqa: BLE001  nothing may be written into the line that is typed
        return []
