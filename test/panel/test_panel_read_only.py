# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A panel without ``--allow-writes``."""

from pathlib import Path

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('nicegui', reason="needs the extra 'panel'")


def test_nothing_is_written_and_stops_are_always_there(tmp_path: Path) -> None:
    from panel_bench import house as made
    with made(tmp_path, allow_writes=False) as house:
        conveyor = house.bridge.played['conveyor']
        before = conveyor.value('ramp_time')
        for action in ('write', 'restore?drive=/conveyor'):
            answer = house.do(action, 'operator', {
                'drive': '/conveyor', 'name': 'ramp_time', 'value': '2'})
            assert (answer.status, answer.said['success']) == (403, False)
            assert '--allow-writes' in answer.said['text']
        assert conveyor.value('ramp_time') == before
        for action in ('quick_stop', 'disable'):
            assert house.do(action, 'operator', {'drive': '/lift'}).said['success'] is True
