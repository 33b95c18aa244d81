# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What ``drive_can backup``, ``restore`` and ``compare`` show (commands.yaml)."""

import os
from pathlib import Path
import shlex
import signal
from typing import Any

from backup_builders import Command, Shop
from builders import frame
import pytest
from transcripts import replayed, stories

from drive_can_bridge.backup.document import read_backup
from drive_can_bridge.cli import restore
from drive_can_bridge.client.direct import DirectDrive
from drive_can_bridge.client.drive import WriteOutcome
from drive_can_bridge.core.requests import kind_of

STORIES = stories(__file__, 'commands.yaml')


class Story:
    """Does the steps of a transcript: commands, and what has a method here."""

    def __init__(self, shop: Shop, command: Command, patch: pytest.MonkeyPatch) -> None:
        self.shop, self.command, self.patch = shop, command, patch

    def step(self, step: str) -> list[str]:
        first, *words = shlex.split(step)
        own = getattr(self, f'_{first}', None)
        if own is not None:
            found = own(*words)
            return [] if found is None else str(found).splitlines()
        return self.command(first, *words).view

    def _alone(self, *words: str) -> str:
        """Run a command that gets no parameter file."""
        return '\n'.join(self.command(*words, direct=False).view)

    def _fault(self, name: str, fault: str) -> None:
        self.shop.drives[name].fault(fault)

    def _set(self, name: str, register: str, value: str) -> None:
        self.shop.drives[name].set_value(register, int(value, 0))

    def _values(self, name: str, *registers: str) -> str:
        return ' '.join(map(str, self.shop.values(name, *registers)))

    def _requests(self, *names: str) -> int:
        """Return how often drives were asked; without a name: all of them."""
        return sum(self.shop.drives[name].requests for name in names or self.shop.drives)

    def _writes(self, name: str) -> int:
        """Return how often cells of the EEPROM were written."""
        return self.shop.drives[name].eeprom_writes

    def _file(self, name: str, *settings: str) -> None:
        """Write a file as somebody might by hand."""
        self.shop.write_backup(name, **dict(each.split('=') for each in settings))

    def _replace(self, source: str, target: str, old: str, new: str) -> None:
        text = Path(source).read_text()
        assert old in text
        Path(target).write_text(text.replace(old, new))

    def _without_head(self, name: str) -> None:
        lines = Path(name).read_text().splitlines()
        Path(name).write_text('\n'.join(line for line in lines if not line.startswith('#')))

    def _older_table(self, source: str, target: str) -> None:
        """Write a file as if its profile had been another one, with another name in it."""
        text = Path(source).read_text()
        digest = next(line for line in text.splitlines() if 'profile_sha256' in line)
        Path(target).write_text(text.replace(digest, '# profile_sha256: 00').replace(
            '    ramp_time:', '    ramp:'))

    def _settings(self, name: str) -> str:
        values = read_backup(Path(name)).values
        return '\n'.join(f'{key}: {value}' for key, value in values.items())

    def _remarks(self, name: str) -> str:
        return '\n'.join(line for line in Path(name).read_text().splitlines()
                         if line.startswith('# left out'))

    def _files(self) -> str:
        return ' '.join(sorted(os.listdir()))

    def _describe(self, *lines: str) -> None:
        """Give the conveyor another table."""
        self.shop.describe_conveyor(
            *(''.join(f'{line}\n' for line in lines if line.startswith(' ') is of_table)
              for of_table in (True, False)))

    def _enabled_meanwhile(self, name: str) -> None:
        put = DirectDrive.put

        def enabled_by_now(*args: Any, **options: Any) -> WriteOutcome:
            outcome = put(*args, **options)
            self.shop.drives[name].set_value('status_word', 0x0002)
            return outcome
        self.patch.setattr(DirectDrive, 'put', enabled_by_now)

    def _behind(self, seen: str, then: str) -> None:
        """Have a stranger send a frame once another one is on the bus."""
        self.shop.wire.watchers.append(
            lambda each: self.shop.wire.carry(frame(then)) if each == frame(seen) else None)

    def _store_fails(self, reason: str) -> None:
        put = DirectDrive.put

        def failed(drive: Any, name: str, parameter: Any, *args: Any, **options: Any,
                   ) -> WriteOutcome:
            if name == 'store_parameters':
                return WriteOutcome(name, False, parameter, reason, kind=kind_of(reason))
            return put(drive, name, parameter, *args, **options)
        self.patch.setattr(DirectDrive, 'put', failed)

    def _interrupted_twice(self) -> None:
        put, report = DirectDrive.put, restore._report

        def interrupted(*args: Any, **options: Any) -> WriteOutcome:
            signal.raise_signal(signal.SIGINT)
            return put(*args, **options)

        def interrupted_again(*args: Any) -> int:
            signal.raise_signal(signal.SIGINT)
            return report(*args)
        self.patch.setattr(DirectDrive, 'put', interrupted)
        self.patch.setattr(restore, '_report', interrupted_again)


@pytest.mark.parametrize('story', STORIES)
def test_lines(story: str, shop: Shop, command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    told = Story(shop, command, monkeypatch)
    assert replayed(STORIES[story], told.step) == STORIES[story]
