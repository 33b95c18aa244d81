# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A client without manners: everything at once, and as fast as it can.

``flood_client.py ACTION ARGUMENTS``; it says ``ready`` when it begins, and prints one JSON object
at its end. Started by the tests in this directory.

========================= =====================================================================
calls DRIVE COUNT         so many calls of GetParameters in flight at the same time
commands TOPIC SECONDS    publishes as fast as it can, about 10,000 times a second; ends with 25.0
parameters DRIVE SECONDS  writes and reads parameters, each call as soon as the last is answered
========================= =====================================================================
"""

import json
import sys
import time

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
import rclpy
from rclpy.qos import qos_profile_parameters, QoSProfile
from service_handshake import shake_hands
from std_msgs.msg import Float64

#: s after which an answer will not come any more
PATIENCE = 600.0


def until(node, condition, patience=PATIENCE):
    deadline = time.monotonic() + patience
    while not condition() and time.monotonic() < deadline:
        rclpy.spin_once(node, timeout_sec=0.05)
    return condition()


def service(node, kind, name):
    client = node.create_client(kind, name, qos_profile=qos_profile_parameters)
    client.wait_for_service(PATIENCE)
    shake_hands(node, name, lambda condition, seconds: until(node, condition, seconds))
    return client


def calls(node, drive, count):
    client = service(node, GetParameters, f'{drive}/get_parameters')
    print('ready', flush=True)
    answered = []
    futures = []
    for number in range(int(count)):
        future = client.call_async(GetParameters.Request(names=['ramp_time']))
        future.add_done_callback(lambda _, number=number: answered.append(number))
        futures.append(future)
    until(node, lambda: len(answered) == len(futures))
    values = {number: futures[number].result().values[0] for number in answered}
    served = [number for number in answered
              if values[number].type == ParameterType.PARAMETER_DOUBLE]
    refused = [number for number in answered
               if values[number].type == ParameterType.PARAMETER_NOT_SET]
    return {'answered': len(answered), 'served': len(served), 'refused': len(refused),
            'in_order': served == sorted(served) and refused == sorted(refused),
            'values': sorted({values[number].double_value for number in served})}


def publisher_of(node, topic):
    publisher = node.create_publisher(Float64, topic, QoSProfile(depth=10))
    until(node, publisher.get_subscription_count)
    print('ready', flush=True)
    return publisher


def commands(node, topic, seconds):
    publisher = publisher_of(node, topic)
    message = Float64(data=0.0)
    count = 0
    begin = time.monotonic()
    while True:
        elapsed = time.monotonic() - begin
        if elapsed >= float(seconds):
            break
        message.data = float(count % 100)
        publisher.publish(message)
        count += 1
        if count > 10_000 * elapsed:
            time.sleep(0.0005)
    message.data = 25.0
    for _ in range(10):
        publisher.publish(message)
        time.sleep(0.02)
    return {'published': count}


def parameters(node, drive, seconds):
    get = service(node, GetParameters, f'{drive}/get_parameters')
    write = service(node, SetParameters, f'{drive}/set_parameters')
    names = ['speed_gain', 'ramp_time', 'jog_speed', 'maximum_speed']
    print('ready', flush=True)
    rounds = failed = wrong = 0
    constant = None
    begin = time.monotonic()
    while time.monotonic() - begin < float(seconds):
        gain, jog = (rounds % 1000) * 0.001, -0.1 * (rounds % 3000)
        values = [ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
                  for value in (gain, jog)]
        writing = write.call_async(SetParameters.Request(parameters=[
            Parameter(name=name, value=value)
            for name, value in zip(('speed_gain', 'jog_speed'), values)]))
        until(node, writing.done)
        reading = get.call_async(GetParameters.Request(names=names))
        until(node, reading.done)
        failed += sum(not result.successful for result in writing.result().results)
        answer = [value.double_value if value.type == ParameterType.PARAMETER_DOUBLE else None
                  for value in reading.result().values]
        failed += answer.count(None)
        if None not in answer:
            constant = constant or (answer[1], answer[3])
            wrong += abs(answer[0] - gain) > 1e-6 or abs(answer[2] - jog) > 1e-6
            wrong += (answer[1], answer[3]) != constant
        rounds += 1
    return {'rounds': rounds, 'failed': failed, 'wrong': wrong}


ACTIONS = {'calls': calls, 'commands': commands, 'parameters': parameters}


def main():
    rclpy.init()
    node = rclpy.create_node('flood_client')
    result = ACTIONS[sys.argv[1]](node, *sys.argv[2:])
    print(json.dumps(result), flush=True)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
