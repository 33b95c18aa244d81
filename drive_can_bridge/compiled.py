# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a class says to the compiler (setup.py has which modules may be compiled)."""

from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mypy_extensions import mypyc_attr as mypyc_attr
else:
    def mypyc_attr(**_):
        """Return the class as it is: only the compiler reads this."""
        return lambda it: it


def build() -> str:
    """Return what runs here: ``compiled`` or ``pure Python``."""
    found = find_spec('drive_can_bridge.core.frame')
    compiled = found is not None and str(found.origin).endswith(tuple(EXTENSION_SUFFIXES))
    return 'compiled' if compiled else 'pure Python'
