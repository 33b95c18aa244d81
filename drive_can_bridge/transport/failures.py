# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What python-can's adapters raise, and what it means.

They fail in many ways: NameError, NotImplementedError, OSError, ValueError, CanError and its
children, whatever a vendor's library raises.
"""

from collections.abc import Iterator
import errno
import struct

from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.bus_sentences import BusLoss
from drive_can_bridge.core.messages import around, Sentence
from drive_can_bridge.core.text import printable

#: what comes of reading a packet that is torn, or none
_CONTENT = (TypeError, ValueError, LookupError, struct.error)


def in_words(error: BaseException) -> str:
    """Return one readable line for any exception: its sentence, if it has one."""
    if error.args and isinstance(error.args[0], Sentence):
        return error.args[0]
    if isinstance(error, OSError) and error.errno == errno.EAFNOSUPPORT:
        return bus_sentences.no_socketcan()
    text = printable(' '.join(str(error).split()))
    return text or type(error).__name__


def with_cause(error: BaseException) -> str:
    """Return an adapter's message, with the cause that it may leave out."""
    text, cause = in_words(error), error.__cause__
    reason = in_words(cause) if cause is not None else ''
    return text if reason in text else around(text, behind=f': {reason}')


def with_outlook(reason: str, period: float) -> str:
    """Return why a bus is down, with what happens next."""
    if isinstance(reason, Sentence) and reason.kind is BusLoss.UNPLUGGED:
        return bus_sentences.down_until_back(reason=reason)
    return bus_sentences.down_and_tried(reason=reason, period=period)


def is_malformed(error: BaseException) -> bool:
    """Return whether an exception means a malformed packet: python-can reads them unchecked."""
    return (isinstance(error, _CONTENT) or isinstance(error.__cause__, _CONTENT)
            # of python-can's ``serial``, which has no class for it
            or error.__cause__ is None and 'invalid delimiter' in str(error))


def is_misconfiguration(error: BaseException) -> bool:
    """Return whether another attempt to open a bus would fail for the same reason."""
    for cause in _chain(error):
        if isinstance(cause, OSError):
            return _is_missing_library(cause)
        if isinstance(cause, (NotImplementedError, ImportError, NameError, ValueError,
                              TypeError)):
            return True
    return False


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error and its causes: python-can wraps errors, the reason is at the end."""
    while error is not None:
        yield error
        error = error.__cause__


def _is_missing_library(error: OSError) -> bool:
    """Return whether a vendor's library is not installed: the error has words, and no errno."""
    text = str(error).lower()
    return error.errno is None and any(words in text for words in (
        'library not found', 'cannot open shared object file', 'could not find module'))


def is_absence(error: BaseException) -> bool:
    """Return whether a device could not be opened because it is not there."""
    return any(getattr(cause, 'errno', None) in (errno.ENOENT, errno.ENODEV, errno.ENXIO)
               for cause in _chain(error))


def is_full_queue(error: BaseException) -> bool:
    """Return whether the kernel's transmit queue is full: ENOBUFS of a socket."""
    return errno.ENOBUFS in (getattr(error, 'error_code', None), getattr(error, 'errno', None))
