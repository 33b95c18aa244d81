#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# rosbags 0.11.9 refuses what rclpy's serialize_message makes of a JointState whose last arrays are empty: behind the
# message are bytes that are not its own.
#
# With Fast DDS serialize_message returns as many bytes as were reckoned beforehand, and the reckoning aligns the
# elements of an empty float64[], of which there are none: here eight bytes are left over, and eight for each value of
# a ParameterEvent. deserialize_message passes over them, rosbags passes over three and raises
# SerdeError. What a publisher makes of a message has the right length; bags that a node writes itself with
# serialize_message, and topics that are published as its bytes, have not. What deserialize_message can do without at
# the end may be cut off.
#
# Seen with: rclpy of ros-rclpy 7.1.6 and ros-common-interfaces 5.3.6 (Jazzy; the lengths are those of ros-rclpy 9.1.2,
# Kilted, too), Fast DDS 2.14.5, Python 3.11.7, Linux x86_64.
#
# Output seen:
#   velocity [], effort []: rclpy 60 bytes, rosbags 52, rosbags reads rclpy's: SerdeError
#   velocity [2.0], effort [3.0]: rclpy 76 bytes, rosbags 76, rosbags reads rclpy's: position 1.0
#
# Exit code 0: still so; 1: it behaves otherwise; 77: the packages cannot be installed.
set -u -o pipefail

folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" && "$folder/venv/bin/python" -m pip --quiet \
  --disable-pip-version-check install 'ros-rclpy[fastrtps]==7.1.6' \
  'ros-common-interfaces==5.3.6' 'rosbags==0.11.9' || exit 77
unset RMW_IMPLEMENTATION
exec "$folder/venv/bin/python" - <<'PYTHON'
import sys

import numpy
from rclpy.serialization import serialize_message
from rosbags.serde.errors import SerdeError
from rosbags.typesys import get_typestore, Stores
from sensor_msgs.msg import JointState

TYPE = 'sensor_msgs/msg/JointState'
store = get_typestore(Stores.ROS2_JAZZY)
kinds = {kind.rpartition('/')[2]: store.types[kind] for kind in (
    TYPE, 'std_msgs/msg/Header', 'builtin_interfaces/msg/Time')}
found = []
for velocity, effort in (([], []), ([2.0], [3.0])):
    data = serialize_message(JointState(name=['a'], position=[1.0], velocity=velocity, effort=effort))
    own = store.serialize_cdr(kinds['JointState'](
        kinds['Header'](kinds['Time'](0, 0), ''), ['a'],
        *(numpy.array(values) for values in ([1.0], velocity, effort))), TYPE)
    try:
        read = f'position {store.deserialize_cdr(data, TYPE).position[0]}'
    except SerdeError:
        read = 'SerdeError'
    found.append((len(data), len(own), read))
    print(f'velocity {velocity}, effort {effort}: rclpy {len(data)} bytes, rosbags {len(own)}, '
          f"rosbags reads rclpy's: {read}")
sys.exit(found != [(60, 52, 'SerdeError'), (76, 76, 'position 1.0')])
PYTHON
