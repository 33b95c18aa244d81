# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""CANnord, the protocol of NORD inverters on CAN (manual BU 0060)."""
