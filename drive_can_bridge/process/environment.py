# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The ROS environment of the demo: which domain, and how far its traffic gets."""

from collections.abc import Sequence
import os
from pathlib import Path
import shlex
import sys

from drive_can_bridge import host_texts

DOMAIN_ID = 'ROS_DOMAIN_ID'
DISCOVERY_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
_LOCALHOST_ONLY = 'ROS_LOCALHOST_ONLY'
#: what another process has to have in common with the demo in order to see it
_SHARED = (DOMAIN_ID, DISCOVERY_RANGE, _LOCALHOST_ONLY, 'ROS_STATIC_PEERS',
           'RMW_IMPLEMENTATION')
#: with a larger one the ports of DDS leave the range of UDP
DOMAIN_ID_MAX = 232


def prepare(domain_id: int | None) -> None:
    """
    Set up the environment of this process, before rclpy is initialised.

    Simulated drives have no business on a network: unless the environment says how far discovery
    reaches, it stays on this machine.
    """
    if domain_id is not None:
        os.environ[DOMAIN_ID] = str(domain_id)
    if not os.environ.get(DISCOVERY_RANGE) and os.environ.get(_LOCALHOST_ONLY) != '1':
        os.environ[DISCOVERY_RANGE] = 'LOCALHOST'


def domain_problem() -> str:
    """
    Return why there is no such ROS domain; '' where there is one, or where rcl reports it.

    Fast DDS ends the process itself where it finds no ports, in two lines of its own.
    """
    try:
        domain = int(os.environ.get(DOMAIN_ID, ''), 0)
    except ValueError:
        return ''
    if -1 <= domain <= DOMAIN_ID_MAX:   # rcl reads -1 as none
        return ''
    return host_texts.domain_impossible.format(
        variable=DOMAIN_ID, domain=domain, most=DOMAIN_ID_MAX)


def in_words() -> str:
    """Return where the demo is visible, ``ROS domain 0, on this machine only``."""
    domain = os.environ.get(DOMAIN_ID) or '0'
    reach = os.environ.get(DISCOVERY_RANGE, '').upper()
    if os.environ.get(_LOCALHOST_ONLY) == '1' or reach == 'LOCALHOST':
        place = 'on this machine only'
    elif reach == 'OFF':
        place = 'without discovery'
    else:
        place = 'on the network'
    return f'ROS domain {domain}, {place}'


def export_command() -> str:
    """Return the shell command that makes another terminal see the demo; '' if none is needed."""
    settings = [f'{name}={shlex.quote(os.environ[name])}' for name in _SHARED
                if os.environ.get(name)]
    return f'export {" ".join(settings)}' if settings else ''


def activate_command() -> str:
    """Return the shell command to find ``drive_can`` in another terminal; '' if none is needed."""
    script = Path(sys.prefix) / 'bin' / 'activate'
    return (f'source {shlex.quote(str(script))}'
            if sys.prefix != sys.base_prefix and script.is_file() else '')


def no_bridge(namespace: str | None, silent: Sequence[str] = (), waited: float = 0.0) -> str:
    """
    Return that there is no bridge, or none that answers.

    :param silent: those that do not answer.
    :param waited: for so many s.
    """
    where = '' if namespace is None else f' in namespace {namespace or "/"}'
    domain = os.environ.get(DOMAIN_ID) or '0'
    if silent:
        return host_texts.no_bridge_answers.format(
            where=where, domain=domain, silent=', '.join(silent),
            do='does' if len(silent) == 1 else 'do', waited=waited)
    return host_texts.no_bridge_running.format(where=where, domain=domain)
