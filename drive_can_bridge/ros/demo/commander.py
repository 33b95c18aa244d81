# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Somebody who commands the drives, as any other ROS node would: ``drive_can demo --drive``.

Neutral until every setpoint is armed, then ``~/enable`` where there is control, then a slow sine.
Setpoints without a negative side (limits) get a steady value.
"""

import math
import threading
import time
from typing import Any

from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_srvs.srv import SetBool

from drive_can_bridge.core.parameters import Parameter, Value, ValueKind
from drive_can_bridge.core.session import Session
from drive_can_bridge.ros.bridge_node import BridgeNode
from drive_can_bridge.ros.drive_node import DriveNode
from drive_can_bridge.ros.values import TOPIC_TYPES
from drive_can_bridge.simulation.names import quantity_of

RCLError = rclpy_implementation.RCLError

#: of a process only the bridge and its drives have names without underscore
NODE_NAME = '_demo_commander'
#: s between two commands to a drive
COMMAND_PERIOD = 0.05
#: s of the sine
SINE_PERIOD = 20.0
#: share of the permitted range that the sine, or a steady value, goes up to
AMPLITUDE = 0.3
#: s until ~/enable is tried again after it was refused
_ENABLE_AGAIN = 5.0
#: s more to wait for an answer that does not come
_ANSWER_TIMEOUT = 4.0


class _DriveCommander:
    """Commands one drive."""

    def __init__(self, node: Node, drive: DriveNode, delay: float) -> None:
        self._name = drive.name
        self._delay = delay
        name = drive.node.get_fully_qualified_name()
        self._setpoints: list[tuple[Parameter, Publisher, Any]] = []
        for item in drive.session.setpoints.items:
            parameter = item.parameter
            message_type = TOPIC_TYPES[parameter.kind]
            publisher = node.create_publisher(message_type, f'{name}/command/{parameter.name}', 8)
            self._setpoints.append((parameter, publisher, message_type()))
        self._client = (node.create_client(SetBool, f'{name}/enable')
                        if drive.session.control is not None else None)
        self._ask_at = 0.0
        self._asking = False
        self._rest()

    def _rest(self) -> None:
        self._begun_at: float | None = None
        self._enabled = self._client is None

    def command(self, session: Session | None, now: float) -> None:
        """Publish what is due, once."""
        if session is None or not session.online or session.setpoints.waiting:
            # gone, back again, or the process stood still: whatever it was, begin anew
            self._rest()
        elif not self._enabled:
            self._ask(now)
        elif self._begun_at is None:
            self._begun_at = now + self._delay
        elapsed = 0.0 if self._begun_at is None else max(0.0, now - self._begun_at)
        for parameter, publisher, message in self._setpoints:
            message.data = (neutral(parameter) if elapsed <= 0.0
                            else commanded(parameter, elapsed))
            publisher.publish(message)

    def _ask(self, now: float) -> None:
        client = self._client
        # an answer may get lost on its way: a service may answer before it knows where to
        if (client is None or now < self._ask_at + (_ANSWER_TIMEOUT if self._asking else 0.0)
                or not client.service_is_ready()):
            return
        self._asking = True
        self._ask_at = now + _ENABLE_AGAIN
        client.call_async(SetBool.Request(data=True)).add_done_callback(self._take_answer)

    def _take_answer(self, future: Any) -> None:
        self._asking = False
        answer = None if future.cancelled() or future.exception() else future.result()
        if answer is not None and answer.success:
            self._enabled = True
        elif answer is not None:
            get_logger('demo').warning(f'{self._name}: ~/enable: {answer.message}')


class Commander:
    """
    Commands all drives of a bridge, from a thread of its own.

    :param executor: takes the answers of the services.
    """

    def __init__(self, bridge: BridgeNode, executor: Executor) -> None:
        self._bridge = bridge
        self._executor = executor
        self.node = Node(NODE_NAME, namespace=bridge.get_namespace(), context=bridge.context,
                         use_global_arguments=False, start_parameter_services=False,
                         enable_rosout=False)
        drives = list(bridge.drives.values())
        self._drives = {
            drive.name: _DriveCommander(self.node, drive, delay=index * SINE_PERIOD / 8)
            for index, drive in enumerate(drives)}
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name='commander', daemon=True)
        executor.add_node(self.node)

    def start(self) -> None:
        """Begin to command."""
        self._thread.start()

    def stop(self) -> None:
        """Command nothing any more."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)

    def destroy(self) -> None:
        """Take the node out of the graph. The executor must have stopped."""
        self._executor.remove_node(self.node)
        self.node.destroy_node()

    def _run(self) -> None:
        due = time.monotonic()
        try:
            while not self._stopping.wait(max(0.0, due - time.monotonic())):
                now = time.monotonic()
                due = max(due + COMMAND_PERIOD, now)
                for name, commander in self._drives.items():
                    drive = self._bridge.drives.get(name)
                    commander.command(drive.session if drive is not None else None, now)
        except (InvalidHandle, RCLError) as error:
            if self._bridge.context.ok():
                get_logger('demo').error(f'no more commands: {error}')


def neutral(parameter: Parameter) -> Value:
    """Return the neutral value of a setpoint."""
    return parameter.value_from_raw(parameter.neutral_raw)


def commanded(parameter: Parameter, elapsed: float) -> Value:
    """
    Return the value of a setpoint some time after it was armed.

    Only quantities of a motor are moved; outputs and the like stay neutral.

    :param elapsed: s.
    """
    rest = neutral(parameter)
    if parameter.kind is ValueKind.BOOL or quantity_of(parameter) is None:
        return rest
    low, high = limits(parameter)
    if low >= rest or 'limit' in parameter.name.split('_'):
        whole = parameter.unit == '%' and high >= 100.0
        value = 100.0 if whole else rest + AMPLITUDE * (high - rest)
    else:
        value = rest + AMPLITUDE * min(high - rest, rest - low) * math.sin(
            math.tau * elapsed / SINE_PERIOD)
    return value if parameter.kind is ValueKind.DOUBLE else round(value)


def limits(parameter: Parameter) -> tuple[float, float]:
    """Return the smallest and the largest value of a parameter."""
    ends = sorted(float(parameter.value_from_raw(raw)) for raw in parameter.type.raw_range)
    low = ends[0] if parameter.minimum is None else max(ends[0], parameter.minimum)
    high = ends[1] if parameter.maximum is None else min(ends[1], parameter.maximum)
    return low, high
