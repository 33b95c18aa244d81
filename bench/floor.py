# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The floor: what the same exchange costs with nothing around it.

One loop: sleep to the next cycle, take commands, python-can send for every drive, python-can
receive, ``struct``, and the same bytes published in the way of the bridge to whoever subscribes.
Started with prefix of the topics, channel, number of drives, period and 0 or 1: take commands.
"""

from functools import partial
import struct
import sys
import time
from typing import Any

import can
from child import PATIENCE, serve, sleep_until
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterValue
import rclpy  # isort: skip
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64
from topics import DOUBLES, INTEGERS, TYPES
from unix_bus import INTERFACE, register

from drive_can_bridge.ros.main import set_up_fast_dds
from drive_can_bridge.ros.prepared import PreparedMessage

CYCLIC = 0x001FFFF0
DIR = 0x10000000
#: s between two looks at who subscribes, as the bridge looks
COUNT_PERIOD = 0.05
#: of the subscriptions for commands, as the bridge has them
COMMANDS = QoSProfile(depth=8, reliability=ReliabilityPolicy.BEST_EFFORT)


class Drive:
    """What is published for one drive, and its commands."""

    def __init__(self, node: Node, name: str, commanded: bool) -> None:
        values, self._topics = [], []
        for topic in (*DOUBLES, *INTEGERS):
            message, publisher = TYPES[topic](), node.create_publisher(
                TYPES[topic], f'/{name}/{topic}', 10)
            self._topics.append((publisher, PreparedMessage.find(publisher, message, [
                ('d' if topic in DOUBLES else 'q', partial(setattr, message, 'data'))])))
            values.append(ParameterValue(type=3 if topic in DOUBLES else 2))
        response = ParameterEvent(node=f'/{name}', changed_parameters=[
            Parameter(name=topic, value=value)
            for topic, value in zip((*DOUBLES, *INTEGERS), values)])
        publisher = node.create_publisher(ParameterEvent, f'/{name}/response', 10)
        self._response = publisher, PreparedMessage.find(publisher, response, [
            ('i', partial(setattr, response.stamp, 'sec')),
            ('I', partial(setattr, response.stamp, 'nanosec')),
            *(('d', partial(setattr, value, 'double_value')) for value in values[:3]),
            ('q', partial(setattr, values[3], 'integer_value'))])
        self._listened: list[tuple[int, Any]] = []
        self._response_listened: Any = None
        self._commands = node.create_subscription(
            Float64, f'/{name}/command/speed_setpoint', lambda _: None,
            COMMANDS).handle if commanded else None
        self.setpoint = 0.0

    def look_who_subscribes(self) -> None:
        """Remember what is to be published."""
        self._listened = [(slot, prepared.publish)
                          for slot, (publisher, prepared) in enumerate(self._topics)
                          if prepared and publisher.get_subscription_count()]
        publisher, prepared = self._response
        self._response_listened = (prepared.publish if prepared
                                   and publisher.get_subscription_count() else None)

    def take_commands(self) -> None:
        """Take what waits; the newest wins."""
        if self._commands is None:
            return
        for _ in range(COMMANDS.depth):
            taken = self._commands.take_message(Float64, True)
            if taken is None:
                break
            self.setpoint = struct.unpack_from('<d', taken[0], 4)[0]

    def publish(self, *values: Any) -> None:
        """Publish a sample."""
        if self._response_listened:
            self._response_listened((*divmod(time.time_ns(), 1_000_000_000), *values))
        for slot, publish in self._listened:
            publish((values[slot],))


class Floor:
    """The loop; this process does nothing else."""

    def __init__(self, node: Node, prefix: str, channel: str, drives: int, period: float,
                 commanded: bool) -> None:
        self._bus = can.Bus(interface=INTERFACE, channel=channel, ignore_config=True)
        self._drives = [Drive(node, f'{prefix}{number}', commanded) for number in range(drives)]
        self._period = period

    def run(self, duration: float) -> dict[str, Any]:
        """Exchange for so long; return CPU time of the process, exchanges, period errors."""
        request, response = struct.Struct('>hHhH').pack, struct.Struct('>hhhH').unpack
        drives, period, bus = self._drives, self._period, self._bus
        errors: list[float] = []
        exchanges, look_at, last = 0, 0.0, 0.0
        deadline = time.monotonic()
        end = deadline + duration
        cpu = time.process_time()
        while deadline < end:
            sleep_until(deadline)
            now = time.monotonic()
            if last:
                errors.append(abs(now - last - period))
            last = now
            if now >= look_at:
                look_at = now + COUNT_PERIOD
                for drive in drives:
                    drive.look_who_subscribes()
            for number, drive in enumerate(drives):
                drive.take_commands()
                bus.send(can.Message(
                    arbitration_id=(number + 1) << 21 | CYCLIC, is_extended_id=True,
                    data=request(int(drive.setpoint * 10.0), 0, 0, 0)))
            for _ in drives:
                message = bus.recv(PATIENCE)
                if message is None:
                    raise RuntimeError('a drive did not answer')
                speed, current, position, inputs = response(message.data)
                station = (message.arbitration_id & ~DIR) >> 21
                drives[station - 1].publish(speed * 0.1, current * 0.01, position * 0.1, inputs)
                exchanges += 1
            deadline += period
        return {'cpu': time.process_time() - cpu, 'exchanges': exchanges, 'period_errors': errors}

    def close(self) -> None:
        """End well."""
        self._bus.shutdown()


def main() -> None:
    """Obey."""
    register()
    set_up_fast_dds()    # the middleware is set up as the bridge's
    rclpy.init(args=[])
    prefix, channel, drives, period, commanded = sys.argv[1:]
    floor = Floor(Node('bench_floor', enable_rosout=False), prefix, channel, int(drives),
                  float(period), commanded == '1')
    serve({'run': floor.run}, close=floor.close)


if __name__ == '__main__':
    main()
