# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Start the bridge.

.. code-block:: console

    ros2 launch drive_can_bridge bridge.launch.py params_file:=/path/to/bridge.yaml
    ros2 launch drive_can_bridge bridge.launch.py params_file:=… namespace:=cell

The bridge is a managed node that configures and activates itself unless its parameter file says
``autostart: false``; then whoever manages it sends the transitions, for example with
``ros2 lifecycle set /drive_can_bridge configure``. On Ctrl-C it stops the drives before it ends,
which takes some cycles: launch waits five seconds before it gets impatient.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode


def generate_launch_description() -> LaunchDescription:
    """Describe the launch."""
    return LaunchDescription([
        DeclareLaunchArgument(
            'params_file',
            description='ROS parameter file with buses and drives'),
        DeclareLaunchArgument(
            'namespace', default_value='',
            description='namespace of the bridge and of all its drives'),
        DeclareLaunchArgument(
            'name', default_value='drive_can_bridge',
            description='name of the bridge; the parameter file has to have a section for it. '
                        'The drives keep their names'),
        DeclareLaunchArgument(
            'log_level', default_value='info',
            description='debug, info, warn, error or fatal'),
        # A lifecycle action, so that event handlers may match its transitions. It sends none
        # by itself.
        LifecycleNode(
            package='drive_can_bridge',
            executable='drive_can_bridge',
            name=LaunchConfiguration('name'),
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('params_file')],
            ros_arguments=['--log-level', LaunchConfiguration('log_level')],
            output='screen',
            emulate_tty=True,
        ),
    ])
