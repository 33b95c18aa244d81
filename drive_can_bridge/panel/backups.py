# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Backups of drives by the commands that a person would use: ``drive_can backup``, ``compare`` ...

Each runs in a process of its own and goes through the running bridge, so that there is one way of
doing it, with the same rules and the same words, and the panel stays small.
"""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
import os
from pathlib import Path
import re
import sys
import tempfile

from drive_can_bridge.core.text import printable
from drive_can_bridge.monitor.snapshot import DriveSnapshot

#: s that one may take: some protocols read ten parameters a second
TIMEOUT = 300.0
#: at once, for all browsers together
_AT_ONCE = 2
_TEXT_MAX = 20_000
_DIFFERENT = 1
_OPTION = re.compile(r'(?<!\S)--[a-z][a-z-]*')
_BUSY = 'others are at it already: try again in a moment'


@dataclass(frozen=True, slots=True)
class Done:
    """
    What a command has done.

    :param text: what it said.
    :param file: what it wrote.
    """

    ok: bool
    text: str
    file: bytes = b''


class Backups:
    """Runs the commands, a few at once."""

    def __init__(self) -> None:
        self._running = 0

    async def make(self, drive: DriveSnapshot) -> Done:
        """Back up the settings of a drive."""
        return await self._run(drive, lambda name, file: ['backup', name, '-o', file])

    async def compare(self, drive: DriveSnapshot, backup: bytes) -> Done:
        """Compare a drive with a backup; what differs is no failure."""
        return await self._run(drive, lambda name, file: ['compare', file, name], backup,
                               fine=(0, _DIFFERENT))

    async def restore(self, drive: DriveSnapshot, backup: bytes) -> Done:
        """Write a backup to a drive; what differs has been shown before."""
        return await self._run(drive, lambda name, file: ['restore', file, name, '--yes'], backup)

    async def _run(self, drive: DriveSnapshot, arguments: Callable[[str, str], list[str]],
                   backup: bytes | None = None, *, fine: Sequence[int] = (0,)) -> Done:
        if self._running >= _AT_ONCE:
            return Done(False, _BUSY)
        self._running += 1
        try:
            with tempfile.TemporaryDirectory(prefix='drive_can_panel_') as directory:
                file = Path(directory) / f'{drive.name.rpartition("/")[2]}.yaml'
                if backup is not None:
                    file.write_bytes(backup)
                namespace, _, name = drive.name.rpartition('/')
                command = [*arguments(name, str(file)), '--namespace', namespace or '/']
                code, text = await _command(command, directory)
                text = text.replace(f'{directory}/', '').strip()
                if code in fine:
                    made = file.read_bytes() if backup is None else b''
                    return Done(True, text or 'nothing differs', made)
                return Done(False, _for_a_browser(text) or f'drive_can {command[0]} failed')
        finally:
            self._running -= 1


def _for_a_browser(text: str) -> str:
    """Say where options can be given that a command speaks of."""
    options = dict.fromkeys(_OPTION.findall(text))
    where = (f'{", ".join(options)}: of the command drive_can in a terminal; there is no such '
             'thing here')
    return f'{text}\n({where})' if options else text


async def _command(arguments: Sequence[str], directory: str) -> tuple[int, str]:
    """Run ``drive_can`` and return its exit code and what it said."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, '-m', 'drive_can_bridge.cli.main', *arguments,
        stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT, cwd=directory,
        env={**os.environ, 'NO_COLOR': '1', 'PYTHONIOENCODING': 'utf-8'})
    try:
        said, _ = await asyncio.wait_for(process.communicate(), TIMEOUT)
    except (asyncio.TimeoutError, TimeoutError):
        process.kill()
        await process.wait()
        return 2, f'not done after {TIMEOUT:.0f} s: given up'
    lines = said.decode(errors='replace')[:_TEXT_MAX].splitlines()
    return process.returncode or 0, '\n'.join(printable(line) for line in lines)
