# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Profiles of Fast DDS for TLS between hosts: TCP only, and both sides show a certificate.

The bridge listens, everybody else connects to it. There is no element for a password: an empty one
is not the same as none, and keeps a key without a password from being read.
"""

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

_NAMESPACE = 'http://www.eprosima.com'
_TRANSPORT = 'drive_can_tls'
#: a peer without a certificate of ours is shown out
_VERIFY = ('VERIFY_PEER', 'VERIFY_FAIL_IF_NO_PEER_CERT')
#: what is older than TLS 1.2
_OPTIONS = ('NO_SSLV2', 'NO_SSLV3', 'NO_TLSV1', 'NO_TLSV1_1')


@dataclass(frozen=True, slots=True)
class Meeting:
    """
    Where bridge and clients meet.

    :param host: address of the bridge's host, as clients reach it.
    :param port: of TCP.
    :param certificates: directory with ``key.pem``, ``cert.pem``, ``ca.pem`` on each host.
    """

    host: str = '127.0.0.1'
    port: int = 5100
    certificates: Path = Path('/etc/drive_can/certificates')


def bridge_profile(meeting: Meeting) -> str:
    """Write the profile of the bridge's host."""
    return _profile(meeting, listens=True)


def client_profile(meeting: Meeting) -> str:
    """Write the profile of all other hosts."""
    return _profile(meeting, listens=False)


def _profile(meeting: Meeting, *, listens: bool) -> str:
    root = ElementTree.Element('dds', xmlns=_NAMESPACE)
    profiles = ElementTree.SubElement(root, 'profiles')
    descriptors = ElementTree.SubElement(profiles, 'transport_descriptors')
    transport = ElementTree.SubElement(descriptors, 'transport_descriptor')
    _text(transport, 'transport_id', _TRANSPORT)
    _text(transport, 'type', 'TCPv4')
    if listens:
        ports = ElementTree.SubElement(transport, 'listening_ports')
        _text(ports, 'port', str(meeting.port))
    tls = ElementTree.SubElement(transport, 'tls')
    for name, file in (('private_key_file', 'key.pem'), ('cert_chain_file', 'cert.pem'),
                       ('verify_file', 'ca.pem')):
        _text(tls, name, str(meeting.certificates / file))
    modes = ElementTree.SubElement(tls, 'verify_mode')
    for mode in _VERIFY:
        _text(modes, 'verify', mode)
    options = ElementTree.SubElement(tls, 'options')
    for option in _OPTIONS:
        _text(options, 'option', option)
    participant = ElementTree.SubElement(
        profiles, 'participant', profile_name=_TRANSPORT, is_default_profile='true')
    rtps = ElementTree.SubElement(participant, 'rtps')
    _text(ElementTree.SubElement(rtps, 'userTransports'), 'transport_id', _TRANSPORT)
    _text(rtps, 'useBuiltinTransports', 'false')
    if not listens:
        builtin = ElementTree.SubElement(rtps, 'builtin')
        peers = ElementTree.SubElement(builtin, 'initialPeersList')
        locator = ElementTree.SubElement(ElementTree.SubElement(peers, 'locator'), 'tcpv4')
        _text(locator, 'address', meeting.host)
        _text(locator, 'physical_port', str(meeting.port))
        _text(locator, 'port', '0')
    ElementTree.indent(root)
    return ('<?xml version="1.0" encoding="UTF-8"?>\n'
            f'{ElementTree.tostring(root, encoding="unicode")}\n')


def _text(parent: ElementTree.Element, name: str, text: str) -> None:
    ElementTree.SubElement(parent, name).text = text
