# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A panel without ``--allow-writes``; and stops that reach nobody."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
import signal

from panel_builders import NEEDS_PANEL, Run, Site
import pytest
from waiting import wait_for

pytest.importorskip('rclpy')

pytestmark = NEEDS_PANEL


def test_nothing_is_written_and_stops_are_always_there(run: Run, tmp_path: Path) -> None:
    site = Site(run, tmp_path)
    for action in ('write', 'restore?drive=/lift'):
        answer = site.do(action, 'operator', {'drive': '/lift', 'name': 'ramp_time',
                                              'value': '2'})
        assert answer.status == 403
        assert 'without --allow-writes' in answer.said['text']
    for action in ('quick_stop', 'disable'):
        said = site.do(action, 'operator', {'drive': '/lift'}).said
        assert said['success'] is True, (action, said, site.bridge.errors)

    # what reaches nobody is said, of one drive and of all; each takes its time-out, so at once
    assert site.bridge.end(signal.SIGKILL) == -signal.SIGKILL
    with ThreadPoolExecutor() as pool:
        for said in pool.map(lambda wanted: site.do(wanted[0], 'operator', {
                'drive': wanted[1]}).said, (('disable', '/lift'), ('quick_stop', '*'))):
            assert said['success'] is False
            assert 'nobody' in said['text']
    site.bridge = site.start_bridge()
    # what is sent before is not heard, and waited for in vain
    wait_for(lambda: 'active: 3 drives' in site.bridge.errors, 'the bridge')
    wait_for(lambda: site.do('disable', 'operator', {'drive': '/lift'}).said['success'],
             'the bridge that is back')
    site.check_alive()
