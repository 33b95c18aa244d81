# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The parameters of drives for people and scripts: directly, or through a running bridge.

.. code-block:: python

    from drive_can_bridge.client import DriveCanError, open_drives

    try:
        with open_drives('robot.yaml') as drives:
            print(drives['conveyor'].read('ramp_time')['ramp_time'].value)
    except DriveCanError as error:
        print(error)

See :mod:`drive_can_bridge.client.drive` for what a drive can be asked.
"""

from drive_can_bridge.client.drive import Drive, Drives, Enabled, ReadOutcome, WriteOutcome
from drive_can_bridge.client.opening import find_source, open_drives
from drive_can_bridge.core.errors import DriveCanError

__all__ = ['Drive', 'DriveCanError', 'Drives', 'Enabled', 'ReadOutcome', 'WriteOutcome',
           'find_source', 'open_drives']
