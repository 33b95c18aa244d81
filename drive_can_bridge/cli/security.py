# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can security``: who may talk to the bridge of a parameter file.

Writes files only; docs/security.md has what they protect against, and what enforces them. The
policy has three enclaves, and what each may do. Everything else is denied.

``/bridge``
    the process of the bridge: its own topics and services.
``/operator``
    moves drives: commands, ``~/enable``, parameters; and all that a viewer may.
``/viewer``
    only reads: topics of drives, diagnostics, the log, reading parameters.

Access control of DDS knows topics, not contents: whatever may call ``~/enable`` may enable.
"""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Iterable
from dataclasses import dataclass
import ipaddress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from drive_can_bridge.cli.command import namespace, output_path, whole
from drive_can_bridge.cli.output import write_atomically
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import BridgeConfiguration, DriveConfiguration
from drive_can_bridge.process.fast_dds import MARK
from drive_can_bridge.protocols.families import FAMILIES

_NODE = 'drive_can_bridge'
_POLICY, _TLS_BRIDGE, _TLS_CLIENT = 'policy.xml', 'tls_bridge.xml', 'tls_client.xml'

#: how parameters are read and written: ``~/get_parameters`` ...
READING = ('describe_parameters', 'get_parameter_types', 'get_parameters', 'list_parameters')
WRITING = ('set_parameters', 'set_parameters_atomically')
CONTROL = ('enable', 'reset_fault')
#: what a bridge asks those of other hosts for, and their drives, when it passes a stop on
PASSED_ON = ('quick_stop', 'get_parameter_types', 'get_parameters', 'list_parameters')
#: the lifecycle topics and services of a managed node
STATES = ('get_available_states', 'get_available_transitions', 'get_state',
          'get_transition_graph')
TRANSITIONS = ('change_state',)
#: what every node has
TYPE_DESCRIPTION = 'get_type_description'
_NAMESPACE = 'http://www.eprosima.com'
#: by which a bridge recognises them
_TRANSPORT = MARK.decode()
#: a peer without a certificate of ours is shown out
_VERIFY = ('VERIFY_PEER', 'VERIFY_FAIL_IF_NO_PEER_CERT')
#: what is older than TLS 1.2
_OPTIONS = ('NO_SSLV2', 'NO_SSLV3', 'NO_TLSV1', 'NO_TLSV1_1')


@dataclass(frozen=True, slots=True)
class NodeNames:
    """
    The names of one node, relative to it (``~/`` is left out).

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


def bridge_names(configuration: BridgeConfiguration) -> NodeNames:
    """Return the names of the bridge itself."""
    joints = [drive.joint for drive in configuration.drives.values() if drive.joint is not None]
    return NodeNames(
        _NODE, shown=('transition_event', *(('joint_states',) if joints else ())),
        taken=('joint_commands',) if joints else (),
        asked=(*READING, *STATES, 'get_logger_levels', TYPE_DESCRIPTION),
        obeyed=(*WRITING, *TRANSITIONS, 'set_logger_levels', 'save_trace'))


def drive_names(drive: DriveConfiguration) -> NodeNames:
    """Return the names of a drive's node."""
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


VERSION = '0.2.0'
BRIDGE, OPERATOR, VIEWER = '/bridge', '/operator', '/viewer'
#: nodes of clients that come with ROS and with this package; patterns as DDS has them
_TOOLS = ('_drive_can_*', '_ros2cli_*')
_LOG, _EVENTS, _DIAGNOSTICS, _CLOCK = '/rosout', '/parameter_events', '/diagnostics', '/clock'


def policy(configuration: BridgeConfiguration, namespace: str) -> str:
    """
    Return the policy as XML.

    :param namespace: in which the bridge runs, ``/`` or ``/cell``.
    """
    nodes = [bridge_names(configuration), *map(drive_names, configuration.drives.values())]
    root = ElementTree.Element('policy', version=VERSION)
    enclaves = ElementTree.SubElement(root, 'enclaves')
    _add_bridge(_enclave(enclaves, BRIDGE), nodes, namespace)
    _add_client(_enclave(enclaves, OPERATOR), nodes, namespace, acts=True)
    _add_client(_enclave(enclaves, VIEWER), nodes, namespace, acts=False)
    return _document(root)


def _enclave(parent: ElementTree.Element, path: str) -> ElementTree.Element:
    enclave = ElementTree.SubElement(parent, 'enclave', path=path)
    return ElementTree.SubElement(enclave, 'profiles')


def _add_bridge(profiles: ElementTree.Element, nodes: list[NodeNames], namespace: str) -> None:
    for number, node in enumerate(nodes):
        profile = _enclave_profile(profiles, namespace, node.node)
        shared = [_EVENTS, _LOG, _DIAGNOSTICS] if number == 0 else [_EVENTS]
        _rule(profile, 'topics', 'publish', [*shared, *_own(node.shown)])
        passing = number == 0
        _rule(profile, 'topics', 'subscribe', [
            _CLOCK, _EVENTS, *_own(node.taken), *(_anywhere('online') if passing else ())])
        _rule(profile, 'services', 'reply', _own((*node.asked, *node.obeyed)))
        if passing:
            _rule(profile, 'services', 'request', [
                name for each in PASSED_ON for name in _anywhere(each)])


def _add_client(profiles: ElementTree.Element, nodes: list[NodeNames], namespace: str, *,
                acts: bool) -> None:
    place = namespace.rstrip('/')
    seen = [_DIAGNOSTICS, _LOG, _EVENTS, _CLOCK]
    used: dict[str, list[str]] = {'publish': [], 'request': []}
    for node in nodes:
        seen += _absolute(place, node, node.shown)
        used['request'] += _absolute(place, node, node.asked)
        if acts:
            used['publish'] += _absolute(place, node, node.taken)
            used['request'] += _absolute(place, node, node.obeyed)
    # access goes by enclave: what one of its nodes may use, all of them may
    profile = _enclave_profile(profiles, '/', OPERATOR[1:] if acts else VIEWER[1:])
    _rule(profile, 'topics', 'publish', used['publish'])
    _rule(profile, 'topics', 'subscribe', seen)
    _rule(profile, 'services', 'request', used['request'])
    for node_name in (profile.attrib['node'], *_TOOLS):
        # every node announces its parameters, writes to the log, and has this service
        profile = _enclave_profile(profiles, '/', node_name)
        _rule(profile, 'topics', 'publish', [_EVENTS, _LOG])
        _rule(profile, 'services', 'reply', [f'~/{TYPE_DESCRIPTION}'])


def _enclave_profile(parent: ElementTree.Element, namespace: str,
                     node: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, 'profile', ns=namespace, node=node)


def _rule(profile: ElementTree.Element, kind: str, verb: str, names: Iterable[str]) -> None:
    listed = list(dict.fromkeys(names))
    if listed:
        rule = ElementTree.SubElement(profile, kind, {verb: 'ALLOW'})
        for name in listed:
            ElementTree.SubElement(rule, kind[:-1]).text = name


def _own(names: Iterable[str]) -> list[str]:
    return [f'~/{name}' for name in names]


def _anywhere(name: str) -> tuple[str, str]:
    """Return the names for any drive, or bridge, in a namespace or not."""
    return f'/*/{name}', f'/*/*/{name}'


def _absolute(place: str, node: NodeNames, names: Iterable[str]) -> list[str]:
    return [f'{place}/{node.node}/{name}' for name in names]


def transport_profile(args: Namespace, *, listens: bool) -> str:
    """
    Return a profile of Fast DDS: TCP only, both sides show a certificate.

    The bridge listens, all others connect to it. There is no element for a password: an
    empty one is not the same as none, and keeps a key without a password from being read.
    """
    root = ElementTree.Element('dds', xmlns=_NAMESPACE)
    profiles = ElementTree.SubElement(root, 'profiles')
    files = [(name, str(args.certificates / file)) for name, file in (
        ('private_key_file', 'key.pem'), ('cert_chain_file', 'cert.pem'),
        ('verify_file', 'ca.pem'))]
    _fill(profiles, [('transport_descriptors', [('transport_descriptor', [
        ('transport_id', _TRANSPORT), ('type', 'TCPv4'),
        *([('listening_ports', [('port', str(args.port))])] if listens else ()),
        ('tls', [*files, ('verify_mode', [('verify', mode) for mode in _VERIFY]),
                 ('options', [('option', option) for option in _OPTIONS])])])])])
    participant = ElementTree.SubElement(
        profiles, 'participant', profile_name=_TRANSPORT, is_default_profile='true')
    peers = [('locator', [('tcpv4', [
        ('address', args.host), ('physical_port', str(args.port)), ('port', '0')])])]
    _fill(participant, [('rtps', [
        ('userTransports', [('transport_id', _TRANSPORT)]), ('useBuiltinTransports', 'false'),
        *([] if listens else [('builtin', [('initialPeersList', peers)])])])])
    return _document(root)


def _document(root: ElementTree.Element) -> str:
    ElementTree.indent(root)
    return ('<?xml version="1.0" encoding="UTF-8"?>\n'
            f'{ElementTree.tostring(root, encoding="unicode")}\n')


def _fill(parent: ElementTree.Element, content: Any) -> None:
    """Fill an element: with a text, or with others, each its name and its content."""
    if isinstance(content, str):
        parent.text = content
        return
    for name, below in content:
        _fill(ElementTree.SubElement(parent, name), below)


def define(parser: ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    parser.description = (
        'Write the SROS2 policy for the bridge of a parameter file (enclaves '
        f'{BRIDGE}, {OPERATOR}, {VIEWER}), and Fast DDS profiles for TLS between '
        'hosts with certificates of your own.')
    parser.add_argument('file', metavar='FILE', help='parameter file of the bridge')
    parser.add_argument('-o', '--output', metavar='DIR', type=output_path, required=True,
                        help='directory for the files, made where it is missing')
    parser.add_argument('--namespace', metavar='NS', default='', type=namespace,
                        help='in which the bridge runs (default: none)')
    parser.add_argument('--host', metavar='ADDRESS', default='127.0.0.1', type=_address,
                        help='of the host of the bridge, for TLS (default: %(default)s)')
    parser.add_argument('--port', metavar='PORT', default=5100, type=whole(1, 65535),
                        help='of TCP on that host (default: %(default)s)')
    parser.add_argument('--certificates', metavar='DIR', type=Path,
                        default=Path('/etc/drive_can/certificates'),
                        help='where key.pem, cert.pem and ca.pem are on each host '
                             '(default: %(default)s)')


def run(args: Namespace) -> int:
    """
    Write the files.

    :raises ConfigurationError: the parameter file has problems.
    :raises OSError: a file cannot be read or written.
    """
    configuration = configuration_from_file(args.file)
    files = {
        _POLICY: policy(configuration, args.namespace or '/'),
        _TLS_BRIDGE: transport_profile(args, listens=True),
        _TLS_CLIENT: transport_profile(args, listens=False)}
    args.output.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        write_atomically(args.output / name, text.encode())
        print(args.output / name)
    return 0


def _address(text: str) -> str:
    try:
        return str(ipaddress.IPv4Address(text))
    except ValueError:
        raise ArgumentTypeError(command_sentences.ipv4_wanted(text=text)) from None
