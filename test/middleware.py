# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How the middleware of a test process is set up, where bridges and their clients are together.

Fast DDS tells the participants of one process of each other's endpoints by calling one from within
the other. When several come and go at once on a busy machine, one of them now and then never
learns of what another one publishes: its services get no request of that one, for ever. Between
processes, which is how everybody but these tests uses it, that way does not exist. So here, too,
what there is gets told in messages.
"""

from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
import os
from pathlib import Path


def _variable() -> str:
    """Return what the Fast DDS of this ROS reads, of which nothing may be loaded yet."""
    try:
        rclpy = version('rclpy')
    except PackageNotFoundError:    # no ROS here
        rclpy = '0'
    since_kilted = int(rclpy.partition('.')[0]) >= 8
    return f'{"FASTDDS" if since_kilted else "FASTRTPS"}_DEFAULT_PROFILES_FILE'


_VARIABLE = _variable()
_PROFILES = str(Path(__file__).with_name('fastdds.xml'))


def tell_in_messages() -> None:
    """Set this process up, before anything of ROS is imported; a file of the user's wins."""
    os.environ.setdefault(_VARIABLE, _PROFILES)


def as_users_have_it() -> Mapping[str, str]:
    """Return the environment of processes that are started: none of this."""
    return {name: value for name, value in os.environ.items()
            if (name, value) != (_VARIABLE, _PROFILES)}
