# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The parameters of drives for people and scripts: directly, or through a running bridge.

.. code-block:: python

    from drive_can_bridge.client import open_drives

    with open_drives('robot.yaml') as drives:
        print(drives['conveyor'].read('ramp_time')['ramp_time'].value)

See :mod:`drive_can_bridge.client.drive` for what a drive can be asked.
"""

from drive_can_bridge.client.opening import find_source as find_source
from drive_can_bridge.client.opening import open_drives as open_drives
