# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The errors of the package.

.. code-block:: text

    DriveCanError
     +-- ConfigurationError     a parameter file or profile is wrong; nothing was opened
     +-- LocalProtocolError     we were about to break a rule (also a ValueError)
     +-- RemoteProtocolError    the other side did
     +-- ValueRefused           a setpoint or parameter value cannot be sent (also a ValueError)
     +-- TransportError         the bus is there, and does not take a frame
     +-- BusUnavailable         device absent, busy or lost: try again (also an OSError)
     +-- BusMisconfigured       unknown interface, driver missing, impossible bit rate
     +-- NoBridge               none is running
     +-- SilentBridge           one is in the graph, or holds drives on this host; none answers
     +-- WhichBridge            several are running, and none was chosen
     +-- NoAnswer               a node does not answer, or has left

Every message is a sentence for a user, without a trailing period, in the manuals' own terms.
"""

from collections.abc import Sequence

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import NOTHING, Sentence


class DriveCanError(Exception):
    """The base of all errors that this package raises on purpose."""

    @property
    def sentence(self) -> Sentence:
        """The message with its code; without one where a mere text was raised."""
        text = self.args[0] if self.args else NOTHING
        return text if isinstance(text, Sentence) else sentences.uncoded(str(self))


class ConfigurationError(DriveCanError):
    """
    The configuration cannot be used.

    :param problems: one readable line per problem.
    """

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__('\n'.join(problems))
        self.problems = list(problems)


class LocalProtocolError(DriveCanError, ValueError):
    """This side was about to send what the protocol does not allow."""


class RemoteProtocolError(DriveCanError):
    """A received frame breaks the protocol."""


class Unasked(DriveCanError):
    """A received frame is valid, but answers no open request."""


class ValueRefused(DriveCanError, ValueError):
    """A value has the wrong type, is out of range, or cannot be represented."""


class TransportError(DriveCanError):
    """A frame was not sent, but the bus is still there: its queue is full, or it hangs."""


class BusUnavailable(DriveCanError, OSError):
    """
    The device is absent, busy or lost. Worth another attempt.

    :param taken: another process has it: start-up does not wait for it.
    """

    def __init__(self, text: str, *, taken: bool = False) -> None:
        super().__init__(text)
        self.taken = taken


class BusMisconfigured(DriveCanError):
    """No attempt will ever succeed: the configuration of the bus is wrong."""


class NoBridge(DriveCanError):
    """No bridge is running."""


class SilentBridge(DriveCanError):
    """A bridge is in the graph, or holds drives on this host, and does not answer."""


class WhichBridge(DriveCanError):
    """Several bridges are running, and none was chosen."""


class NoAnswer(DriveCanError):
    """
    A node does not answer, or has left.

    :ivar asked: it was sent the question, and may have done what it was asked.
    """

    def __init__(self, text: str, *, asked: bool) -> None:
        super().__init__(text)
        self.asked = asked
