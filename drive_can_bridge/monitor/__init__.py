# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What bridges and their drives look like from outside, to any ROS node.

The model (:mod:`.model`) is fed with what arrives and returns a snapshot (:mod:`.snapshot`) of
frozen values; time is an argument. Nothing here knows ROS, a terminal or a browser.
"""
