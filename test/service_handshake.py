# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Makes sure that a service can answer the clients of a node.

``service_is_ready`` says that this side has found the server, not that the server has found this
client. A server that has not gives up after 0.1 s: it logs that the client will not receive the
response, and the call is never answered. On a machine that stands still for a moment that
happens; and a call that changes something cannot just be made again.

So before the first call another one is made, that changes nothing, through a client that was made
*later*, again and again until it is answered. Endpoints are announced in order and reliably:
a server that knows the later client knows the earlier ones of the same node, too.
"""

from rcl_interfaces.srv import GetParameterTypes
from rclpy.qos import qos_profile_parameters

#: s after which the greeting is said again
PATIENCE = 2.0


def shake_hands(node, service, wait, host=''):
    """
    Return when the process that offers a service knows all clients of a node.

    :param node: the node of the clients.
    :param service: the full name of the service.
    :param wait: ``wait(condition, seconds)`` tells whether the condition became true in time, and
        ends the test when everything takes too long.
    :param host: the node that offers the service, where the name of the service does not tell.
    """
    host = host or service.rpartition('/')[0]
    greeting = node.create_client(GetParameterTypes, f'{host}/get_parameter_types',
                                  qos_profile=qos_profile_parameters)
    try:
        while not wait(greeting.service_is_ready, PATIENCE):
            pass
        while True:
            future = greeting.call_async(GetParameterTypes.Request())
            if wait(future.done, PATIENCE):
                return
            greeting.remove_pending_request(future)
    finally:
        node.destroy_client(greeting)
