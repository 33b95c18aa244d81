# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Run the benches; all arguments go to :mod:`exchange`."""

import os
import sys

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('ROS_DOMAIN_ID', '97')

if __name__ == '__main__':
    import exchange
    sys.exit(exchange.main())
