# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How the threads of the process share the interpreter and the processors."""

import gc
import os
import sys
import threading
import time

from drive_can_bridge import host_texts

#: s for which a thread that computes may keep others waiting, at least and at most. Python's 5 ms
#: are as long as the shortest period: a service call that is being answered would hold up a cycle
#: by all of it.
SHORTEST, LONGEST = 0.0001, 0.005
#: handovers of the interpreter in the time between: a waiting thread asks as often, and where
#: asking takes as long as that, threads that wait do nothing else, and with real-time priority
#: they keep the one that has it from ever giving it back
HANDOVERS = 10
#: handovers that are measured, there and back
ROUNDS = 20
#: passes over the young objects until one over all: that keeps everybody from the interpreter for
#: 0.3 us an object, 20 ms in an idle bridge, 0.3 s where a client waits for a thousand
#: parameters of each of some drives 64 times over. It finds nothing while drives are exchanged
#: with; the end of that does.
PASSES = 1_000_000_000
#: of the whole process: a thread with the interpreter, and so the exchange, must not wait behind
#: other processes for long
NICE = -10
#: of the exchange; below the 50 of interrupt threads in a real-time kernel, which bring the frames
PRIORITY = 40

RAISED = f'real-time priority {PRIORITY}'
NOT_RAISED = host_texts.no_real_time


def be_punctual() -> None:
    """
    Prefer punctual threads to busy ones, and this process to others where the system allows it.

    To be called first: threads inherit it.
    """
    sys.setswitchinterval(min(max(SHORTEST, HANDOVERS * handover_time()), LONGEST))
    gc.set_threshold(*gc.get_threshold()[:2], PASSES)
    try:
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
    except OSError:  # not allowed; raise_priority reports it
        pass


def handover_time() -> float:
    """
    Measure how long it takes to pass the interpreter to a thread that waits.

    :return: s, the shortest seen, so that other processes do not count: some microseconds, or, on
        a slow processor, in a sandbox or an emulator, up to a millisecond.
    """
    here, there = threading.Lock(), threading.Lock()
    here.acquire()
    there.acquire()

    def answer() -> None:
        for _ in range(ROUNDS):
            there.acquire()
            here.release()
    thread = threading.Thread(target=answer)
    thread.start()
    shortest = LONGEST
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        there.release()
        here.acquire()
        shortest = min(shortest, (time.perf_counter() - begin) / 2.0)
    thread.join()
    return shortest


def raise_priority() -> str:
    """
    Raise the calling thread to real-time priority, if the system allows it.

    With the ordinary scheduler a thread that has used its share waits for up to some milliseconds
    behind others, which is a period. Threads that this one starts are ordinary again.

    :return: the result, in words.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK,
                              os.sched_param(PRIORITY))
    except (AttributeError, OSError):  # not Linux; not allowed
        return NOT_RAISED
    return RAISED
