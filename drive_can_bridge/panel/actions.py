# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The actions of a browser: each a request of its own, whose role the gate has found.

None of it moves a drive. Answers are JSON, ``{"success": bool, "text": words}`` at least; a stop
of all gets ``failed``, a line for each drive that does not stand, which ``text`` begins with.

Backups are made by ``drive_can backup``, ``compare``, ``restore``, each in a process of its own,
through the running bridge: one implementation, with the same rules and texts.
"""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
import json
import os
from pathlib import Path
import re
import sys
import tempfile
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.messages import around
from drive_can_bridge.core.text import counted, printable
from drive_can_bridge.monitor.snapshot import DriveSnapshot, OperationOutcome, StopAction
from drive_can_bridge.panel.access import PanelRole, ROLE
from drive_can_bridge.panel.feed import Feed

#: s that one may take: some protocols read ten parameters a second
TIMEOUT = 300.0
#: at once, for all browsers together
_AT_ONCE = 2
_TEXT_MAX = 20_000
_DIFFERENT = 1
_OPTION = re.compile(r'(?<!\S)--[a-z][a-z-]*')
_BUSY = command_sentences.panel_busy()


@dataclass(frozen=True, slots=True)
class Done(OperationOutcome):
    """The outcome of a command: ``file`` is what it wrote."""

    file: bytes = b''


def _for_a_browser(text: str) -> str:
    """Return a command's text with a remark on where its options can be given."""
    options = dict.fromkeys(_OPTION.findall(text))
    where = (f'{", ".join(options)}: of the command drive_can in a terminal; there is no such '
             'thing here')
    return f'{text}\n({where})' if options else text


async def _command(arguments: Sequence[str], directory: str) -> tuple[int, str]:
    """Run ``drive_can``; return its exit code and output."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, '-m', 'drive_can_bridge.cli.main', *arguments,
        stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT, cwd=directory,
        env={**os.environ, 'NO_COLOR': '1', 'PYTHONIOENCODING': 'utf-8'})
    talk = asyncio.ensure_future(process.communicate())
    late = ''
    try:
        if not (await asyncio.wait([talk], timeout=TIMEOUT))[0]:
            _ask_to_end(process)
            late = around(command_sentences.panel_too_late(seconds=TIMEOUT), behind='\n')
        said, _ = await talk
    except asyncio.CancelledError:      # the panel ends, and would kill what it leaves behind
        _ask_to_end(process)
        while process.returncode is None:
            with suppress(asyncio.CancelledError):
                await process.wait()
        raise
    lines = said.decode(errors='replace')[:_TEXT_MAX].splitlines()
    code = process.returncode or 0
    return code, (late if code else '') + '\n'.join(printable(line) for line in lines)


def _ask_to_end(process: asyncio.subprocess.Process) -> None:
    """Ask it to end: a restore leaves the drive's mode first, and prints what was written."""
    with suppress(ProcessLookupError):
        process.terminate()


ALL = '*'
NO_WRITES = command_sentences.panel_without_writes()


class _Refused(Exception):
    """A request that cannot be carried out."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class Actions:
    """
    The requests.

    :param allow_writes: operators may write parameters and restore backups.
    """

    def __init__(self, feed: Feed, *, allow_writes: bool) -> None:
        self._feed = feed
        self._allow_writes = allow_writes
        self._running = 0

    def routes(self) -> list[Route]:
        """Return the routes of the web server."""
        found = [Route(f'/do/{stop.value}', self._stopping(stop), methods=['POST'])
                 for stop in StopAction]
        found += [Route(f'/do/{name}', _answering(action), methods=['POST'])
                  for name, action in (('write', self._write), ('compare', self._compare),
                                       ('restore', self._restore))]
        return [*found, Route('/do/backup', _answering(self._backup), methods=['GET'])]

    def _stopping(self, stop: StopAction) -> Callable[[Request], Awaitable[Response]]:
        async def action(request: Request) -> Response:
            _operator(request, stop.value.replace('_', ' '))
            wanted = (await _fields(request)).get('drive')
            if wanted != ALL or stop is not StopAction.QUICK_STOP:
                return _said(await self._feed.stop(self._drive(wanted), stop))
            return await self._stop_all()
        return _answering(action)

    async def _stop_all(self) -> Response:
        """Stop all drives at once; answer with those first that do not stand."""
        told = await self._feed.stop_all()
        failed = [f'{name[1:]}: {outcome.text or "not stopped"}'
                  for name, outcome in told if not outcome.success]
        count = (f'{len(told) - len(failed)} of {counted(len(told), "drive")} '
                 'stopped' if told else 'no drive is known here: nothing was stopped')
        return JSONResponse({'success': bool(told) and not failed, 'failed': failed,
                             'text': '\n'.join([*failed, count])})

    async def _write(self, request: Request) -> Response:
        self._writer(request, 'writing a parameter')
        fields = await _fields(request)
        drive = self._drive(fields.get('drive'))
        name, text = fields.get('name'), fields.get('value')
        info = next((info for info in drive.parameters if info.name == name), None)
        if not drive.parameters:
            return _said(OperationOutcome(False,
                                          command_sentences.panel_knows_no_parameters(
                                              drive=drive.label)))
        if info is None:
            raise _Refused(400, command_sentences.panel_no_parameter(drive=drive.label))
        if info.refusal:
            return _said(OperationOutcome(False, f'{info.name}: {info.refusal}'))
        if not isinstance(text, str):
            raise _Refused(400, command_sentences.panel_no_value(name=info.name))
        try:
            value = info.parse(text)
        except ValueRefused as error:
            return _said(OperationOutcome(False, str(error)))
        outcome = await self._feed.write(drive.name, info.name, value)
        # the drive's present settings, whatever the outcome
        if info.readable:
            await self._feed.read(drive.name, [info.name])
        return _said(outcome)

    async def _backup(self, request: Request) -> Response:
        drive = self._drive(request.query_params.get('drive'))
        made = await self._run(drive, lambda name, file: ['backup', name, '-o', file])
        if not made.success:
            return Response(f'{made.text}\n', 503, media_type='text/plain')
        name = drive.name[1:].replace('/', '_')
        return Response(made.file, media_type='application/yaml', headers={
            'content-disposition': f'attachment; filename="{name}.yaml"',
            'cache-control': 'no-store'})

    async def _compare(self, request: Request) -> Response:
        _of_type(request, 'application/yaml')
        drive = self._drive(request.query_params.get('drive'))
        return _said(await self._run(drive, lambda name, file: ['compare', file, name],
                                     await request.body(), fine=(0, _DIFFERENT)))

    async def _restore(self, request: Request) -> Response:
        self._writer(request, 'restoring a backup')
        _of_type(request, 'application/yaml')
        drive = self._drive(request.query_params.get('drive'))
        # what differs has been shown before
        return _said(await self._run(
            drive, lambda name, file: ['restore', file, name, '--yes'], await request.body()))

    async def _run(self, drive: DriveSnapshot, arguments: Callable[[str, str], list[str]],
                   backup: bytes | None = None, *, fine: Sequence[int] = (0,)) -> Done:
        """
        Run a command on a backup, a few at once.

        :param arguments: returns them for the name of the drive and the file of the backup.
        :param backup: that was sent; None: the command makes it.
        :param fine: exit codes that are no failure.
        """
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
                return Done(False, _for_a_browser(text) or command_sentences.panel_command_failed(
                    command=command[0]))
        finally:
            self._running -= 1

    def _writer(self, request: Request, what: str) -> None:
        _operator(request, what)
        if not self._allow_writes:
            raise _Refused(403, NO_WRITES)

    def _drive(self, name: object) -> DriveSnapshot:
        drive = self._feed.drive(name) if isinstance(name, str) else None
        if drive is None:
            raise _Refused(404, command_sentences.panel_no_drive(name=printable(str(name))))
        return drive


def _operator(request: Request, what: str) -> None:
    if request.scope[ROLE] is not PanelRole.OPERATOR:
        raise _Refused(403, command_sentences.panel_needs_operator(what=what))


def _of_type(request: Request, kind: str) -> None:
    # a form of another page could not send this without a question to the user
    if request.headers.get('content-type', '').partition(';')[0] != kind:
        raise _Refused(415, command_sentences.panel_wrong_kind(kind=kind))


async def _fields(request: Request) -> dict[str, Any]:
    _of_type(request, 'application/json')
    try:
        fields = json.loads(await request.body())
    except (ValueError, RecursionError):
        fields = None
    if not isinstance(fields, dict):
        raise _Refused(400, command_sentences.panel_no_json())
    return fields


def _said(outcome: OperationOutcome) -> Response:
    return JSONResponse({'success': outcome.success, 'text': outcome.text})


def _answering(action: Callable[[Request], Awaitable[Response]],
               ) -> Callable[[Request], Awaitable[Response]]:
    async def answer(request: Request) -> Response:
        try:
            return await action(request)
        except _Refused as refused:
            return JSONResponse({'success': False, 'text': str(refused)}, refused.status)
    return answer
