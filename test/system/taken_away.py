# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Runs a program of this package that finds less in rclpy than there is.

``taken_away.py WHAT,… MODULE [ARGUMENT...]``. WHAT is a member of rclpy's extension, as this
package sees it; ``rcl``: its library has no function of rcl; ``extension``: there is none at all;
``MODULE:CLASS.NAME``: of a class of rclpy; ``MODULE:CLASS().NAME``: of its objects.
"""

from collections.abc import Callable, Collection
from importlib import import_module
import runpy
import sys
from typing import Any


def main() -> None:
    """Take it away, and run the program."""
    names, module = sys.argv[1].split(','), sys.argv[2]
    sys.argv[1:] = sys.argv[3:]
    if 'extension' in names:
        hide_extension()
    for name in names:
        where, _, what = name.partition(':')
        if what:
            of_class(import_module(where), what)
    members = {name for name in names if ':' not in name} - {'extension'}
    if members:
        of_extension(members)
    runpy.run_module(module, run_name='__main__', alter_sys=True)


def hide_extension() -> None:
    """Have it be where nobody but rclpy looks."""
    name: Any = 'rclpy.impl.implementation_singleton'
    found = import_module(name)
    sys.modules[name] = None    # type: ignore[assignment]
    import_module('drive_can_bridge.ros.rcl.extension')
    sys.modules[name] = found


def of_extension(members: Collection[str]) -> None:
    """Have this package not find members of the extension."""
    from drive_can_bridge.ros.rcl.extension import Extension
    find: Callable[[Extension, str], Any] = Extension.__getattr__

    def found(extension: Extension, name: str) -> Any:
        if name in members:
            raise AttributeError(name)
        if name == '__file__' and 'rcl' in members:
            return None     # this program, which is Python
        return find(extension, name)
    Extension.__getattr__ = found   # type: ignore[method-assign]


def of_class(module: Any, what: str) -> None:
    """Take something from a class, or from each of its objects once it is made."""
    owner, _, name = what.partition('.')
    kind = getattr(module, owner.removesuffix('()'))
    if not owner.endswith('()'):
        delattr(kind, name)
        return
    begin = kind.__init__

    def begun(made: Any, *arguments: Any, **options: Any) -> None:
        begin(made, *arguments, **options)
        vars(made)[f'{name}_of_another_version'] = vars(made).pop(name)
    kind.__init__ = begun


if __name__ == '__main__':
    main()
