# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The ROS environment, as it is told and made."""

from pathlib import Path
import sys

import pytest

from drive_can_bridge.process import environment
from drive_can_bridge.process.presence import Present


@pytest.fixture
def clean(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    # set first, so that what the tests change is undone
    for name in ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_LOCALHOST_ONLY',
                 'ROS_STATIC_PEERS', 'RMW_IMPLEMENTATION'):
        monkeypatch.setenv(name, '')
    return monkeypatch


@pytest.mark.parametrize(('given', 'domain', 'words', 'export'), [
    ({}, None, 'ROS domain 0, on this machine only',
     'export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST'),
    ({'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'ROS_DOMAIN_ID': '5'}, None,
     'ROS domain 5, on the network',
     'export ROS_DOMAIN_ID=5 ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET'),
    ({'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'ROS_DOMAIN_ID': '5'}, 7,
     'ROS domain 7, on the network',
     'export ROS_DOMAIN_ID=7 ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET'),
    # the older variable counts, too
    ({'ROS_LOCALHOST_ONLY': '1'}, None, 'ROS domain 0, on this machine only',
     'export ROS_LOCALHOST_ONLY=1'),
])
def test_what_is_told(clean: pytest.MonkeyPatch, given: dict[str, str], domain: int | None,
                      words: str, export: str) -> None:
    for name, value in given.items():
        clean.setenv(name, value)
    environment.prepare(domain)
    assert (environment.in_words(), environment.export_command()) == (words, export)


@pytest.mark.parametrize(('domains', 'reached', 'words'), [
    ((), True, ''), ((5, 31), True, ''), ((None,), True, ''),
    ((31,), True, 'a bridge of this host runs in ROS domain 31: `drive_can stop` without a name '
                  'stops it, too; for the rest export ROS_DOMAIN_ID=31'),
    ((31, 7), False, 'a bridge of this host runs in ROS domain 7 and 31: export ROS_DOMAIN_ID=7'),
])
def test_bridges_that_run_in_other_domains_only(
        clean: pytest.MonkeyPatch, domains: tuple[int | None, ...], *, reached: bool,
        words: str) -> None:
    clean.setenv('ROS_DOMAIN_ID', '5')
    clean.setenv('DRIVE_CAN_LOCAL', '' if reached else 'off')
    clean.setattr(environment, 'bridges', lambda: [
        Present(1, domain, '/cell/bridge', 1) for domain in domains])
    assert environment.elsewhere() == environment.elsewhere('/cell') == words
    assert environment.elsewhere('/hall') == ''
    assert environment.no_bridge('/cell') == (
        'no configured bridge is running in namespace /cell (ROS domain 5)'
        + (f'; {words}' if words else ': start one'))


@pytest.mark.parametrize(('given', 'refused'), [
    ('', False), ('0', False), ('232', False), ('233', True), ('0xe9', True), ('999', True),
    ('-2', True),
    # no domain for rcl; and what it says itself
    ('-1', False), ('abc', False)])
def test_a_domain_whose_ports_do_not_exist(clean: pytest.MonkeyPatch, given: str, *,
                                           refused: bool) -> None:
    clean.setenv('ROS_DOMAIN_ID', given)
    assert bool(environment.domain_problem()) is refused


def test_what_another_terminal_needs_to_know_the_commands(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, 'prefix', str(tmp_path / 'my drives'))
    assert environment.activate_command() == ''
    script = tmp_path / 'my drives' / 'bin' / 'activate'
    script.parent.mkdir(parents=True)
    script.touch()
    assert environment.activate_command() == f"source '{script}'"
    monkeypatch.setattr(sys, 'base_prefix', sys.prefix)     # no virtual environment
    assert environment.activate_command() == ''
