# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Start simulated drives, a bridge for them and a monitor of both, on pseudo-terminals.

.. code-block:: console

    ros2 launch drive_can_bridge demo.launch.py
    ros2 launch drive_can_bridge demo.launch.py drive:=true fault:=lift:silent

Prints one line per drive and second. ``drive_can demo`` in a terminal has a live view instead.
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.substitutions import ExecutableInPackage


def generate_launch_description() -> LaunchDescription:
    """Describe the launch."""
    return LaunchDescription([
        DeclareLaunchArgument(
            'params_file', default_value='',
            description='ROS parameter file with buses and drives, whose buses are replaced; '
                        "without one, the demo's own"),
        DeclareLaunchArgument(
            'drive', default_value='false',
            description='true: the demo commands the drives, too'),
        DeclareLaunchArgument(
            'fault', default_value='',
            description='faults to begin with, DRIVE:FAULT, several with spaces between them'),
        DeclareLaunchArgument(
            'log_frames', default_value='',
            description='file for every frame, as candump -L writes it'),
        OpaqueFunction(function=demo),
    ])


def demo(context: LaunchContext) -> list[ExecuteProcess]:
    """Turn the arguments into those of ``drive_can demo``, which is no ROS executable."""
    command = [ExecutableInPackage(executable='drive_can', package='drive_can_bridge'), 'demo']
    for option, name in (('--params-file', 'params_file'), ('--log-frames', 'log_frames')):
        value = LaunchConfiguration(name).perform(context)
        if value:
            command += [option, value]
    for fault in LaunchConfiguration('fault').perform(context).split():
        command += ['--fault', fault]
    if IfCondition(LaunchConfiguration('drive')).evaluate(context):
        command.append('--drive')
    return [ExecuteProcess(cmd=command, output='screen')]
