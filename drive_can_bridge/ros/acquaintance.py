# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How a client makes sure that a node can answer it.

``service_is_ready`` says that this side has found the server, not that the server has found this
client. A server that has not gives its answer up, though it has done what it was asked. So before
the first call another one is made that changes nothing, through a client that was made later,
until it is answered: endpoints are announced in order, so that a server which knows the later one
knows the earlier ones of this node, too. Nor has this side found all services of a node when it
has found one: what is sent to one that it does not know yet is lost.
"""

from collections.abc import Iterable
from typing import Any

from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, GetParameterTypes, ListParameters, SetParameters,
)

#: what is asked of a node to know that it knows us: of no parameter
GREETING = 'get_parameter_types', GetParameterTypes
#: s after which a greeting is said again for the first time; then twice as many, and so on
FIRST_PATIENCE = 0.1

WRITING = 'set_parameters'
SERVICES: dict[str, Any] = {
    'get_parameters': GetParameters, WRITING: SetParameters,
    'list_parameters': ListParameters, 'describe_parameters': DescribeParameters}


def wanted_with(service: str) -> Iterable[str]:
    """Return the services whose clients are made together: a greeting is enough for them all."""
    # what writes is not for everybody who reads (SROS2)
    return {service} if service == WRITING else SERVICES.keys() - {WRITING}
