#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# Programs of ROS 2 Jazzy and Kilted on one host have no shared memory in common, although both have
# shared memory: Fast DDS 2 calls its files in /dev/shm fastrtps_*, Fast DDS 3 fastdds_*. Where shared
# memory is all that is allowed, they never meet; as they come they talk over UDP.
#
# Seen with: ros-rclpy 7.1.6 (Fast DDS 2.14.5), ros-rclpy 9.1.2 (Fast DDS 3.2.3), Python 3.11.7,
# Linux x86_64. FASTDDS_BUILTIN_TRANSPORTS=SHM, and ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET (with
# LOCALHOST ROS adds UDP of its own). Who mixes distributions on a robot pays for UDP, and gets
# nothing at all from a set-up of shared memory alone that works within each.
#
# Output seen:
#   jazzy to jazzy, SHM: arrives
#   kilted to kilted, SHM: arrives
#   jazzy to kilted, SHM: nothing
#   jazzy to kilted, UDPv4: arrives
#
# Exit code 0: still so; 1: it behaves otherwise; 77: the packages cannot be installed.
set -u -o pipefail

folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
for each in jazzy=7.1.6=5.3.6 kilted=9.1.2=5.5.1; do
  IFS='=' read -r name rclpy messages <<<"$each"
  python3 -m venv "$folder/$name" && "$folder/$name/bin/python" -m pip --quiet \
    --disable-pip-version-check install --no-compile "ros-rclpy[fastrtps]==$rclpy" \
    "ros-std-msgs==$messages" || exit 77
done
cat >"$folder/end.py" <<'PYTHON'
import sys
import time

import rclpy
from std_msgs.msg import String

rclpy.init()
node = rclpy.create_node(sys.argv[1])
if sys.argv[1] == 'talker':
    publisher = node.create_publisher(String, 'chatter', 10)
    node.create_timer(0.1, lambda: publisher.publish(String(data='x')))
    rclpy.spin(node)
heard = []
node.create_subscription(String, 'chatter', heard.append, 10)
end = time.monotonic() + 30.0
while not heard and time.monotonic() < end:
    rclpy.spin_once(node, timeout_sec=0.1)
print('arrives' if heard else 'nothing', flush=True)
PYTHON

export ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET ROS_DOMAIN_ID=$((RANDOM % 90 + 10))
unset LD_LIBRARY_PATH PYTHONPATH RMW_IMPLEMENTATION
code=0
# talk FROM TO TRANSPORT EXPECTED
talk() {
  local found talker
  export FASTDDS_BUILTIN_TRANSPORTS=$3
  "$folder/$1/bin/python" "$folder/end.py" talker >/dev/null 2>&1 &
  talker=$!
  found=$("$folder/$2/bin/python" "$folder/end.py" listener 2>/dev/null)
  kill "$talker"
  wait "$talker" 2>/dev/null
  echo "$1 to $2, $3: $found"
  [ "$found" = "$4" ] || code=1
}

talk jazzy jazzy SHM arrives
talk kilted kilted SHM arrives
talk jazzy kilted SHM nothing
talk jazzy kilted UDPv4 arrives
exit "$code"
