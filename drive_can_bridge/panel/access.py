# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Who may come in: token, Host and Origin of a request, judged without any input or output.

*Host* keeps out DNS rebinding: a page of somebody else whose name suddenly leads to this machine
still says its own name. *Origin* and *Sec-Fetch-Site* keep out what other pages of the same
browser send here with the user's cookie. The *token* says who may look, and who may act.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
import ipaddress
import secrets
import socket
from urllib.parse import parse_qs

#: names of this machine that a browser on it may use
LOOPBACK_NAMES = frozenset({'localhost', '127.0.0.1', '[::1]'})
#: parameter of the address that is printed
TOKEN = 'token'


class Role(Enum):
    """What somebody may do."""

    VIEWER = 'viewer'
    OPERATOR = 'operator'


@dataclass(frozen=True, slots=True)
class Refusal:
    """
    Nobody comes in.

    :param status: of HTTP.
    :param reason: in words, for a person.
    """

    status: int
    reason: str


@dataclass(frozen=True, slots=True)
class Entry:
    """
    Somebody comes in.

    :param cookie: to be set: the token came with the address.
    """

    role: Role
    cookie: str | None = None


class Access:
    """
    The rules of one panel.

    :param port: cookies do not tell ports apart, so it is part of the cookie's name.
    :param host: where the panel listens.
    """

    def __init__(self, *, port: int, host: str = '127.0.0.1') -> None:
        self.tokens = {role: secrets.token_urlsafe(24) for role in Role}
        self.cookie_name = f'drive_can_panel_{port}'
        self._anywhere = not is_loopback(host)
        self._names = set(LOOPBACK_NAMES)
        if self._anywhere:
            names = {host, socket.gethostname(), socket.getfqdn(), f'{socket.gethostname()}.local'}
            self._names |= {name.lower() for name in names}

    def judge(self, scope_type: str, method: str, headers: Iterable[tuple[bytes, bytes]],
              query: bytes) -> Entry | Refusal:
        """
        Decide about a request.

        :param scope_type: ``http`` or ``websocket``.
        :param headers: as ASGI has them, names in lower case.
        """
        fields: dict[str, list[str]] = {}
        for name, value in headers:
            fields.setdefault(name.decode('latin-1'), []).append(value.decode('latin-1'))
        return (self._judge_host(fields) or _judge_origin(fields, scope_type, method)
                or self._judge_token(fields, scope_type, method, query))

    def _judge_host(self, fields: Mapping[str, list[str]]) -> Refusal | None:
        hosts = fields.get('host', [])
        name = _host_name(hosts[0]) if len(hosts) == 1 else ''
        if name in self._names or self._anywhere and _is_address(name):
            return None
        return Refusal(403, 'this panel does not answer to that name: use the address that '
                            'drive_can panel has printed')

    def _judge_token(self, fields: Mapping[str, list[str]], scope_type: str, method: str,
                     query: bytes) -> Entry | Refusal:
        given = parse_qs(query.decode('latin-1'), keep_blank_values=True).get(TOKEN, [])
        if given and scope_type == 'http' and method == 'GET':
            # who shows a token wants to be who it says, whatever cookie there is
            role = self._role(given[0])
            if role is not None:
                return Entry(role, f'{self.cookie_name}={given[0]}; HttpOnly; SameSite=Strict; '
                                   f'Path=/')
        else:
            role = self._role(_cookie(fields.get('cookie', []), self.cookie_name))
            if role is not None:
                return Entry(role)
        return Refusal(401, 'no valid token: open the address that drive_can panel has printed '
                            'when it started, with its token')

    def _role(self, token: str) -> Role | None:
        found = None
        for role, wanted in self.tokens.items():
            if secrets.compare_digest(token.encode(), wanted.encode()):
                found = role
        return found


def _judge_origin(fields: Mapping[str, list[str]], scope_type: str, method: str,
                  ) -> Refusal | None:
    origins, host = fields.get('origin', []), fields['host'][0].lower()
    # https: behind somebody who adds TLS
    if len(origins) > 1 or origins and origins[0].lower() not in (
            f'http://{host}', f'https://{host}'):
        return Refusal(403, 'another page has sent this (Origin): refused')
    site = fields.get('sec-fetch-site', ['none'])[0]
    # whoever follows a link only looks
    follows = (scope_type == 'http' and method == 'GET'
               and fields.get('sec-fetch-mode', [''])[0] == 'navigate'
               and fields.get('sec-fetch-dest', [''])[0] == 'document')
    if site not in ('same-origin', 'none') and not follows:
        return Refusal(403, 'another page has sent this (Sec-Fetch-Site): refused')
    return None


def is_loopback(host: str) -> bool:
    """Tell whether nobody but this machine reaches an address to listen on."""
    try:
        return ipaddress.ip_address(host.strip('[]')).is_loopback
    except ValueError:
        return host.lower() == 'localhost'


def _host_name(host: str) -> str:
    """Return a Host without its port; '' where it is none."""
    host = host.lower()
    name, colon, port = host.rpartition(':')
    if not colon or name.startswith('[') and not name.endswith(']'):
        return host
    return name if port.isdecimal() else ''


def _is_address(name: str) -> bool:
    """Tell whether a name is an address: nobody can have it lead elsewhere."""
    bracketed = name.startswith('[') and name.endswith(']')
    try:
        address = ipaddress.ip_address(name[1:-1] if bracketed else name)
    except ValueError:
        return False
    return bracketed == (address.version == 6)


def _cookie(headers: Iterable[str], name: str) -> str:
    # by hand: cookies do not tell ports apart, and for http.cookies one of another program that is
    # not as it should be hides all that follow
    for header in headers:
        for cookie in header.split(';'):
            found, _, value = cookie.strip().partition('=')
            if found == name:
                return value
    return ''
