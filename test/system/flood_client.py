# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A client without manners: everything at once, nonsense, and as fast as it can.

``flood_client.py ACTION ARGUMENTS``; it says ``ready`` when it begins, and prints one JSON object
at its end. Started by the tests in this directory.

========================= =====================================================================
calls DRIVE COUNT         so many calls of GetParameters in flight at the same time
commands TOPIC SECONDS    publishes as fast as it can, about 10,000 times a second; ends with 25.0
numbers TOPIC STATUS      publishes what is no setpoint: not finite, absurd
parameters DRIVE SECONDS  writes and reads parameters, each call as soon as the last is answered
requests DRIVE            parameter requests that make no sense
========================= =====================================================================
"""

import json
import math
import sys
import time

from acquaintance import acquaint
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
import rclpy
from rclpy.qos import qos_profile_parameters, QoSProfile
from std_msgs.msg import Float64

#: s after which an answer will not come any more
PATIENCE = 600.0
#: no double, or none that any drive could want
ABSURD = (math.nan, math.inf, -math.inf, 1e308, -1e308, 3000.1, -1e9, 2.0 ** 63)
#: a value like any other: it rounds to 0
TINY = 5e-324


def until(node, condition, patience=PATIENCE):
    deadline = time.monotonic() + patience
    while not condition() and time.monotonic() < deadline:
        rclpy.spin_once(node, timeout_sec=0.05)
    return condition()


def service(node, kind, name):
    client = node.create_client(kind, name, qos_profile=qos_profile_parameters)
    client.wait_for_service(PATIENCE)
    acquaint(node, name, lambda condition, seconds: until(node, condition, seconds))
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


def numbers(node, topic, status):
    """Publish each until it is counted: a bridge that stands still for a moment loses some."""
    refused = [0]

    def look(message):
        for entry in message.status:
            if entry.name == status:
                refused[0] = int(next(
                    pair.value for pair in entry.values if pair.key == 'commands_refused'))
    node.create_subscription(DiagnosticArray, '/diagnostics', look, QoSProfile(depth=50))
    publisher = publisher_of(node, topic)
    publisher.publish(Float64(data=TINY))
    repeated = 0
    for value in ABSURD:
        before = refused[0]
        publisher.publish(Float64(data=value))
        while not until(node, lambda before=before: refused[0] > before, 5.0):
            repeated += 1
            publisher.publish(Float64(data=value))
    return {'refused': len(ABSURD), 'repeated': repeated}


def requests(node, drive):
    get = service(node, GetParameters, f'{drive}/get_parameters')
    write = service(node, SetParameters, f'{drive}/set_parameters')
    print('ready', flush=True)
    names = ['', ' ', '.', 'p', 'p-1', 'p1.', 'p99999999999999999999', 'x.', 'xffffff.ffffff',
             'p65535', 'ramp_time\n', 'Ramp_Time', '\u00fc' * 100, 'a' * 100_000, '%s%n',
             '../../etc/passwd']
    futures = [get.call_async(GetParameters.Request(names=names)),
               get.call_async(GetParameters.Request(names=['nothing'] * 20_000)),
               get.call_async(GetParameters.Request(names=[]))]
    values = [ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
              for value in (*ABSURD, TINY)]
    values += [ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value)
               for value in (-2 ** 63, 2 ** 63 - 1)]
    values += [ParameterValue(), ParameterValue(type=200),
               ParameterValue(type=ParameterType.PARAMETER_STRING, string_value='x' * 100_000),
               ParameterValue(type=ParameterType.PARAMETER_BYTE_ARRAY,
                              byte_array_value=[b'\x01'] * 1000)]
    futures += [write.call_async(SetParameters.Request(
        parameters=[Parameter(name='ramp_time', value=value)])) for value in values]
    until(node, lambda: all(future.done() for future in futures))
    answers = [future.result() for future in futures if future.done()]
    results = [answer.results[0] for answer in answers[3:]]
    return {'answered': len(answers), 'asked': len(futures),
            'lengths': [len(answer.values) for answer in answers[:3]],
            'set': sum(value.type != ParameterType.PARAMETER_NOT_SET
                       for answer in answers[:3] for value in answer.values),
            'successful': sum(result.successful for result in results),
            'unexplained': sum(not result.reason for result in results)}


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


ACTIONS = {'calls': calls, 'commands': commands, 'numbers': numbers, 'parameters': parameters,
           'requests': requests}


def main():
    rclpy.init()
    node = rclpy.create_node('flood_client')
    result = ACTIONS[sys.argv[1]](node, *sys.argv[2:])
    print(json.dumps(result), flush=True)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
