# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Start a bridge, ros2_control and what publishes the robot's transforms.

.. code-block:: console

    ros2 launch drive_can_bridge ros2_control.launch.py robot:=arm
    ros2 service call /shoulder/enable std_srvs/srv/SetBool '{data: true}'      # and the others
    ros2 control switch_controllers --activate arm_controller

The controller is loaded, but not activated: drives are enabled first, by somebody who looks at the
machine. docs/ros2_control.md goes through it. Needs the packages ros2_control, ros2_controllers,
joint_state_topic_hardware_interface and robot_state_publisher.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node
from launch_ros.substitutions import FindPackageShare

#: names of the topics in the robot description
REMAPPINGS = [('~/joint_states', '/robot_joint_states'),
              ('~/joint_commands', '/robot_joint_commands')]


def generate_launch_description() -> LaunchDescription:
    """Describe the launch."""
    return LaunchDescription([
        DeclareLaunchArgument(
            'robot', default_value='arm',
            description='which files of the directory: NAME.yaml of the bridge, NAME.urdf, '
                        'NAME_controllers.yaml'),
        DeclareLaunchArgument(
            'directory', default_value='',
            description="where they are; without one, the package's own examples"),
        DeclareLaunchArgument(
            'params_file', default_value='',
            description="parameter file of the bridge instead of the directory's"),
        DeclareLaunchArgument(
            'controller', default_value='',
            description='the controller that is loaded, inactive; without one, ROBOT_controller'),
        DeclareLaunchArgument(
            'log_level', default_value='info',
            description='of the bridge: debug, info, warn, error or fatal'),
        OpaqueFunction(function=robot),
    ])


def robot(context: LaunchContext) -> list[Node]:
    """Describe the nodes, once it is known which files are meant."""
    directory = LaunchConfiguration('directory').perform(context) or str(
        Path(FindPackageShare('drive_can_bridge').perform(context), 'config', 'ros2_control'))
    name = LaunchConfiguration('robot').perform(context)
    controller = LaunchConfiguration('controller').perform(context) or f'{name}_controller'
    params_file = (LaunchConfiguration('params_file').perform(context)
                   or str(Path(directory, f'{name}.yaml')))
    description = Path(directory, f'{name}.urdf').read_text(encoding='utf-8')
    return [
        LifecycleNode(
            package='drive_can_bridge', executable='drive_can_bridge', name='drive_can_bridge',
            namespace='', parameters=[params_file], remappings=REMAPPINGS,
            ros_arguments=['--log-level', LaunchConfiguration('log_level')],
            output='screen', emulate_tty=True),
        # its joint states are those of joint_state_broadcaster
        Node(package='robot_state_publisher', executable='robot_state_publisher',
             parameters=[{'robot_description': description}], output='screen'),
        Node(package='controller_manager', executable='ros2_control_node',
             parameters=[str(Path(directory, f'{name}_controllers.yaml'))],
             remappings=[('~/robot_description', '/robot_description')], output='screen'),
        Node(package='controller_manager', executable='spawner',
             arguments=['joint_state_broadcaster'], output='screen'),
        Node(package='controller_manager', executable='spawner',
             arguments=[controller, '--inactive'], output='screen'),
    ]
