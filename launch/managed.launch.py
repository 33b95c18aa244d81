# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Start the bridge, and lead it through its lifecycle: configure, then activate.

.. code-block:: console

    ros2 launch drive_can_bridge managed.launch.py params_file:=/path/to/bridge.yaml
    ros2 launch drive_can_bridge managed.launch.py params_file:=… activate:=false

Here launch decides when the drives get their first frame, and not the bridge itself. Start from
this file where something has to be ready before the drives: register the event handlers for that
instead of those below. With ``activate:=false`` the bridge waits in state inactive, with its buses
open and its drives in the graph, for ``ros2 lifecycle set /drive_can_bridge activate``.

A configuration that is refused, or fails, ends the launch; the bridge has said why.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler, Shutdown
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessStart
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from lifecycle_msgs.msg import Transition


def generate_launch_description() -> LaunchDescription:
    """Describe the launch."""
    bridge = LifecycleNode(
        package='drive_can_bridge',
        executable='drive_can_bridge',
        name=LaunchConfiguration('name'),
        namespace=LaunchConfiguration('namespace'),
        # the last one counts: whatever the file says, the bridge waits for its transitions
        parameters=[LaunchConfiguration('params_file'), {'autostart': False}],
        ros_arguments=['--log-level', LaunchConfiguration('log_level')],
        output='screen',
        emulate_tty=True,
    )

    def transition(number: int, **condition: IfCondition) -> EmitEvent:
        return EmitEvent(event=ChangeState(lifecycle_node_matcher=matches_action(bridge),
                                           transition_id=number), **condition)

    return LaunchDescription([
        DeclareLaunchArgument(
            'params_file',
            description='ROS parameter file with buses and drives'),
        DeclareLaunchArgument(
            'namespace', default_value='',
            description='namespace of the bridge and of all its drives'),
        DeclareLaunchArgument(
            'name', default_value='drive_can_bridge',
            description='name of the bridge; the parameter file has to have a section for it'),
        DeclareLaunchArgument(
            'log_level', default_value='info',
            description='debug, info, warn, error or fatal'),
        DeclareLaunchArgument(
            'activate', default_value='true',
            description='false: only configure; somebody else activates'),
        # handlers before what they handle
        RegisterEventHandler(OnProcessStart(
            target_action=bridge,
            on_start=[transition(Transition.TRANSITION_CONFIGURE)])),
        RegisterEventHandler(OnStateTransition(
            target_lifecycle_node=bridge, start_state='configuring', goal_state='inactive',
            entities=[transition(Transition.TRANSITION_ACTIVATE,
                                 condition=IfCondition(LaunchConfiguration('activate')))])),
        *(RegisterEventHandler(OnStateTransition(
            target_lifecycle_node=bridge, start_state='configuring', goal_state=refused,
            entities=[Shutdown(reason='the bridge cannot be configured, see above')]))
          for refused in ('unconfigured', 'errorprocessing')),     # the latter: an exception
        bridge,
    ])
