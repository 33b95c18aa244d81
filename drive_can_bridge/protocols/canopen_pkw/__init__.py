# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The PKW mailbox over CANopen PDO4, as Schneider's TeSys T motor controllers (LTMR) have it."""
