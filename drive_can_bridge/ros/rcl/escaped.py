# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
C++ exceptions that reach a call by ctypes.

pybind11 makes Python's of them. ctypes has nothing that catches one: the C++ runtime finds no
handler, unwinds nothing, calls what ``std::set_terminate`` was given, and ends the process
(``terminate called after throwing an instance of 'std::bad_alloc'``, SIGABRT; tried with gcc 12).
The handler here keeps a thread that announced itself from that: the thread stays where it is for
ever, and its caller learns why. For all other threads the former handler is called: what
a thread of the middleware has locked by then would never be unlocked.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import ctypes
import threading
from typing import Any

from drive_can_bridge.ros.rcl.unfit import Unfit

_HANDLER = ctypes.CFUNCTYPE(None)
#: by thread, the function to call
_guarded: dict[int, Callable[[str], object]] = {}
_installing = threading.Lock()
#: the handler of this process, kept as long as that lives, and those functions that it needs
_installed: list[Any] = []


def install(library: ctypes.CDLL) -> None:
    """
    Install the handler, once in a process.

    :param library: one that needs the C++ runtime.
    :raises Unfit: that is not to be found.
    """
    with _installing:
        if _installed:
            return
        try:
            set_terminate = library['_ZSt13set_terminatePFvvE']
            current_type = library['__cxa_current_exception_type']
            demangle = library['__cxa_demangle']
        except AttributeError as error:
            raise Unfit(str(error)) from None
        set_terminate.restype, set_terminate.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
        current_type.restype, current_type.argtypes = ctypes.c_void_p, []
        demangle.restype, demangle.argtypes = ctypes.c_char_p, [ctypes.c_char_p, *[
            ctypes.c_void_p] * 3]

        def name() -> str:
            info = current_type()
            if not info:
                return 'no exception'
            # std::type_info: its table of functions, and its name
            mangled = ctypes.c_char_p.from_address(info + ctypes.sizeof(ctypes.c_void_p)).value
            return str((demangle(mangled, None, None, None) or mangled or b'?').decode())

        def handle() -> None:
            tell = _guarded.pop(threading.get_ident(), None)
            if tell is None:
                if former:
                    _HANDLER(former)()
                return  # the runtime ends the process
            tell(name())
            threading.Event().wait()
        handler = _HANDLER(handle)
        former = set_terminate(ctypes.cast(handler, ctypes.c_void_p))
        _installed.extend([library, handler])


@contextmanager
def guarded(tell: Callable[[str], object]) -> Iterator[None]:
    """
    Keep an exception within from ending the process: the thread stays there for ever.

    :param tell: called with what was thrown, in that thread.
    """
    own = threading.get_ident()
    _guarded[own] = tell
    try:
        yield
    finally:
        _guarded.pop(own, None)
