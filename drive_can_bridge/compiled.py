# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a class says to the compiler (setup.py has which modules may be compiled)."""

from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mypy_extensions import mypyc_attr as mypyc_attr
else:
    def mypyc_attr(**_):
        """Return the class as it is: only the compiler reads this."""
        return lambda it: it


def build() -> str:
    """Return what runs here: ``compiled`` or ``pure Python``."""
    # looked for by name: finding it as a module would import all of core
    beside = Path(__file__).parent / 'core' / 'frame'
    compiled = any(Path(f'{beside}{suffix}').is_file() for suffix in EXTENSION_SUFFIXES)
    return 'compiled' if compiled else 'pure Python'
