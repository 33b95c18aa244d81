# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What to tell a user whose Python cannot import what a subcommand needs."""

_NO_ROS = ('{command}: needs ROS 2 (Python module {module}): source your installation '
           "(/opt/ros/jazzy/setup.bash), or get it as wheels with the extra 'ros' of this package "
           "(pip install '.[ros]')")


def what_is_missing(command: str, error: ImportError) -> str:
    """Say what to install."""
    module = error.name or str(error)
    if module.startswith('drive_can_bridge'):
        return f'{command}: {error}'
    if module.partition('.')[0] in ('can', 'yaml', 'jsonschema'):
        return f'{command}: the Python module {module} is not installed'
    return _NO_ROS.format(command=command, module=module)
