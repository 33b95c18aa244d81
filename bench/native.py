# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The floor in C (``floor.c``): built where a compiler and the headers of ROS are, and run.

It is a library whose ``main`` this process calls and never comes back from: libraries of the
middleware in the wheels want a Python around them. None of it runs meanwhile.
"""

import ctypes
import os
from pathlib import Path
import shutil
import subprocess
import sys

from child import HERE

from drive_can_bridge.ros.main import set_up_fast_dds

_LIBRARIES = ('rcl', 'rcutils', 'rosidl_runtime_c', *(
    f'{package}__rosidl_{part}' for package in ('rcl_interfaces', 'std_msgs')
    for part in ('generator_c', 'typesupport_c')))


class NotBuilt(Exception):
    """Says in words why there is no floor in C."""


def build(folder: Path) -> Path:
    """
    Build the floor into this folder; return the library.

    :raises NotBuilt: there is no compiler, or there are no headers.
    """
    compiler = shutil.which('cc') or shutil.which('gcc')
    if compiler is None:
        raise NotBuilt('no C compiler')
    prefixes = [Path(each) for each in (
        *os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix) if each]
    if not any((prefix / 'include/rcl/rcl/rcl.h').is_file() for prefix in prefixes):
        raise NotBuilt(f'no include/rcl/rcl/rcl.h below {" or ".join(map(str, prefixes))}')
    library = folder / 'floor.so'
    answer = subprocess.run(
        [compiler, '-O2', '-Wall', '-Wextra', '-std=gnu11', '-shared', '-fPIC',
         '-o', library, HERE / 'floor.c',
         *(f'-I{each}' for prefix in prefixes for each in sorted(prefix.glob('include/*'))),
         *(f'-L{prefix / "lib"}' for prefix in prefixes),
         *(f'-l{name}' for name in _LIBRARIES)], text=True, stderr=subprocess.PIPE)
    if answer.returncode:
        raise NotBuilt(f'{compiler} says: {answer.stderr.strip()}')
    return library


def main() -> None:
    """Run the library of the first argument with the others."""
    import rclpy  # noqa: F401  the wheels of ROS set the path of libraries
    set_up_fast_dds()    # the middleware is set up as the bridge's
    words = [each.encode() for each in sys.argv[1:]]
    ctypes.CDLL(sys.argv[1]).main(len(words), (ctypes.c_char_p * len(words))(*words))


if __name__ == '__main__':
    main()
