# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The ROS environment, as it is told and made."""

import pytest

from drive_can_bridge.process import environment


@pytest.fixture
def clean(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    # set first, so that what the tests change is undone
    for name in ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_LOCALHOST_ONLY',
                 'ROS_STATIC_PEERS', 'RMW_IMPLEMENTATION'):
        monkeypatch.setenv(name, '')
    return monkeypatch


def test_traffic_stays_here_by_default(clean: pytest.MonkeyPatch) -> None:
    environment.prepare(None)
    assert environment.in_words() == 'ROS domain 0, on this machine only'
    assert environment.export_command() == 'export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST'


def test_what_the_environment_says_is_obeyed(clean: pytest.MonkeyPatch) -> None:
    clean.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    clean.setenv('ROS_DOMAIN_ID', '5')
    environment.prepare(None)
    assert environment.in_words() == 'ROS domain 5, on the network'
    environment.prepare(7)
    assert environment.export_command() == (
        'export ROS_DOMAIN_ID=7 ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET')


def test_the_older_variable_counts_too(clean: pytest.MonkeyPatch) -> None:
    clean.setenv('ROS_LOCALHOST_ONLY', '1')
    environment.prepare(None)
    assert 'ROS_AUTOMATIC_DISCOVERY_RANGE' not in environment.export_command()
    assert environment.in_words() == 'ROS domain 0, on this machine only'
