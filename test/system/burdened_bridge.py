# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The executable ``drive_can_bridge`` with a middleware that has trouble with requests, on demand.

What trouble the file TROUBLE names: ``sleep``, ``throw`` (std::bad_alloc), ``fill`` (all memory
that there is). It concerns the next request of ``get_parameters`` of a drive; the file is gone as
soon as that has begun, and memory is full. The first and the last one go on until something comes
from the FIFO TROUBLE.over: only a hang takes too long. No request does any of this here: the
function that takes them does it instead of one of rcl's.
"""

import ctypes
import os
from pathlib import Path
import sys
import threading
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation

from drive_can_bridge.ros.main import main
from drive_can_bridge.ros.rcl.services import RclServices

#: bytes of blocks: whatever is free, to the last
SIZES = 1 << 24, 1 << 20, 1 << 17, 1 << 14, 1 << 10, 1 << 7, 24
BLOCKS_MAX = 1_000_000

_trouble = Path(os.environ['TROUBLE'])
_path = os.fsencode(_trouble)
_over = os.open(f'{_trouble}.over', os.O_RDONLY)
_byte = ctypes.create_string_buffer(1)
_local = threading.local()
_libc = ctypes.CDLL(None)
_libc.malloc.restype, _libc.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
_libc.free.restype, _libc.free.argtypes = None, [ctypes.c_void_p]
_libc.read.restype = ctypes.c_ssize_t
_libc.read.argtypes = [ctypes.c_int, ctypes.c_char_p, ctypes.c_size_t]
_throw = ctypes.CDLL(rclpy_implementation.__file__)._ZSt17__throw_bad_allocv
_blocks = (ctypes.c_void_p * BLOCKS_MAX)()


def last() -> None:
    """Go on until somebody says that it is over: one call of C, which needs no memory."""
    _libc.read(_over, _byte, 1)


def fill() -> None:
    """Take all memory, and give it back when that is over."""
    count = 0
    for size in SIZES:
        while count < BLOCKS_MAX:
            block = _libc.malloc(size)
            if not block:
                break
            _blocks[count] = block
            count += 1
    _libc.unlink(_path)
    last()
    for place in range(count):
        _libc.free(_blocks[place])
    print(f'filled with {count} blocks', file=sys.stderr, flush=True)


def _take_troubled(take: Any) -> Any:
    begun: list[str] = []

    def troubled(*arguments: Any) -> Any:
        if not begun and _local.service.endswith('/conveyor/get_parameters') and (
                _trouble.exists()):
            begun.append(_trouble.read_text(encoding='ascii'))
            if begun == ['fill']:
                fill()
            else:
                _trouble.unlink()
                if begun == ['throw']:
                    _throw()
                last()
        return take(*arguments)
    return troubled


_init, _take = RclServices.__init__, RclServices.take


def _initialised(self: RclServices) -> None:
    _init(self)
    self._take = _take_troubled(self._take)


def _named(self: RclServices, service: Any, lost: Any) -> Any:
    _local.service = service.service_name
    return _take(self, service, lost)


RclServices.__init__ = _initialised   # type: ignore[method-assign]
RclServices.take = _named  # type: ignore[method-assign]

if __name__ == '__main__':
    sys.exit(main())
