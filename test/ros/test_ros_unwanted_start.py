# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A start that nobody wants any more: a signal came while the buses were being opened."""

from bridges import StartBridge
from clients import Client


def test_nothing_is_activated(bridge: StartBridge, client: Client) -> None:
    one = bridge(autostart=False)
    with one.record() as recorder:
        assert one.node.start(lambda: True)
        assert client.state() == 'inactive'
        assert recorder.requests() == []
