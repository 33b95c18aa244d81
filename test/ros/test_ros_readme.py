# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The README's servo, by the file and the commands that the README shows."""

from pathlib import Path
import re
import shlex

from bridges import StartBridge
from by_hand import Run
import pytest

import drive_can_bridge
from drive_can_bridge.cli.main import main

README = (Path(drive_can_bridge.__file__).resolve().parents[1] / 'README.md').read_text(
    encoding='utf-8')
#: what only shows, or runs until it is ended
_OTHERS = ('monitor', 'simulate')


def commands() -> list[list[str]]:
    """Return what is typed at the running bridge, word by word."""
    block, = (found for found in re.findall(r'```sh\n(.*?)```', README, re.DOTALL)
              if 'drive_can enable' in found)
    return [shlex.split(line, comments=True)[1:] for line in block.splitlines()]


def test_each_command_does_what_it_says(
        bridge: StartBridge, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, = re.findall(r'```yaml\n(# my_drives\.yaml\n.*?)```', README, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    Path('my_drives.yaml').write_text(text, encoding='utf-8')
    assert main(['validate', 'my_drives.yaml']) == 0
    one = bridge(text.replace('socketcan, channel: can0', 'virtual, channel: readme')).online()
    plant = one.played['axis']
    fastest = 0.0

    def look(found: object, now: float) -> None:
        nonlocal fastest
        judge(found, now)
        fastest = max(fastest, float(plant.value('actual_velocity')))
    from drive_can_bridge.client import jog
    judge = jog.Jog._judge
    monkeypatch.setattr(jog.Jog, '_judge', look)
    for words in commands():
        if words[0] not in _OTHERS:
            code, lines, errors = run(*words, *(['--yes'] if words[0] == 'jog' else []))
            assert code == 0, (words, lines, errors)
    wanted = next(float(words[-1]) for words in commands() if words[0] == 'jog')
    assert fastest == pytest.approx(wanted, abs=0.1)
    assert Path('axis.yaml').read_text(encoding='utf-8').count(
        'profile_acceleration: 600.0 ') == 1
    assert one.node.drives['axis'].session.state.value == 'disabled'
