# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
# The executables of this package by their names; path.dsv says the same to a workspace's setup.*.
_colcon_prepend_unique_value PATH "$COLCON_CURRENT_PREFIX/lib/drive_can_bridge"
