# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Standard CANopen servo drives, inverters and steppers (CiA 402)."""
