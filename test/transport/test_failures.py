# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Which failures of an adapter are worth another attempt."""

import errno

import can
import pytest

from drive_can_bridge.core.bus_sentences import adapter_gone
from drive_can_bridge.transport.failures import in_words, is_misconfiguration, with_outlook


def wrapped(cause: Exception) -> Exception:
    """Return an error as python-can wraps it."""
    error = can.CanInitializationError('could not open')
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(('error', 'never'), [
    (ImportError('no module'), True), (NameError('uptime'), True), (NotImplementedError(), True),
    (ValueError('bitrate'), True),
    # PCAN-Basic, Kvaser's canlib and their like, where they are not installed
    (OSError('pcanbasic library not found.'), True),
    (OSError('libcanlib.so: cannot open shared object file: No such file or directory'), True),
    (OSError(errno.ENODEV, 'No such device'), False),
    (FileNotFoundError(errno.ENOENT, 'no such file'), False),
    (PermissionError(errno.EACCES, 'denied'), False), (OSError('the device is busy'), False),
    (can.CanInitializationError('channel taken'), False),
], ids=str)
def test_what_will_never_work_and_what_may_later(error: Exception, *, never: bool) -> None:
    assert is_misconfiguration(error) == never
    assert is_misconfiguration(wrapped(error)) == never


@pytest.mark.parametrize(('reason', 'period', 'told'), [
    (adapter_gone('/dev/ttyACM0'), 1.0,
     'adapter /dev/ttyACM0 is gone: unplugged? Goes on by itself when it is back'),
    ('no such device', 0.5, 'no such device; tried again every 0.5 s')])
def test_what_becomes_of_a_bus_that_is_down(reason: str, period: float, told: str) -> None:
    assert with_outlook(reason, period) == told


def test_a_kernel_without_socketcan_is_no_number() -> None:
    error = OSError(errno.EAFNOSUPPORT, 'Address family not supported by protocol')
    assert in_words(error).startswith('this kernel has no SocketCAN: ')
    assert not is_misconfiguration(error)   # it may be loaded
