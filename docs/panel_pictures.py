# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The pictures of the panel: a demo that runs, seen in a real browser (``.ci/browser``)."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
import re
import signal
import subprocess
import sys
import tempfile
import time

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / 'test'), str(HERE.parent / 'test' / 'panel')]

#: file -> address below the panel's, phone or not, s to wait: a chart is to fill
VIEWS = {'panel.webp': ('/', False, 3.0), 'panel_drive.webp': ('/drive/lift', False, 40.0),
         'panel_phone.webp': ('/', True, 3.0)}


@dataclass
class Care:
    """How much is done for a picture: s to wait at most, and attempts at one without a gap."""

    wait: float = 60.0
    attempts: int = 3


care = Care()


def missing() -> str:
    """Say why there can be no pictures; '' if there can."""
    try:
        import nicegui  # noqa: F401
        from panel_browser import browser_missing
        import selenium  # noqa: F401
    except ImportError as error:
        return f'no Python module {error.name}'
    return browser_missing()


def draw(path: Path) -> None:
    """Take one picture, with a demo of its own."""
    from panel_browser import Browser
    address, phone, patience = VIEWS[path.name]
    command = [sys.executable, '-m', 'drive_can_bridge.cli.main']
    with tempfile.TemporaryDirectory() as directory, subprocess.Popen(
            [*command, 'demo', '--drive', '--fault', 'turntable:silent'],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL) as demo, subprocess.Popen(
                [*command, 'panel', '--port', '0'], stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL, text=True) as panel:
        try:
            assert panel.stdout is not None
            printed = re.fullmatch(r'operator: (\S+)/(\S+)\n', panel.stdout.readline())
            if printed is None:
                raise SystemExit('pictures: the panel did not start')
            _take(Browser(Path(directory), phone=phone), printed[1], printed[2], path,
                  address, patience)
        finally:
            for process in (panel, demo):
                process.send_signal(signal.SIGINT)


def _take(browser: 'Browser', base: str, token: str, path: Path, address: str,  # noqa: F821
          patience: float) -> None:
    browser.open(f'{base}/{token}')
    browser.shows('lift.*online.*enabled.*turntable.*offline')
    browser.open(f'{base}{address}')
    if patience > 30.0:     # the chart is full then
        browser.click('.chart-buttons button', '30 s')
    time.sleep(min(patience, care.wait))
    browser.shows(r'lift\s+online\s+enabled')   # a busy machine may have lost it meanwhile
    browser.picture(path)
    browser.close()


PICTURES: dict[str, Callable[[Path], None]] = dict.fromkeys(VIEWS, draw)
