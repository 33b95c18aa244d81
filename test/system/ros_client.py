# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A plain rclpy node that does what it reads on standard input, one JSON object per line.

It knows nothing of the bridge but what its contract says, and answers each line by one line:
``{"result": ...}`` or ``{"failure": "why"}``. Started by the tests in this directory.
"""

from collections import deque
import itertools
import json
import queue
import re
import sys
import threading

from diagnostic_msgs.msg import DiagnosticArray
from ending import until_told_to_end
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Log, Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, qos_profile_parameters, QoSProfile
from service_handshake import shake_hands
from std_msgs.msg import Bool, Float64, Int64
from std_srvs.srv import SetBool, Trigger
from waiting import clock

TYPES = {'Float64': Float64, 'Int64': Int64}


class Failed(Exception):
    """What was asked for did not happen."""


class Client:
    """Carries out one request after the other; callbacks run in this thread only."""

    def __init__(self, node):
        self.node = node
        # one that stays: what rclpy.spin_once does costs a tenth of a core
        self.executor = SingleThreadedExecutor(context=node.context)
        self.executor.add_node(node)
        self.publishers = {}
        self.received = {}
        self.services = {}
        self.logs = []
        self.statuses = []
        self.diagnostics_topic = node.create_subscription(
            DiagnosticArray, '/diagnostics', lambda message: self.statuses.extend(message.status),
            QoSProfile(depth=50))

    def spin(self, seconds):
        self.executor.spin_once(timeout_sec=seconds)

    def until(self, condition, timeout, what):
        deadline = clock().now() + timeout
        while not condition():
            if clock().now() > deadline:
                raise Failed(f'waited {timeout:g} s for {what}')
            self.spin(0.02)

    def forget(self, timeout):
        """Begin anew: whatever a test made would be served, and announced, for all that follow."""
        for publisher, timer in self.publishers.values():
            self.node.destroy_timer(timer)
            self.node.destroy_publisher(publisher)
        for _, subscription in self.received.values():
            self.node.destroy_subscription(subscription)
        for subscription in self.logs:
            self.node.destroy_subscription(subscription)
        for service in self.services.values():
            self.node.destroy_client(service)
        for kept in (self.publishers, self.received, self.services, self.logs, self.statuses):
            kept.clear()

    # -- topics -----------------------------------------------------------------------------------

    def publish(self, topic, value, rate, timeout):
        publisher, timer = self.publishers.pop(topic, (None, None))
        if timer is not None:
            self.node.destroy_timer(timer)
        if value is None:
            return None
        if publisher is None:
            publisher = self.node.create_publisher(Float64, topic, 10)
            self.until(publisher.get_subscription_count, timeout, f'a subscriber of {topic}')
        message = Float64(data=float(value))
        publisher.publish(message)
        timer = self.node.create_timer(1.0 / rate, lambda: publisher.publish(message))
        self.publishers[topic] = publisher, timer
        return None

    def listen(self, topic, kind, latched=False):
        if topic not in self.received:
            messages = deque(maxlen=1000)
            quality = QoSProfile(depth=100)
            if latched:
                quality = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            subscription = self.node.create_subscription(
                kind, topic, lambda message: messages.append(message.data), quality)
            self.received[topic] = messages, subscription
        return self.received[topic][0]

    def value(self, topic, kind, low, high, timeout):
        messages = self.listen(topic, TYPES[kind])
        messages.clear()
        self.until(lambda: messages and low <= messages[-1] <= high, timeout,
                   f'{topic} within {low:g} and {high:g}')
        return messages[-1]

    def values(self, topic, timeout):
        return sorted(set(self.received[topic][0]))

    def latched(self, topic, wanted, timeout):
        messages = self.listen(topic, Bool, latched=True)
        try:
            self.until(lambda: messages and messages[-1] is wanted, timeout, f'{topic} {wanted}')
        except Failed as failure:   # who did not hear whom?
            raise Failed(f'{failure}: heard {list(messages)}, publishers that are known: '
                         f'{self.node.count_publishers(topic)}') from None

    def flashed(self, topic, timeout):
        messages = self.listen(topic, Bool, latched=True)
        self.until(lambda: True in messages, timeout, f'{topic} True, however short')

    def rest(self, seconds, timeout):
        deadline = clock().now() + seconds
        while clock().now() < deadline:
            self.spin(0.02)

    def diagnostics(self, name, conditions, timeout):
        found = {}

        def look():
            while self.statuses:
                status = self.statuses.pop(0)
                facts = {pair.key: pair.value for pair in status.values}
                facts.update(level=str(status.level[0]), message=status.message)
                if status.name == name and all(
                        re.search(pattern, facts[key]) for key, pattern in conditions.items()):
                    found.update(facts)
            return bool(found)
        self.spin(0.0)
        self.statuses.clear()
        self.until(look, timeout, f'diagnostics of {name} with {conditions}')
        return found

    def listen_to_log(self, timeout):
        self.log = []
        self.logs.append(self.node.create_subscription(
            Log, '/rosout', lambda message: self.log.append(message.msg), QoSProfile(depth=1000)))

    def logged(self, text, timeout):
        self.until(lambda: any(text in line for line in self.log), timeout, f'{text} in the log')

    # -- services ---------------------------------------------------------------------------------

    def call(self, kind, name, request, timeout, **options):
        service = self.known(kind, name, timeout, **options)
        future = service.call_async(request)
        self.until(future.done, timeout, f'the answer of {name}')
        return future.result()

    def known(self, kind, name, timeout, **options):
        """Return a client that can be answered."""
        if name not in self.services:
            self.services[name] = self.node.create_client(kind, name, **options)
        service = self.services[name]
        self.until(service.service_is_ready, timeout, f'the service {name}')
        # before each call: the bridge may be another process than last time
        deadline = clock().now() + timeout

        def wait(condition, seconds):
            end = clock().now() + seconds
            while not condition() and clock().now() < end:
                if clock().now() > deadline:
                    raise Failed(f'waited {timeout:g} s for any answer of the node of {name}')
                self.spin(0.02)
            return condition()
        shake_hands(self.node, name, wait)
        return service

    def get(self, drive, names, timeout):
        answer = self.call(GetParameters, f'{drive}/get_parameters',
                           GetParameters.Request(names=names), timeout,
                           qos_profile=qos_profile_parameters)
        return [from_message(value) for value in answer.values]

    def set(self, drive, values, timeout):
        request = SetParameters.Request(parameters=to_messages(values))
        answer = self.call(SetParameters, f'{drive}/set_parameters', request, timeout,
                           qos_profile=qos_profile_parameters)
        return [(result.successful, result.reason) for result in answer.results]

    def set_atomically(self, drive, values, timeout):
        request = SetParametersAtomically.Request(parameters=to_messages(values))
        answer = self.call(SetParametersAtomically, f'{drive}/set_parameters_atomically', request,
                           timeout, qos_profile=qos_profile_parameters)
        return [(answer.result.successful, answer.result.reason)]

    def control(self, service, wanted, timeout):
        if wanted is None:
            answer = self.call(Trigger, service, Trigger.Request(), timeout)
        else:
            answer = self.call(SetBool, service, SetBool.Request(data=wanted), timeout)
        return answer.success, answer.message

    def meet(self, service, timeout):
        self.known(Trigger, service, timeout)

    def control_again(self, service, timeout):
        begun = clock().now()
        future = self.services[service].call_async(Trigger.Request())
        self.until(future.done, timeout, f'the answer of {service}')
        answer = future.result()
        return answer.success, answer.message, clock().now() - begun

    def transition(self, node, number, timeout):
        request = ChangeState.Request()
        request.transition.id = number
        return self.call(ChangeState, f'{node}/change_state', request, timeout).success


def to_messages(values):
    messages = []
    for name, value in values.items():
        message = ParameterValue()
        if isinstance(value, bool):
            message.type, message.bool_value = ParameterType.PARAMETER_BOOL, value
        elif isinstance(value, int):
            message.type, message.integer_value = ParameterType.PARAMETER_INTEGER, value
        elif isinstance(value, float):
            message.type, message.double_value = ParameterType.PARAMETER_DOUBLE, value
        else:
            message.type, message.string_value = ParameterType.PARAMETER_STRING, value
        messages.append(Parameter(name=name, value=message))
    return messages


def from_message(value):
    return {ParameterType.PARAMETER_BOOL: value.bool_value,
            ParameterType.PARAMETER_INTEGER: value.integer_value,
            ParameterType.PARAMETER_DOUBLE: value.double_value,
            ParameterType.PARAMETER_STRING: value.string_value}.get(value.type)


def read_lines(lines, told):
    for line in itertools.chain(sys.stdin, [None]):
        lines.put(line)
        told.trigger()


def serve(client):
    lines = queue.SimpleQueue()
    told = client.node.create_guard_condition(lambda: None)
    threading.Thread(target=read_lines, args=(lines, told), daemon=True).start()
    while True:
        try:
            line = lines.get_nowait()
        except queue.Empty:
            client.spin(1.0)
            continue
        if line is None:
            return
        arguments = json.loads(line)
        try:
            answer = {'result': getattr(client, arguments.pop('action'))(**arguments)}
        except Failed as failure:
            answer = {'failure': str(failure)}
        print(json.dumps(answer), flush=True)


def main():
    rclpy.init()
    with until_told_to_end():
        serve(Client(rclpy.create_node('system_test_client')))


if __name__ == '__main__':
    main()
