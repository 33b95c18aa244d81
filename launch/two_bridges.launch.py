# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Start two bridges, each with a bus of its own and in a namespace of its own.

.. code-block:: console

    ros2 launch drive_can_bridge two_bridges.launch.py \
        first_params_file:=/path/to/cell1.yaml second_params_file:=/path/to/cell2.yaml

One bridge can have several buses. Two of them have a processor core each, and one may be stopped
without the other. The nodes are ``/cell1/drive_can_bridge`` and ``/cell2/drive_can_bridge``, and
their drives ``/cell1/conveyor`` and so on: a parameter file with the top key
``/**/drive_can_bridge`` fits any namespace.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, ThisLaunchFileDir


def generate_launch_description() -> LaunchDescription:
    """Describe the launch."""
    entities: list[DeclareLaunchArgument | IncludeLaunchDescription] = [
        DeclareLaunchArgument(
            'first_params_file', description='ROS parameter file of the first bridge'),
        DeclareLaunchArgument(
            'second_params_file', description='ROS parameter file of the second bridge'),
        DeclareLaunchArgument(
            'first_namespace', default_value='cell1',
            description='namespace of the first bridge and of its drives'),
        DeclareLaunchArgument(
            'second_namespace', default_value='cell2',
            description='namespace of the second bridge and of its drives'),
        DeclareLaunchArgument(
            'log_level', default_value='info',
            description='debug, info, warn, error or fatal'),
    ]
    source = PathJoinSubstitution([ThisLaunchFileDir(), 'bridge.launch.py'])
    for which in ('first', 'second'):
        entities.append(IncludeLaunchDescription(
            PythonLaunchDescriptionSource(source),
            launch_arguments=[
                ('params_file', LaunchConfiguration(f'{which}_params_file')),
                ('namespace', LaunchConfiguration(f'{which}_namespace')),
                ('log_level', LaunchConfiguration('log_level'))]))
    return LaunchDescription(entities)
