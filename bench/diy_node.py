# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The baseline: what an ordinary user writes in an afternoon, and what works for one drive.

One node, one rclpy timer, python-can, ``struct``, one executor. Every drive has the topics that
the bridge gives it, with the names of the bridge. Received frames come in through python-can's
``Notifier``, as its documentation shows, into a queue that the timer empties. Started with
channel, number of drives, period.
"""

import struct
import sys
import threading

import can
from child import serve
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterType, ParameterValue
import rclpy  # isort: skip
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float64, Int64
import topics  # noqa: F401  sets the environment of rclpy
from unix_bus import INTERFACE, register


class Drive(Node):
    """One drive."""

    def __init__(self, station: int, bus: can.BusABC) -> None:
        super().__init__(f'drive{station - 1}')
        self.station = station
        self.bus = bus
        self.setpoints = [0.0, 0.0, 0.0, 0]
        self.speed = self.create_publisher(Float64, '~/actual_speed', 10)
        self.current = self.create_publisher(Float64, '~/motor_current', 10)
        self.position = self.create_publisher(Float64, '~/actual_position', 10)
        self.inputs = self.create_publisher(Int64, '~/digital_inputs', 10)
        self.response = self.create_publisher(ParameterEvent, '~/response', 10)
        for slot, name in enumerate(('speed_setpoint', 'torque_limit', 'position_setpoint')):
            self.create_subscription(Float64, f'~/command/{name}',
                                     lambda message, slot=slot: self.command(slot, message), 10)
        self.create_subscription(Int64, '~/command/digital_outputs',
                                 lambda message: self.command(3, message), 10)

    def command(self, slot, message):
        """Keep the newest setpoint."""
        self.setpoints[slot] = message.data

    def request(self):
        """Send the cyclic request."""
        speed, torque, position, outputs = self.setpoints
        self.bus.send(can.Message(
            arbitration_id=self.station << 21 | 0x1FFFF0, is_extended_id=True,
            data=struct.pack('>hHhH', round(speed / 0.1), round(torque / 0.1),
                             round(position / 0.1), outputs)))

    def receive(self, data):
        """Publish the cyclic response."""
        speed, current, position, inputs = struct.unpack('>hhhH', data)
        values = [('actual_speed', speed * 0.1), ('motor_current', current * 0.01),
                  ('actual_position', position * 0.1)]
        event = ParameterEvent()
        event.stamp = self.get_clock().now().to_msg()
        event.node = self.get_fully_qualified_name()
        for name, value in values:
            event.changed_parameters.append(Parameter(name=name, value=ParameterValue(
                type=ParameterType.PARAMETER_DOUBLE, double_value=value)))
        event.changed_parameters.append(Parameter(name='digital_inputs', value=ParameterValue(
            type=ParameterType.PARAMETER_INTEGER, integer_value=inputs)))
        self.response.publish(event)
        self.speed.publish(Float64(data=speed * 0.1))
        self.current.publish(Float64(data=current * 0.01))
        self.position.publish(Float64(data=position * 0.1))
        self.inputs.publish(Int64(data=inputs))


class DoItYourself(Node):
    """The bus and its timer."""

    def __init__(self, channel: str, drives: int, period: float) -> None:
        super().__init__('diy')
        self.bus = can.Bus(interface=INTERFACE, channel=channel, ignore_config=True)
        self.drives = {number + 1: Drive(number + 1, self.bus) for number in range(drives)}
        self.reader = can.BufferedReader()
        self.notifier = can.Notifier(self.bus, [self.reader])
        self.timer = self.create_timer(period, self.tick)

    def close(self):
        """End well."""
        self.notifier.stop()
        self.bus.shutdown()

    def tick(self):
        """Exchange with every drive."""
        message = self.reader.get_message(timeout=0.0)
        while message is not None:
            drive = self.drives.get(message.arbitration_id >> 21 & 0x7F)
            if drive is not None:
                drive.receive(message.data)
            message = self.reader.get_message(timeout=0.0)
        for drive in self.drives.values():
            drive.request()


def main() -> None:
    """Spin everything in one executor."""
    register()
    rclpy.init(args=[])
    node = DoItYourself(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]))
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    for drive in node.drives.values():
        executor.add_node(drive)
    threading.Thread(target=executor.spin, daemon=True).start()
    serve({}, close=node.close)


if __name__ == '__main__':
    main()
