#!/usr/bin/env bash
# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
#
# python-can 4.6.1 (4.3.1 alike), interface "seeedstudio": an adapter that was unplugged is never noticed.
#
# SeeedBus._recv_internal catches pyserial's SerialException ("device reports readiness to read but
# returned no data") at the first byte of a packet, and returns (None, False), as for a quiet bus: at
# once, each time, whatever time-out was asked for. recv() raises nothing, and a reader spins.
#
# Shown with a pseudo-terminal whose other end is closed; pyserial 3.5. Output seen:
#   4.6.1: 1000 looks of 1 s each took 0.0 s, all without a frame, none raised
# Exit code 0: still so; 1: the behaviour has changed (an error is raised, or the looks wait);
# 77: the packages cannot be installed.
set -eu
folder=$(mktemp -d) || exit 77
trap 'rm -rf "$folder"' EXIT
for version in 4.6.1; do
  python3 -m venv "$folder/$version" || exit 77
  "$folder/$version/bin/pip" install --quiet "python-can==$version" pyserial==3.5 || exit 77
  "$folder/$version/bin/python" - <<'PYTHON'
import os
import sys
import time
import tty

import can
from can.interfaces.seeedstudio import SeeedBus

far, near = os.openpty()
tty.setraw(near)
bus = SeeedBus(os.ttyname(near), bitrate=125000)
os.close(near)
os.close(far)
began, raised = time.monotonic(), 0
for _ in range(1000):
    try:
        assert bus._recv_internal(1.0)[0] is None
    except can.CanError:
        raised += 1
took = time.monotonic() - began
print(f'{can.__version__}: 1000 looks of 1 s each took {took:.1f} s, all without a frame, '
      f'{raised or "none"} raised')
bus._is_shutdown = True
sys.exit(raised > 0 or took > 50.0)
PYTHON
done
