# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How the threads of the process share the interpreter and the processors."""

import os
import sys

#: s for which a thread that computes may keep others waiting. Python's 5 ms are as long as the
#: shortest period: a service call that is being answered would hold up a cycle by all of it. Far
#: below 0.1 ms, threads that wait for the interpreter do nothing but ask for it.
SWITCH_INTERVAL = 0.0001
#: of the whole process: who has the interpreter, and with it the exchange, must not wait behind
#: other processes for long
NICE = -10
#: of the exchange; below the 50 of interrupt threads in a real-time kernel, which bring the frames
PRIORITY = 40

RAISED = f'real-time priority {PRIORITY}'
NOT_RAISED = ('no real-time priority, periods are less regular on a busy machine; to allow it see '
              'docs/performance.md')


def be_punctual() -> None:
    """
    Prefer punctual threads to busy ones, and this process to others where the system allows it.

    To be called first: threads inherit it.
    """
    sys.setswitchinterval(SWITCH_INTERVAL)
    try:
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
    except OSError:  # not allowed; raise_priority says so
        pass


def raise_priority() -> str:
    """
    Let the calling thread run before whatever is not real-time, if the system allows it.

    With the ordinary scheduler a thread that has used its share waits for up to some milliseconds
    behind others, which is a period. Threads that this one starts are ordinary again.

    :return: what became of it, in words.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK,
                              os.sched_param(PRIORITY))
    except (AttributeError, OSError):  # not Linux; not allowed
        return NOT_RAISED
    return RAISED
