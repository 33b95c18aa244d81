# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The argument of ``--namespace``."""

import argparse

from drive_can_bridge.monitor.text import is_ros_name


def namespace(text: str) -> str:
    """Read ``/cell1``, or ``cell1``; '' for the root."""
    name = f'/{text.strip("/")}'
    if name != '/' and not is_ros_name(name):
        raise argparse.ArgumentTypeError(f'{text!r} is no namespace, write /cell1')
    return name if name != '/' else ''
