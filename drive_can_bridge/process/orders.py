# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What drives are told by hand beside a stop, the same for all ways to them."""

from drive_can_bridge import host_texts
from drive_can_bridge.process.local_stop import Answer

#: s that it may take: it is the bridge that says when it is over
CONTROL_TIMEOUT = 120.0
#: order -> service of the drive
SERVICES = {'enable': 'enable', 'disable': 'enable', 'reset': 'reset_fault'}


def unanswered(node: str, waited: float) -> Answer:
    """Say of a drive that for so many s nobody has said what became of an order."""
    return Answer(node, False, host_texts.order_unanswered.format(waited=waited))


def unoffered(node: str, order: str) -> Answer:
    """Say of a drive that nobody takes an order for it."""
    return Answer(node, False, host_texts.order_unoffered.format(service=SERVICES[order]))
