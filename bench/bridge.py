# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The bridge as the executable runs it, on the bus of the benches.

Started with a parameter file, and what else ROS is to be told; with the word "ordinary" before it
no thread gets real-time priority, with "stuck" nobody reads standard error. Prints when (steady
clock, s) everything was imported and the bridge began; asked for ``cpu``, the CPU time of its
threads by what they do.
"""

import os
import signal
import sys
import threading
import time
from typing import NoReturn

from child import serve
import rclpy  # noqa: F401  so that what is measured begins behind the imports, as with the others
import topics  # noqa: F401  sets the environment of rclpy
from unix_bus import register

from drive_can_bridge.ros.start import main as run

#: how the names of threads begin, and what becomes of their CPU time; all others: services
KINDS = {'exchange ': 'timer', 'bus ': 'reader'}


def cpu() -> dict[str, float]:
    """Return the CPU time of the threads of Python in s."""
    found = {'timer': 0.0, 'reader': 0.0, 'services': 0.0}
    for thread in threading.enumerate():
        if thread not in (threading.main_thread(), threading.current_thread()):
            assert thread.ident is not None
            kind = next((kind for start, kind in KINDS.items() if thread.name.startswith(start)),
                        'services')
            found[kind] += time.clock_gettime(time.pthread_getcpuclockid(thread.ident))
    return found


def be_ordinary() -> None:
    """Let nobody in this process have real-time priority."""
    def refuse(*_: object) -> NoReturn:
        raise PermissionError('no real-time priority: so asked for')
    os.sched_setscheduler = refuse


def be_stuck() -> None:
    """Make standard error a pipe that is full, and that nobody reads."""
    _, write = os.pipe()
    os.set_blocking(write, False)
    try:
        while True:
            os.write(write, bytes(1))
    except BlockingIOError:
        os.set_blocking(write, True)
    os.dup2(write, 2)


def end() -> NoReturn:
    """Have the bridge end as it does on a signal."""
    os.kill(os.getpid(), signal.SIGTERM)
    threading.Event().wait()
    raise AssertionError


def main() -> None:
    """Obey."""
    words = sys.argv[1:]
    level = 'info' if 'stuck' in words else 'error'
    for word, become in (('ordinary', be_ordinary), ('stuck', be_stuck)):
        if word in words:
            words.remove(word)
            become()
    register()
    sys.argv[1:] = ['--ros-args', '--log-level', level, '--params-file', *words]
    threading.Thread(target=serve, args=({'cpu': cpu}, time.monotonic()),
                     kwargs={'close': end}, daemon=True).start()
    sys.exit(run())


if __name__ == '__main__':
    main()
