#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# One ROS 2 parameter file has two meanings: --params-file is read by rcl (C), "ros2 param load" by
# rclpy.parameter.parameter_dict_from_yaml_file (PyYAML). They give the same plain scalar another
# value or type, without a word: 1e6 is a number or a string, y a bool or a string, 08 is 8.0 or a
# string, 1:30 a string or 90, 1_000 a string or 1000.
#
# Seen with: rclpy of ros-rclpy 7.1.6 and ros-common-interfaces 5.3.6 (Jazzy), PyYAML 6.0.4, Python
# 3.11.7, Linux x86_64. A configuration checker has to read as rcl does; a writer has to quote what
# rcl takes for something else. Numbers with both a dot and a sign in the exponent (1.0e+6), hexadecimal
# ones and quoted strings mean the same to both.
#
# Output seen (rcl; rclpy):
#   1e6      1000000.0; '1e6'
#   y        True; 'y'
#   08       8.0; '08'
#   1:30     '1:30'; 90
#   1_000    '1_000'; 1000
#   0b101    '0b101'; 5
#   nan      nan; 'nan'
#   1.0e+6   1000000.0; 1000000.0
#   0x10     16; 16
#   'y'      'y'; 'y'
#
# Exit code 0: still so; 1: it behaves otherwise; 77: the packages cannot be installed.
set -u -o pipefail

folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv" && "$folder/venv/bin/python" -m pip --quiet \
  --disable-pip-version-check install 'ros-rclpy[fastrtps]==7.1.6' \
  'ros-common-interfaces==5.3.6' 'PyYAML==6.0.4' || exit 77
cd "$folder" || exit 1
export ROS_AUTOMATIC_DISCOVERY_RANGE=OFF ROS_LOG_DIR=$folder
exec "$folder/venv/bin/python" - <<'PYTHON'
import sys

import rclpy
from rclpy.node import Node
from rclpy.parameter import parameter_dict_from_yaml_file, parameter_value_to_python

SCALARS = ['1e6', 'y', '08', '1:30', '1_000', '0b101', 'nan', '1.0e+6', '0x10', "'y'"]
with open('parameters.yaml', 'w', encoding='utf-8') as file:
    file.write('/**:\n  ros__parameters:\n')
    file.writelines(f'    p{place}: {scalar}\n' for place, scalar in enumerate(SCALARS))

rclpy.init(args=['--ros-args', '--params-file', 'parameters.yaml'])
node = Node('reader', automatically_declare_parameters_from_overrides=True)
loaded = parameter_dict_from_yaml_file('parameters.yaml', True)
different = []
for place, scalar in enumerate(SCALARS):
    by_rcl = node.get_parameter(f'p{place}').value
    by_rclpy = parameter_value_to_python(loaded[f'p{place}'].value)
    print(f'{scalar:8} {by_rcl!r}; {by_rclpy!r}')
    if repr(by_rcl) != repr(by_rclpy):
        different.append(scalar)
rclpy.shutdown()
sys.exit(0 if different == SCALARS[:7] else 1)
PYTHON
