# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The topics and services of a bridge and its drives, by what they are for."""

from dataclasses import dataclass

from drive_can_bridge.core.configuration import BridgeConfiguration, DriveConfiguration
from drive_can_bridge.protocols.families import FAMILIES

#: how parameters are read and written: ``~/get_parameters`` ...
READING = ('describe_parameters', 'get_parameter_types', 'get_parameters', 'list_parameters')
WRITING = ('set_parameters', 'set_parameters_atomically')
CONTROL = ('enable', 'reset_fault')
#: a managed node says how it is, and is told
STATES = ('get_available_states', 'get_available_transitions', 'get_state',
          'get_transition_graph')
TRANSITIONS = ('change_state',)
#: what every node has
TYPE_DESCRIPTION = 'get_type_description'


@dataclass(frozen=True, slots=True)
class NodeNames:
    """
    What one node has, relative to it (``~/`` is left out).

    :param shown: topics that it publishes.
    :param taken: topics that it obeys.
    :param asked: services that change nothing.
    :param obeyed: services that do.
    """

    node: str
    shown: tuple[str, ...] = ()
    taken: tuple[str, ...] = ()
    asked: tuple[str, ...] = ()
    obeyed: tuple[str, ...] = ()


def bridge_names(configuration: BridgeConfiguration, node: str) -> NodeNames:
    """
    Return what the bridge itself has.

    :param node: name of the bridge's node.
    """
    joints = [drive.joint for drive in configuration.drives.values() if drive.joint is not None]
    return NodeNames(
        node, shown=('transition_event', *(('joint_states',) if joints else ())),
        taken=('joint_commands',) if joints else (),
        asked=(*READING, *STATES, 'get_logger_levels', TYPE_DESCRIPTION),
        obeyed=(*WRITING, *TRANSITIONS, 'set_logger_levels', 'save_trace'))


def drive_names(drive: DriveConfiguration) -> NodeNames:
    """Return what the node of a drive has."""
    session = FAMILIES[drive.protocol].make_session(drive)
    shown = ['online', 'response', 'request']
    for parameter in session.sample_parameters:
        shown.append(parameter.name)
        shown += [f'{parameter.name}/{bit}' for bit, _ in parameter.bits]
    control = drive.profile.control
    taken = [f'command/{parameter.name}' for parameter in drive.cyclic_request
             if control is None or parameter.name != control.parameter]
    if drive.joint is not None:
        shown.append('joint_state')
        taken.append('joint_command')
    return NodeNames(
        drive.name, shown=tuple(shown), taken=tuple(taken), asked=READING,
        obeyed=(*WRITING, 'quick_stop', *(CONTROL if session.control is not None else ()),
                *(('home',) if getattr(drive.options, 'homing', False) else ())))
