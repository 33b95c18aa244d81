#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# An integer that is put into a float64 field of a ROS message is published as a subnormal number
# or as NaN, without an error: Float64(data=300) arrives as 5e-324, data=-300 as nan.
#
# Seen with: rclpy of ros-rclpy 7.1.6 and ros-common-interfaces 5.3.6 (Jazzy), Python 3.11.7,
# Linux x86_64. Setters check types only with check_fields=True or ROS_PYTHON_CHECK_FIELDS=1; what
# arrives looks like the word of the integer object that stands where a float has its value. For one
# who commands a motor it is a setpoint of nearly 0 instead of 300: what takes commands should
# refuse subnormal numbers, and ROS_PYTHON_CHECK_FIELDS=1 shows it at the publisher.
#
# Output seen:
#   300 arrives as 5e-324
#   -300 arrives as nan
#   300.0 arrives as 300.0
#
# Exit code 0: still so; 1: it behaves otherwise; 77: the packages cannot be installed.
set -u -o pipefail

folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" && "$folder/venv/bin/python" -m pip --quiet \
  --disable-pip-version-check install 'ros-rclpy[fastrtps]==7.1.6' \
  'ros-common-interfaces==5.3.6' || exit 77
exec "$folder/venv/bin/python" - <<'PYTHON'
import math
import sys

from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64


def arrives(value):
    found = deserialize_message(serialize_message(Float64(data=value)), Float64).data
    print(f'{value} arrives as {found}')
    return found


found = arrives(300), arrives(-300), arrives(300.0)
small = sys.float_info.min
same = 0.0 < found[0] < small and (
    math.isnan(found[1]) or 0.0 < abs(found[1]) < small) and found[2] == 300.0
sys.exit(0 if same else 1)
PYTHON
