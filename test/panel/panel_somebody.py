# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Somebody else in the graph, who enables drives and moves them."""

import threading

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64
from std_srvs.srv import SetBool


class Somebody:
    """A node with a thread of its own."""

    def __init__(self) -> None:
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node('somebody', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._ended = threading.Event()
        self._commands: list[threading.Thread] = []

    def enables(self, drive: str) -> None:
        """Enable a drive."""
        client = self._node.create_client(SetBool, f'{drive}/enable')
        assert client.wait_for_service(30.0)
        future = client.call_async(SetBool.Request(data=True))
        self._executor.spin_until_future_complete(future, 30.0)
        response = future.result()
        assert response is not None and response.success, response

    def commands(self, drive: str, speed: float) -> None:
        """Command a speed from now on, neutral first."""
        publisher = self._node.create_publisher(Float64, f'{drive}/command/speed_setpoint', 10)

        def publish() -> None:
            count = 0
            while not self._ended.wait(0.05):
                count += bool(publisher.get_subscription_count())
                publisher.publish(Float64(data=speed if count > 10 else 0.0))
        self._commands.append(threading.Thread(target=publish))
        self._commands[-1].start()

    def close(self) -> None:
        """Leave the graph."""
        self._ended.set()
        for thread in self._commands:
            thread.join()
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()
