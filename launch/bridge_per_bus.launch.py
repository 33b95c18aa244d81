# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Start a bridge of its own for each bus of one parameter file: each has a processor core.

.. code-block:: console

    ros2 launch drive_can_bridge bridge_per_bus.launch.py params_file:=/path/to/bridge.yaml

One process serves all buses of its parameter file, and its threads share one interpreter: two
buses of 1 Mbit/s that are full keep more than a core busy. Here the drives keep their names,
topics and services; the bridges are called ``drive_can_bridge_BUS`` (``_`` for ``-``), and each
has the diagnostics and the ``~/joint_states`` of its own drives only. ``drive_can`` and the panel
take them together. On Ctrl-C each of them stops its drives.
"""

from pathlib import Path
import tempfile

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode

from drive_can_bridge.configuration.load import (
    bridge_names, configuration_from_file, of_one_bus, write_parameter_file,
)


def generate_launch_description() -> LaunchDescription:
    """Describe the launch."""
    return LaunchDescription([
        DeclareLaunchArgument(
            'params_file',
            description='ROS parameter file with buses and drives'),
        DeclareLaunchArgument(
            'namespace', default_value='',
            description='namespace of the bridges and of all drives'),
        DeclareLaunchArgument(
            'log_level', default_value='info',
            description='debug, info, warn, error or fatal'),
        OpaqueFunction(function=_bridges),
    ])


def _bridges(context: LaunchContext) -> list[LifecycleNode]:
    configuration = configuration_from_file(LaunchConfiguration('params_file').perform(context))
    # stays until the machine is restarted: a bridge may be started anew by whoever watches it
    folder = Path(tempfile.mkdtemp(prefix='drive_can_'))
    bridges = []
    for bus, name in bridge_names(configuration.buses).items():
        file = folder / f'{bus}.yaml'
        write_parameter_file(of_one_bus(configuration, bus), file, name)
        bridges.append(LifecycleNode(
            package='drive_can_bridge',
            executable='drive_can_bridge',
            name=name,
            namespace=LaunchConfiguration('namespace'),
            parameters=[str(file)],
            ros_arguments=['--log-level', LaunchConfiguration('log_level')],
            output='screen',
            emulate_tty=True,
        ))
    return bridges
