# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What bridges and their drives look like from outside, by what any ROS node can see of them.

The model (:mod:`.model`) takes what arrives and gives a snapshot (:mod:`.snapshot`) of frozen
values; time is an argument. Nothing here knows ROS, a terminal or a browser.
"""
