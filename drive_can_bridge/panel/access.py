# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Access to the panel: token, Host and Origin of a request, checked without any input or output.

*Host* keeps out DNS rebinding: a page whose name suddenly leads to this machine still sends its
own name. *Origin* and *Sec-Fetch-Site* keep out what other pages of the same browser send with the
user's cookie. The *token* decides who may look, and who may act. The ASGI middleware lets nothing
in but by these.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
import html
import http
import ipaddress
from pathlib import Path
import secrets
import socket
from string import Template
from typing import Any
from urllib.parse import parse_qs

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from drive_can_bridge.core import command_sentences
from drive_can_bridge.monitor.snapshot import StopAction

#: with colours as in panel.css, which refused requests do not get
_PAGE = Template((Path(__file__).parent / 'static' / 'refused.html').read_text(encoding='utf-8'))


def plain_page(status: int, reason: str) -> str:
    """Return a page of HTML; the reason is text."""
    return _PAGE.substitute(title=http.HTTPStatus(status).phrase,
                            reason=html.escape(reason[:1].upper() + reason[1:]))


#: names of this machine that a browser on it may use
LOOPBACK_NAMES = frozenset({'localhost', '127.0.0.1', '[::1]'})
_Address = ipaddress.IPv4Address | ipaddress.IPv6Address
#: parameter of the address that is printed
TOKEN = 'token'


class PanelRole(Enum):
    """The roles of users."""

    VIEWER = 'viewer'
    OPERATOR = 'operator'


@dataclass(frozen=True, slots=True)
class AccessRefusal:
    """
    A refused request.

    :param status: of HTTP.
    :param reason: in words, for people.
    """

    status: int
    reason: str


@dataclass(frozen=True, slots=True)
class Entry:
    """
    An accepted request.

    :param cookie: to be set: the token came with the address.
    """

    role: PanelRole
    cookie: str | None = None


class PanelAccess:
    """
    The rules of one panel.

    :param port: cookies do not tell ports apart, so it is part of the cookie's name.
    :param host: where the panel listens.
    """

    def __init__(self, *, port: int, host: str = '127.0.0.1') -> None:
        self.tokens = {role: secrets.token_urlsafe(24) for role in PanelRole}
        self.cookie_name = f'drive_can_panel_{port}'
        self._anywhere = not is_loopback(host)
        self._own = _address(host.strip('[]'))
        self._names = set(LOOPBACK_NAMES)
        if self._anywhere:
            names = {host, socket.gethostname(), socket.getfqdn(), f'{socket.gethostname()}.local'}
            self._names |= {name.lower() for name in names}

    def judge(self, scope_type: str, method: str, headers: Iterable[tuple[bytes, bytes]],
              query: bytes) -> Entry | AccessRefusal:
        """
        Check a request; return its role, or a refusal.

        :param scope_type: ``http`` or ``websocket``.
        :param headers: as ASGI has them, names in lower case.
        """
        fields: dict[str, list[str]] = {}
        for name, value in headers:
            fields.setdefault(name.decode('latin-1'), []).append(value.decode('latin-1'))
        return (self._judge_host(fields) or _judge_origin(fields, scope_type, method)
                or self._judge_token(fields, scope_type, method, query))

    def _judge_host(self, fields: Mapping[str, list[str]]) -> AccessRefusal | None:
        hosts = fields.get('host', [])
        name = _host_name(hosts[0]) if len(hosts) == 1 else ''
        address = _host_address(name)
        if name in self._names or address and (self._anywhere or address == self._own):
            return None
        return AccessRefusal(403, command_sentences.panel_other_name())

    def _judge_token(self, fields: Mapping[str, list[str]], scope_type: str, method: str,
                     query: bytes) -> Entry | AccessRefusal:
        given = parse_qs(query.decode('latin-1'), keep_blank_values=True).get(TOKEN, [])
        if given and scope_type == 'http' and method == 'GET':
            # a shown token decides the role, whatever cookie there is
            role = self._role(given[0])
            if role is not None:
                return Entry(role, f'{self.cookie_name}={given[0]}; HttpOnly; SameSite=Strict; '
                                   f'Path=/')
        else:
            role = self._role(_cookie(fields.get('cookie', []), self.cookie_name))
            if role is not None:
                return Entry(role)
        return AccessRefusal(401,
                             command_sentences.panel_no_token())

    def _role(self, token: str) -> PanelRole | None:
        found = None
        for role, wanted in self.tokens.items():
            if secrets.compare_digest(token.encode(), wanted.encode()):
                found = role
        return found


def _judge_origin(fields: Mapping[str, list[str]], scope_type: str, method: str,
                  ) -> AccessRefusal | None:
    origins, host = fields.get('origin', []), fields['host'][0].lower()
    # https: behind a proxy that adds TLS
    if len(origins) > 1 or origins and origins[0].lower() not in (
            f'http://{host}', f'https://{host}'):
        return AccessRefusal(403, command_sentences.panel_other_origin())
    site = fields.get('sec-fetch-site', ['none'])[0]
    # a followed link only looks
    follows = (scope_type == 'http' and method == 'GET'
               and fields.get('sec-fetch-mode', [''])[0] == 'navigate'
               and fields.get('sec-fetch-dest', [''])[0] == 'document')
    if site not in ('same-origin', 'none') and not follows:
        return AccessRefusal(403, command_sentences.panel_other_site())
    return None


def is_loopback(host: str) -> bool:
    """Return whether an address to listen on is reached from this machine only."""
    address = _address(host.strip('[]'))
    return address.is_loopback if address else host.lower() == 'localhost'


def _host_name(host: str) -> str:
    """Return a Host without its port; '' where it is none."""
    host = host.lower()
    name, colon, port = host.rpartition(':')
    if not colon or name.startswith('[') and not name.endswith(']'):
        return host
    return name if port.isdecimal() else ''


def _host_address(name: str) -> _Address | None:
    """Return the address in a Host; None where it is a name, which may lead elsewhere."""
    bracketed = name.startswith('[') and name.endswith(']')
    address = _address(name[1:-1] if bracketed else name)
    return address if address and bracketed == (address.version == 6) else None


def _address(text: str) -> _Address | None:
    try:
        return ipaddress.ip_address(text)
    except ValueError:
        return None


def _cookie(headers: Iterable[str], name: str) -> str:
    # by hand: cookies do not tell ports apart, and for http.cookies one of another program that is
    # not as it should be hides all that follow
    for header in headers:
        for cookie in header.split(';'):
            found, _, value = cookie.strip().partition('=')
            if found == name:
                return value
    return ''


#: where the role of a request stands in its scope
ROLE = 'drive_can_role'
#: where it stands how a connection comes in
ENTER = 'drive_can_enter'
#: a stop finds a place when all are taken
_STOPS = frozenset(f'/do/{stop.value}' for stop in StopAction)
#: bytes that a request may carry: a backup has some tens of thousands
BODY_MAX = 1_000_000

#: The pages load nothing from elsewhere, talk to no other host, and are in no other frame: a stop
#: must not be clicked in disguise, nor a drive's name become a script's address.
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
_NO_PLACE = AccessRefusal(503, command_sentences.panel_full())
_TOO_MUCH = AccessRefusal(413, command_sentences.panel_too_much(most=BODY_MAX))


class Gate:
    """
    The middleware.

    :param app: gets accepted requests only; their role is ``scope[ROLE]``.
    """

    def __init__(self, app: ASGIApp, access: PanelAccess) -> None:
        self.app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass an accepted request on, or refuse it."""
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
    """Admit a connection; return False: all places are taken."""
    enter = scope.get(ENTER)    # a WebSocket has come in before it became one
    return enter is None or enter(
        entry.role, stop=entry.role is PanelRole.OPERATOR and scope['path'] in _STOPS)


def _limited(receive: Receive) -> Receive:
    """Return a receive that accepts no more than a body may have, whatever was declared."""
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


async def _refuse(refusal: AccessRefusal, scope: Scope, send: Send) -> None:
    """Send a refusal, in words."""
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
