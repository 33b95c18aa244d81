# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``drive_can security``: who may talk to the bridge of a parameter file.

Writes files only; docs/security.md says what they protect against, and what enforces them.
"""

import argparse
import ipaddress
from pathlib import Path

from drive_can_bridge.cli.command import namespace, output_path, whole
from drive_can_bridge.cli.output import write_atomically
from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.security.policy import (
    BRIDGE, bridge_profile, client_profile, Meeting, OPERATOR, policy, VIEWER,
)

_NODE = 'drive_can_bridge'
_POLICY, _TLS_BRIDGE, _TLS_CLIENT = 'policy.xml', 'tls_bridge.xml', 'tls_client.xml'


def define(parser: argparse.ArgumentParser) -> None:
    """Define the words and options of the subcommand."""
    usual = Meeting()
    parser.description = (
        'Write the SROS2 policy for the bridge of a parameter file (enclaves '
        f'{BRIDGE}, {OPERATOR}, {VIEWER}), and Fast DDS profiles for TLS between '
        'hosts with certificates of your own.')
    parser.add_argument('file', metavar='FILE', help='parameter file of the bridge')
    parser.add_argument('-o', '--output', metavar='DIR', type=output_path, required=True,
                        help='directory for the files, made where it is missing')
    parser.add_argument('--namespace', metavar='NS', default='', type=namespace,
                        help='in which the bridge runs (default: none)')
    parser.add_argument('--host', metavar='ADDRESS', default=usual.host, type=_address,
                        help='of the host of the bridge, for TLS (default: %(default)s)')
    parser.add_argument('--port', metavar='PORT', default=usual.port, type=whole(1, 65535),
                        help='of TCP on that host (default: %(default)s)')
    parser.add_argument('--certificates', metavar='DIR', default=usual.certificates, type=Path,
                        help='where key.pem, cert.pem and ca.pem are on each host '
                             '(default: %(default)s)')


def run(args: argparse.Namespace) -> int:
    """
    Write the files.

    :raises ConfigurationError: the parameter file has problems.
    :raises OSError: a file cannot be read or written.
    """
    configuration = configuration_from_file(args.file)
    meeting = Meeting(args.host, args.port, args.certificates)
    files = {
        _POLICY: policy(configuration, node=_NODE, namespace=args.namespace or '/'),
        _TLS_BRIDGE: bridge_profile(meeting), _TLS_CLIENT: client_profile(meeting)}
    args.output.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        write_atomically(args.output / name, text.encode())
        print(args.output / name)
    return 0


def _address(text: str) -> str:
    try:
        return str(ipaddress.IPv4Address(text))
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text}: an IPv4 address is wanted') from None
