# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A node that commands the drives, as any other could: ``drive_can demo --drive``.

``~/enable`` where there is control, then neutral until every setpoint is armed, then a slow sine.
Setpoints without a negative side get a steady value; what the profile calls a limit gets none.
"""

import math
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy.exceptions import NotInitializedException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from std_srvs.srv import SetBool

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.configuration import BridgeConfiguration, DriveConfiguration
from drive_can_bridge.core.parameters import Parameter, Value, ValueKind
from drive_can_bridge.monitor.snapshot import read_status, StatusReport
from drive_can_bridge.process.beginning import let_signals_in
from drive_can_bridge.ros.monitor.client import statuses
from drive_can_bridge.ros.rcl.extension import GONE
from drive_can_bridge.ros.values import TOPIC_TYPES
from drive_can_bridge.simulation.quantities import quantity_of

NODE_NAME = '_demo_commander'
#: s between two commands to a drive
COMMAND_PERIOD = 0.05
#: s of the sine
SINE_PERIOD = 20.0
#: share of the permitted range that the sine, or a steady value, goes up to
AMPLITUDE = 0.3
#: s until ~/enable is tried again
_ENABLE_AGAIN = 4.0
#: control states in which setpoints count
_ENABLED = ('enabled', 'operation enabled')


class _DriveCommander:
    """Commands one drive by its diagnostics."""

    def __init__(self, node: Node, drive: DriveConfiguration, delay: float) -> None:
        self._logger = node.get_logger()
        self._name = drive.name
        self._delay = delay
        table = drive.profile.control
        self._setpoints: list[tuple[Parameter, Publisher, Any]] = []
        for parameter in drive.cyclic_request:
            if not parameter.limit and (table is None or parameter.name != table.parameter):
                message_type = TOPIC_TYPES[parameter.kind]
                self._setpoints.append((parameter, node.create_publisher(
                    message_type, f'/{drive.name}/command/{parameter.name}', 8), message_type()))
        self._client = node.create_client(SetBool, f'/{drive.name}/enable')
        self._ask_at = 0.0
        self._controlled = table is not None
        self._ready = False
        self._begun_at: float | None = None

    def reported(self, report: StatusReport, now: float) -> None:
        """Handle a status of the drive."""
        control = report.facts.get('control_state')
        there = report.state not in ('offline', 'mapping differs', 'fault')
        ready = self._ready = there and (control is None or control in _ENABLED)
        if not (ready and report.state == 'online'):
            # gone, back again, or the process was stalled: restart in any case
            self._begun_at = None
        elif self._begun_at is None:
            self._begun_at = now + self._delay
        if there and not ready and now >= self._ask_at and self._client.service_is_ready():
            self._ask_at = now + _ENABLE_AGAIN
            self._client.call_async(SetBool.Request(data=True)).add_done_callback(self._answered)

    def command(self, now: float) -> None:
        """Publish what is due, once."""
        if self._controlled and not self._ready:    # would be in vain, and warned about
            return
        elapsed = 0.0 if self._begun_at is None else max(0.0, now - self._begun_at)
        for parameter, publisher, message in self._setpoints:
            message.data = neutral(parameter) if elapsed <= 0.0 else commanded(parameter, elapsed)
            publisher.publish(message)

    def _answered(self, future: Any) -> None:
        answer = None if future.cancelled() or future.exception() else future.result()
        if answer is not None and not answer.success:
            self._logger.warning(f'{self._name}: ~/enable: {answer.message}')


def main() -> int:
    """Command all drives of a parameter file, until the process is ended."""
    try:
        let_signals_in()    # see Child
        configuration = configuration_from_file(sys.argv[1])
        rclpy.init(args=[])
        _command(configuration)
    except KeyboardInterrupt:   # SIGINT
        pass
    except (ExternalShutdownException, NotInitializedException, *GONE):
        if rclpy.ok():
            raise
        # SIGTERM: rclpy ends the context, whatever is being done
    return 0


def _command(configuration: BridgeConfiguration) -> None:
    node = Node(NODE_NAME, start_parameter_services=False, enable_rosout=False)
    drives = {name: _DriveCommander(node, drive, delay=index * SINE_PERIOD / 8)
              for index, (name, drive) in enumerate(configuration.drives.items())}

    def take(message: DiagnosticArray) -> None:
        for status in statuses(message):
            report = read_status(status)
            if report is not None and report.is_drive and report.name in drives:
                drives[report.name].reported(report, time.monotonic())

    def command() -> None:
        for drive in drives.values():
            drive.command(time.monotonic())
    node.create_subscription(DiagnosticArray, '/diagnostics', take, QoSProfile(depth=10))
    node.create_timer(COMMAND_PERIOD, command)
    if rclpy.ok():  # an executor that cannot be made any more complains at its own end
        rclpy.spin(node)


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
