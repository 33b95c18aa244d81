# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``~/home`` of a servo drive: offered where it was asked for, answered when the axis is there."""

import math

from bridges import parameters, StartBridge
from clients import Client
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from drive_can_bridge.core import sentences

AXIS = {'bus': 'main', 'protocol': 'cia402', 'station': 1, 'profile': 'cia402_servo',
        'mode': 'csp', 'period': 0.02, 'cyclic_request': ['target_position'],
        'cyclic_response': ['actual_position'], 'missed_limit': 100, 'parameter_timeout': 2.0,
        'control_timeout': 30.0, 'heartbeat_timeout': 0.0, 'bridge_heartbeat': 5.0}


def test_home(bridge: StartBridge, client: Client) -> None:
    bridge(parameters(slide={**AXIS, 'homing': True})).online('slide')
    refused = client.call('/slide/home', Trigger)
    assert (refused.success, refused.message) == (False, sentences.homing_needs_enabled())
    assert client.call('/slide/enable', SetBool, SetBool.Request(data=True)).success
    homed = client.call('/slide/home', Trigger)
    assert (homed.success, homed.message) == (True, sentences.homed())


def test_only_where_it_was_asked_for(bridge: StartBridge, client: Client) -> None:
    bridge(parameters(slide=AXIS)).online('slide')
    client.service('/slide/enable', SetBool)
    names = client.node.get_service_names_and_types_by_node('slide', '/')
    assert '/slide/home' not in dict(names)


def test_a_joint_that_turns_on_and_on_begins_again_where_it_was_homed(
        bridge: StartBridge, client: Client) -> None:
    joint = {'name': 'turntable', 'position': 'actual_position', 'continuous': True,
             'velocity_command': 'target_velocity'}
    one = bridge(parameters(slide={
        **AXIS, 'homing': True, 'mode': 'csv', 'cyclic_request': ['target_velocity'],
        'missed_limit': 3, 'joint': joint})).online('slide')
    client.listen()
    positions = client.topic('/slide/joint_state', JointState)
    assert client.call('/slide/enable', SetBool, SetBool.Request(data=True)).success
    one.played['slide'].set_value('home_offset', 0.25)
    assert client.call('/slide/home', Trigger).success
    client.wait_logged('the position of turntable begins again at ')
    positions.wait(lambda m: math.isclose(m.position[0], math.pi / 2, abs_tol=0.05))
