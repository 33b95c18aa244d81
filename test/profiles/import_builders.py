# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Files to import, and what became of them."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.profiles.catalogue import check
from drive_can_bridge.profiles.importing import columns_from_option, import_file, Imported
from drive_can_bridge.profiles.numerals import DecimalSign


class Outcome(NamedTuple):
    """A profile made from a file, as a bridge reads it."""

    profile: Profile
    imported: Imported

    @property
    def parameters(self) -> dict[str, Parameter]:
        return self.profile.parameters

    @property
    def left_out(self) -> list[str]:
        return [str(each) for each in self.imported.found.left_out]

    @property
    def oddities(self) -> list[str]:
        return [str(each) for each in self.imported.found.oddities]


def bring_in(folder: Path, content: str | bytes, name: str = 'table.csv', *, columns: str = '',
             protocols: Sequence[str] = (), sign: DecimalSign = DecimalSign.UNKNOWN) -> Outcome:
    """Import a file; what comes out has to pass ``profile check``."""
    source = folder / name
    source.write_bytes(content.encode('utf-8') if isinstance(content, str) else content)
    imported = import_file(source, columns=columns_from_option(columns), sign=sign,
                           protocols=protocols)
    made = folder / 'made.yaml'
    made.write_text(imported.built.text, encoding='utf-8')
    checked = check(made)
    assert [str(problem) for problem in (*checked.problems, *checked.warnings)] == []
    assert tuple(checked.loaded.profile.parameters) == imported.built.names
    return Outcome(checked.loaded.profile, imported)
