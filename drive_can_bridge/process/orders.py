# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Commands by hand beside a stop, the same for all ways to a drive."""

from drive_can_bridge import host_texts
from drive_can_bridge.process.local_stop import Answer

#: s that it may take: the bridge itself ends it
CONTROL_TIMEOUT = 120.0
#: order -> service of the drive
SERVICES = {'enable': 'enable', 'disable': 'enable', 'reset': 'reset_fault'}


def unanswered(node: str, waited: float) -> Answer:
    """Return the result for a drive whose bridge has not answered for so many s."""
    return Answer(node, False, host_texts.order_unanswered.format(waited=waited))


def unoffered(node: str, order: str) -> Answer:
    """Return the result for a drive that does not offer a command."""
    return Answer(node, False, host_texts.order_unoffered.format(service=SERVICES[order]))
