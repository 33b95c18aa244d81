# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The ROS environment of the demo: which domain, and how far its traffic gets."""

from collections.abc import Sequence
import os
from pathlib import Path
import shlex
import sys

from drive_can_bridge import host_texts
from drive_can_bridge.process.presence import bridges, own_domain, switched_on

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


def elsewhere(namespace: str | None = None) -> str:
    """
    Return that bridges of this host run in other ROS domains only; '' where they do not.

    :param namespace: in which they are, or a pattern of some; None: anywhere.
    """
    others = _other_domains(namespace)
    return '' if not others else _text_elsewhere(
        host_texts.bridge_elsewhere, host_texts.bridge_elsewhere_stops, others)


def _other_domains(namespace: str | None) -> list[int]:
    """Return in which domains bridges of this host run; none where one is in this domain."""
    domain = own_domain()
    there = {each.domain for each in bridges() if each.may_be_in(namespace)}
    known = sorted(there.difference((None,)))
    return [] if domain in known else known


def _text_elsewhere(plain: str, stops: str, domains: Sequence[int], **fields: str) -> str:
    """
    Return a text about bridges in other domains.

    :param stops: the text where a stop without a name reaches them.
    """
    return (stops if switched_on() else plain).format(
        others=' and '.join(map(str, domains)), first=domains[0], **fields)


def no_bridge(namespace: str | None, silent: Sequence[str] = (), waited: float = 0.0, *,
              others_answer: bool = False) -> str:
    """
    Return that there is no bridge, or none that answers, and what to do.

    :param silent: those that do not answer.
    :param others_answer: the command reached those of other domains: nothing is to be done.
    :param waited: for so many s.
    """
    where = '' if namespace is None else f'in namespace {namespace or "/"} '
    where += f'(ROS domain {os.environ.get(DOMAIN_ID) or "0"})'
    if silent:
        return host_texts.no_bridge_answers.format(
            where=where, silent=', '.join(silent),
            do='does' if len(silent) == 1 else 'do', waited=waited)
    if others_answer:
        return host_texts.no_bridge_running.format(where=where)
    others = _other_domains(namespace)
    if others:
        return _text_elsewhere(
            host_texts.no_bridge_but_elsewhere, host_texts.no_bridge_but_elsewhere_stops, others,
            where=where)
    return host_texts.no_bridge_start_one.format(where=where)
