# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The golden pages: which there are, and how they are made.

``python views.py`` in this directory writes all of them anew. Look at what it changed.
"""

import io
import os
from pathlib import Path
import sys
import time

from monitor_builders import fifteen_drives, many_drives, seen, three_drives
from rich.console import Console

from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.snapshot import Snapshot
from drive_can_bridge.view.live import Choice, Page, page, ViewSetting

GOLDEN = Path(__file__).with_name('golden')
SIZES = ((80, 24), (140, 50), (60, 20))
SETTING = ViewSetting(place='ROS domain 7, on this machine only',
                      environment=('export ROS_DOMAIN_ID=7',))
#: name -> (what there is, what was chosen)
VIEWS: dict[str, tuple[Snapshot, Choice]] = {
    'drives': (seen(three_drives()), Choice(drive='/lift')),
    'many': (seen(many_drives()), Choice(drive='/axis_30')),
    'drive': (seen(three_drives()), Choice(Page.DRIVE, '/conveyor')),
    'fifteen': (seen(fifteen_drives()), Choice()),
    'help': (seen(three_drives()), Choice(Page.HELP, '/lift')),
    'nobody': (seen(Model()), Choice()),
    'silent': (three_drives().look(1007.0, seen(three_drives()).at), Choice()),
}


def shown(snapshot: Snapshot, choice: Choice, width: int, height: int,
          setting: ViewSetting = SETTING, *, colours: bool = False) -> str:
    """Print a page as a terminal of that size would get it."""
    os.environ['TZ'] = 'UTC'
    time.tzset()
    output = io.StringIO()
    console = Console(file=output, width=width, height=height, force_terminal=True,
                      color_system='truecolor' if colours else None, legacy_windows=False)
    console.print(page(snapshot, choice, setting, width=width, height=height), height=height)
    return output.getvalue()


def plain(snapshot: Snapshot, choice: Choice, width: int, height: int,
          setting: ViewSetting = SETTING) -> str:
    """Print a page without any colours and attributes."""
    console = Console(file=io.StringIO(), width=width, height=height)
    text = shown(snapshot, choice, width, height, setting)
    lines = [console.render_str('').from_ansi(line).plain for line in text.split('\n')]
    return '\n'.join(lines)


def golden_file(name: str, width: int, height: int) -> Path:
    """Return where a page is kept."""
    return GOLDEN / f'{name}_{width}x{height}.txt'


def main() -> None:
    """Write them all."""
    GOLDEN.mkdir(exist_ok=True)
    for name, (snapshot, choice) in VIEWS.items():
        for width, height in SIZES:
            golden_file(name, width, height).write_text(
                plain(snapshot, choice, width, height), encoding='utf-8')


if __name__ == '__main__':
    sys.exit(main())
