# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Files to import, and what became of them."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from drive_can_bridge.cli.profile import columns_from_option, import_file
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.profiles.catalogue import Built, check


class Outcome(NamedTuple):
    """A profile made from a file, as a bridge reads it."""

    profile: Profile
    built: Built

    @property
    def parameters(self) -> dict[str, Parameter]:
        return self.profile.parameters

    @property
    def left_out(self) -> list[str]:
        return [str(each) for each in self.built.left_out]

    @property
    def notes(self) -> list[str]:
        return list(self.built.notes)


def told(made: Outcome) -> str:
    """Return what an import says of its file, a line each."""
    return ''.join(f'{line}\n' for line in (*made.left_out, *made.notes))


def bring_in(folder: Path, content: str | bytes, name: str = 'table.csv', *, columns: str = '',
             protocols: Sequence[str] = (), sign: str = '', axis: int | None = None,
             force: bool = False) -> Outcome:
    """Import a file; what comes out has to pass ``profile check``."""
    source = folder / name
    source.write_bytes(content.encode('utf-8') if isinstance(content, str) else content)
    built = import_file(source, columns=columns_from_option(columns), sign=sign,
                        protocols=protocols, axis=axis, force=force)
    made = folder / 'made.yaml'
    made.write_text(built.text, encoding='utf-8')
    checked = check(made)
    assert [str(problem) for problem in (*checked.problems, *checked.warnings)] == []
    assert tuple(checked.loaded.profile.parameters) == built.names
    return Outcome(checked.loaded.profile, built)
