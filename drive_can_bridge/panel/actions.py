# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a browser may ask for: each a request of its own, whose role the gate has found.

None of it moves a drive. Answers are JSON, ``{"success": bool, "text": words}`` at least; whoever
stops all gets ``failed``, a line for each drive that does not stand, which ``text`` begins with.
"""

import asyncio
from collections.abc import Awaitable, Callable
import json
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.text import printable
from drive_can_bridge.core.words import counted
from drive_can_bridge.monitor.snapshot import DriveSnapshot
from drive_can_bridge.monitor.source import Outcome, Stop
from drive_can_bridge.panel.access import Role
from drive_can_bridge.panel.backups import Backups
from drive_can_bridge.panel.feed import Feed
from drive_can_bridge.panel.gate import ROLE

ALL = '*'
NO_WRITES = 'this panel was started without --allow-writes'


class _Refused(Exception):
    """A request that cannot be obeyed."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class Actions:
    """
    The requests.

    :param allow_writes: parameters may be written and backups restored, by an operator.
    """

    def __init__(self, feed: Feed, backups: Backups, *, allow_writes: bool) -> None:
        self._feed = feed
        self._backups = backups
        self._allow_writes = allow_writes

    def routes(self) -> list[Route]:
        """Return what the web server offers."""
        found = [Route(f'/do/{stop.value}', self._stopping(stop), methods=['POST'])
                 for stop in Stop]
        found += [Route(f'/do/{name}', _answering(action), methods=['POST'])
                  for name, action in (('write', self._write), ('compare', self._compare),
                                       ('restore', self._restore))]
        return [*found, Route('/do/backup', _answering(self._backup), methods=['GET'])]

    def _stopping(self, stop: Stop) -> Callable[[Request], Awaitable[Response]]:
        async def action(request: Request) -> Response:
            _operator(request, stop.value.replace('_', ' '))
            wanted = (await _fields(request)).get('drive')
            if wanted != ALL or stop is not Stop.QUICK_STOP:
                return _said(await self._feed.stop(self._drive(wanted), stop))
            return await self._stop_all()
        return _answering(action)

    async def _stop_all(self) -> Response:
        """Stop all drives at once; say first which do not stand."""
        drives = self._feed.snapshot.drives
        outcomes = await asyncio.gather(*(self._feed.stop(drive, Stop.QUICK_STOP)
                                          for drive in drives))
        failed = [f'{drive.name[1:]}: {outcome.text or "not stopped"}'
                  for drive, outcome in zip(drives, outcomes) if not outcome.success]
        count = (f'{len(drives) - len(failed)} of {counted(len(drives), "drive", "drives")} '
                 'stopped' if drives else 'no drive is known here: nothing was stopped')
        return JSONResponse({'success': bool(drives) and not failed, 'failed': failed,
                             'text': '\n'.join([*failed, count])})

    async def _write(self, request: Request) -> Response:
        self._writer(request, 'writing a parameter')
        fields = await _fields(request)
        drive = self._drive(fields.get('drive'))
        name, text = fields.get('name'), fields.get('value')
        info = next((info for info in drive.parameters if info.name == name), None)
        if not drive.parameters:
            return _said(Outcome(False, f'{drive.label} has not told of its parameters yet'))
        if info is None:
            raise _Refused(400, f'{drive.label} has no such parameter')
        if info.refusal:
            return _said(Outcome(False, f'{info.name}: {info.refusal}'))
        if not isinstance(text, str):
            raise _Refused(400, f'{info.name}: no value, allowed is a string: what a person types')
        try:
            value = info.parse(text)
        except ValueRefused as error:
            return _said(Outcome(False, str(error)))
        outcome = await self._feed.write(drive.name, info.name, value)
        # what the drive has now, whatever has become of it
        if info.readable:
            await self._feed.read(drive.name, [info.name])
        return _said(outcome)

    async def _backup(self, request: Request) -> Response:
        drive = self._drive(request.query_params.get('drive'))
        made = await self._backups.make(drive)
        if not made.ok:
            return Response(f'{made.text}\n', 503, media_type='text/plain')
        name = drive.name[1:].replace('/', '_')
        return Response(made.file, media_type='application/yaml', headers={
            'content-disposition': f'attachment; filename="{name}.yaml"',
            'cache-control': 'no-store'})

    async def _compare(self, request: Request) -> Response:
        _of_type(request, 'application/yaml')
        drive = self._drive(request.query_params.get('drive'))
        compared = await self._backups.compare(drive, await request.body())
        return JSONResponse({'success': compared.ok, 'text': compared.text})

    async def _restore(self, request: Request) -> Response:
        self._writer(request, 'restoring a backup')
        _of_type(request, 'application/yaml')
        drive = self._drive(request.query_params.get('drive'))
        restored = await self._backups.restore(drive, await request.body())
        return JSONResponse({'success': restored.ok, 'text': restored.text})

    def _writer(self, request: Request, what: str) -> None:
        _operator(request, what)
        if not self._allow_writes:
            raise _Refused(403, NO_WRITES)

    def _drive(self, name: object) -> DriveSnapshot:
        drive = self._feed.drive(name) if isinstance(name, str) else None
        if drive is None:
            raise _Refused(404, f'no drive {printable(str(name))} here')
        return drive


def _operator(request: Request, what: str) -> None:
    if request.scope[ROLE] is not Role.OPERATOR:
        raise _Refused(403, f"{what} needs the operator's token; this browser came with the "
                            f"viewer's")


def _of_type(request: Request, kind: str) -> None:
    # a form of another page could not say this without being asked about
    if request.headers.get('content-type', '').partition(';')[0] != kind:
        raise _Refused(415, f'say it in {kind}')


async def _fields(request: Request) -> dict[str, Any]:
    _of_type(request, 'application/json')
    try:
        fields = json.loads(await request.body())
    except (ValueError, RecursionError):
        fields = None
    if not isinstance(fields, dict):
        raise _Refused(400, 'that is no JSON object')
    return fields


def _said(outcome: Outcome) -> Response:
    return JSONResponse({'success': outcome.success, 'text': outcome.text})


def _answering(action: Callable[[Request], Awaitable[Response]],
               ) -> Callable[[Request], Awaitable[Response]]:
    async def answer(request: Request) -> Response:
        try:
            return await action(request)
        except _Refused as refused:
            return JSONResponse({'success': False, 'text': str(refused)}, refused.status)
    return answer
