# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The ASGI middleware in front of everything: nothing comes in but by :mod:`.access`."""

import http
from typing import Any

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from drive_can_bridge.monitor.source import Stop
from drive_can_bridge.panel.access import Access, Entry, Refusal, Role
from drive_can_bridge.panel.plain import plain_page

#: where the role of a request stands in its scope
ROLE = 'drive_can_role'
#: where it stands how a connection comes in
ENTER = 'drive_can_enter'
#: a stop finds a place when all are taken
_STOPS = frozenset(f'/do/{stop.value}' for stop in Stop)
#: bytes that a request may carry: a backup has some tens of thousands
BODY_MAX = 1_000_000

#: The pages load nothing from elsewhere, talk to nobody else, and stand in nobody's frame: a stop
#: must not be clicked in somebody else's disguise, nor a drive's name become a script's address.
_HEADERS = [
    (b'content-security-policy',
     b"default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
     b"style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
     b"object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"),
    (b'x-frame-options', b'DENY'),
    (b'x-content-type-options', b'nosniff'),
    (b'referrer-policy', b'no-referrer'),
    (b'cross-origin-resource-policy', b'same-origin'),
    (b'cross-origin-opener-policy', b'same-origin'),
]
_NO_PLACE = Refusal(503, 'too many connections are open already: try again in a while')
_TOO_MUCH = Refusal(413, f'too much at once: at most {BODY_MAX} bytes')


class Gate:
    """
    The middleware.

    :param app: sees only those who may come in; their role is ``scope[ROLE]``.
    """

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self.app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let somebody in, or not."""
        if scope['type'] == 'lifespan':
            await self.app(scope, receive, send)
            return
        judgement = self._access.judge(scope['type'], scope.get('method', 'GET'),
                                       scope['headers'], scope['query_string'])
        if isinstance(judgement, Entry) and not _enters(scope, judgement):
            judgement = _NO_PLACE
        if isinstance(judgement, Entry):
            scope = {**scope, ROLE: judgement.role}
            if scope['type'] == 'websocket':
                await self.app(scope, receive, send)
                return
            declared = dict(scope['headers']).get(b'content-length', b'0')
            if declared.isdigit() and int(declared) <= BODY_MAX:
                await self.app(scope, _limited(receive), _dressed(send, judgement.cookie))
                return
            judgement = _TOO_MUCH
        await _refuse(judgement, scope, _dressed(send, None))


def _enters(scope: Scope, entry: Entry) -> bool:
    """Let a connection in; False: all places are taken."""
    enter = scope.get(ENTER)    # a WebSocket has come in before it became one
    return enter is None or enter(
        stop=entry.role is Role.OPERATOR and scope['path'] in _STOPS)


def _limited(receive: Receive) -> Receive:
    """Return a receive that takes no more than a body may have, whatever was declared."""
    taken = 0

    async def limited() -> Message:
        nonlocal taken
        message = await receive()
        taken += len(message.get('body', b''))
        if taken > BODY_MAX:
            raise HTTPException(_TOO_MUCH.status, _TOO_MUCH.reason, {'connection': 'close'})
        return message
    return limited


def _dressed(send: Send, cookie: str | None) -> Send:
    """Return a send that adds what every response carries."""
    async def dressed(message: Message) -> None:
        if message['type'] in ('http.response.start', 'websocket.http.response.start'):
            headers = [*message.get('headers', []), *_HEADERS]
            if cookie is not None:
                headers.append((b'set-cookie', cookie.encode('ascii')))
            message = {**message, 'headers': headers}
        await send(message)
    return dressed


async def _refuse(refusal: Refusal, scope: Scope, send: Send) -> None:
    """Say no, in words."""
    websocket = scope['type'] == 'websocket'
    if websocket and 'websocket.http.response' not in scope.get('extensions', {}):
        await send({'type': 'websocket.close', 'code': 1008})  # becomes a 403
        return
    wants_page = any(name == b'accept' and b'text/html' in value
                     for name, value in scope['headers'])
    body = (plain_page(refusal.status, refusal.reason) if wants_page
            else f'{http.HTTPStatus(refusal.status).phrase}: {refusal.reason}\n').encode()
    kind = b'text/html' if wants_page else b'text/plain'
    prefix = 'websocket.' if websocket else ''
    start: dict[str, Any] = {
        'type': f'{prefix}http.response.start', 'status': refusal.status, 'headers': [
            (b'content-type', kind + b'; charset=utf-8'),
            (b'content-length', str(len(body)).encode()), (b'cache-control', b'no-store'),
            (b'connection', b'close')]}
    await send(start)
    await send({'type': f'{prefix}http.response.body', 'body': body})
