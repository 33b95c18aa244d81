# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Run a command in a network of its own: usage: own_network.py COMMAND [ARGUMENT...].

The local way to bridges knows no ROS domains; it does know networks. Root, or whoever the kernel
lets have name spaces, gets one with nothing but the loopback interface. Exits with 77 where the
kernel does not, and says why.
"""

from collections.abc import Callable
import ctypes
import fcntl
import json
import os
import socket
import struct
import sys
import traceback
from typing import Any

#: sched.h
CLONE_NEWUSER, CLONE_NEWNET = 0x10000000, 0x40000000
#: sockios.h, if.h
SIOCSIFFLAGS, IFF_UP = 0x8914, 1


def enter() -> None:
    """
    Move this process, and what it starts from now on, into such a network.

    :raises OSError: the kernel does not let it.
    """
    user, group = os.geteuid(), os.getegid()
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(CLONE_NEWNET | (CLONE_NEWUSER if user else 0)):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    if user:
        for name, text in (('setgroups', 'deny'), ('uid_map', f'{user} {user} 1'),
                           ('gid_map', f'{group} {group} 1')):
            with open(f'/proc/self/{name}', 'w', encoding='ascii') as file:
                file.write(text)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, struct.pack('16sh14x', b'lo', IFF_UP))


def run(scenario: Callable[[], Any]) -> Any:
    """
    Run a scenario there, with the local way switched on; here, and without, where that cannot be.

    :raises SystemExit: it failed.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            try:
                enter()
                os.environ['DRIVE_CAN_LOCAL'] = 'on'
            except OSError as refusal:
                print(f'no network of its own, so commands go through ROS: {refusal}',
                      file=sys.stderr)
            with os.fdopen(writing, 'w') as pipe:
                json.dump(scenario(), pipe)
            os._exit(0)
        except BaseException:  # noqa: BLE001  outermost of a process
            traceback.print_exc()
        os._exit(1)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        found = pipe.read()
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
        raise SystemExit('it failed in a network of its own')
    return json.loads(found)


if __name__ == '__main__':
    try:
        enter()
    except OSError as refusal:
        print(f'no network of its own: {refusal}')
        sys.exit(77)
    os.execvp(sys.argv[1], sys.argv[1:])
