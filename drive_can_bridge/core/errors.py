# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The errors of the package.

.. code-block:: text

    DriveCanError
     +-- ConfigurationError             a parameter file or profile is wrong; nothing was opened
     +-- ProtocolError
     |    +-- LocalProtocolError        we were about to break a rule (also a ValueError)
     |    +-- RemoteProtocolError       the other side did
     +-- ValueRefused                   a setpoint or parameter value cannot be sent (ValueError)
     +-- TransportError
          +-- BusUnavailable            device absent, busy or lost: try again (also an OSError)
          +-- BusMisconfigured          unknown interface, driver missing, impossible bit rate

Every message is a sentence for a user, without a trailing period, in the manuals' own terms.
"""


class DriveCanError(Exception):
    """Base of everything this package raises on purpose."""


class ConfigurationError(DriveCanError):
    """
    The configuration cannot be used.

    :param problems: one readable line per problem.
    """

    def __init__(self, problems: list[str]) -> None:
        super().__init__('\n'.join(problems))
        self.problems = problems


class ProtocolError(DriveCanError):
    """A frame and its protocol do not agree."""


class LocalProtocolError(ProtocolError, ValueError):
    """We were asked to send what the protocol does not allow."""


class RemoteProtocolError(ProtocolError):
    """A received frame breaks the protocol."""


class ValueRefused(DriveCanError, ValueError):
    """A value has the wrong type, is out of range, or cannot be represented."""


class TransportError(DriveCanError):
    """The bus cannot be used."""


class BusUnavailable(TransportError, OSError):
    """The device is absent, busy or lost. Worth another attempt."""


class BusMisconfigured(TransportError):
    """No attempt will ever succeed: the configuration of the bus is wrong."""
