# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The rules of who may come in, request by request."""

from urllib.parse import urlsplit

import pytest

from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.panel.access import AccessRefusal, Entry, is_loopback, PanelAccess, PanelRole

PORT = 8080


def judge(access: PanelAccess, *, host: str = '127.0.0.1:8080', method: str = 'GET',
          query: str = '',
          kind: str = 'http', cookie: str | None = None, **fields: str) -> Entry | AccessRefusal:
    """Judge a request with the cookie of a viewer."""
    if cookie is None:
        cookie = f'drive_can_panel_8080={access.tokens[PanelRole.VIEWER]}'
    headers = {'host': host, 'cookie': cookie,
               **{name.replace('_', '-'): value for name, value in fields.items()}}
    return access.judge(kind, method, [(name.encode(), value.encode('latin-1'))
                                       for name, value in headers.items()], query.encode())


def refused(judgement: Entry | AccessRefusal) -> int:
    """Return the status of a refusal."""
    assert isinstance(judgement, AccessRefusal)
    return judgement.status


def test_the_token_of_each_role_opens_and_becomes_a_cookie() -> None:
    access = PanelAccess(port=PORT)
    for role in PanelRole:
        entry = judge(access, query=f'token={access.tokens[role]}', cookie='')
        cookie = f'drive_can_panel_8080={access.tokens[role]}; HttpOnly; SameSite=Strict; Path=/'
        assert entry == Entry(role, cookie)
        assert judge(access, cookie=f'a=b; drive_can_panel_8080={access.tokens[role]}') == (
            Entry(role))


@pytest.mark.parametrize('other', ['a[b]=1', 'a={"b":"c d"}', 'a="', '=', 'a', 'ä=ö', 'a=b=c',
                                   'drive_can_panel_9000=x'])
def test_cookies_of_other_programs_are_in_nobody_s_way(other: str) -> None:
    # they have one jar for all ports of a host
    access = PanelAccess(port=PORT)
    own = f'drive_can_panel_8080={access.tokens[PanelRole.OPERATOR]}'
    for cookie in (f'{other}; {own}', f'{own}; {other}', f'{other};{own};{other}'):
        assert judge(access, cookie=cookie) == Entry(PanelRole.OPERATOR)


@pytest.mark.parametrize('cookie', [
    '', 'drive_can_panel_8080=', 'drive_can_panel_8080=x', 'drive_can_panel_8081={token}',
    'drive_can_panel_8080={token}x', 'token={token}', '\xff\x00;=;;', 'drive_can_panel_8080=\xfc'])
def test_other_cookies_open_nothing(cookie: str) -> None:
    access = PanelAccess(port=PORT)
    assert refused(judge(access,
                         cookie=cookie.format(token=access.tokens[PanelRole.VIEWER]))) == 401


def test_a_wrong_token_is_one_whatever_the_cookie() -> None:
    access = PanelAccess(port=PORT)
    assert refused(judge(access, query='token=guessed')) == 401


def test_a_token_in_the_address_opens_pages_only() -> None:
    access = PanelAccess(port=PORT)
    query = f'token={access.tokens[PanelRole.OPERATOR]}'
    assert refused(judge(access, query=query, method='POST', cookie='')) == 401
    assert refused(judge(access, query=query, kind='websocket', cookie='')) == 401


def test_tokens_of_two_panels_differ() -> None:
    first, second = PanelAccess(port=PORT), PanelAccess(port=PORT)
    assert len({*first.tokens.values(), *second.tokens.values()}) == 4
    assert all(len(token) >= 32 for token in first.tokens.values())


@pytest.mark.parametrize('host', ['127.0.0.1:8080', 'localhost:8080', 'LOCALHOST', '[::1]:8080',
                                  'localhost:9000'])
def test_names_of_this_machine(host: str) -> None:
    assert isinstance(judge(PanelAccess(port=PORT), host=host), Entry)


@pytest.mark.parametrize('host', [
    'evil.example:8080', 'localhost.evil.example', '', '127.0.0.1.evil.example:8080', '::1',
    '10.0.0.7:8080', 'localhost:8080:8080', 'localhost@evil.example', '[::1', '127.0.0.1:x'])
def test_foreign_names_are_refused(host: str) -> None:
    assert refused(judge(PanelAccess(port=PORT), host=host)) == 403


def test_on_the_network_addresses_are_names_and_others_still_are_not() -> None:
    access = PanelAccess(port=PORT, host='0.0.0.0')
    assert isinstance(judge(access, host='192.168.1.7:8080'), Entry)
    assert isinstance(judge(access, host='[fe80::1]:8080'), Entry)
    assert refused(judge(access, host='evil.example:8080')) == 403
    assert isinstance(judge(PanelAccess(port=PORT, host='robot.lan'), host='robot.lan:8080'),
                      Entry)


@pytest.mark.parametrize(('host', 'sent'), [
    ('127.0.0.2', '127.0.0.2:8080'), ('127.1.2.3', '127.1.2.3'), ('::1', '[::1]:8080'),
    ('[::1]', '[::1]'), ('0:0:0:0:0:0:0:1', '[::1]:8080'), ('::ffff:127.0.0.1', '[::ffff:7f00:1]'),
    ('fe80::1', '[fe80::1]:8080'), ('localhost', 'localhost:8080'), ('LOCALHOST', 'localhost')])
def test_where_it_listens_it_answers(host: str, sent: str) -> None:
    access = PanelAccess(port=PORT, host=host)
    assert isinstance(judge(access, host=sent), Entry)
    assert refused(judge(access, host='evil.example:8080')) == 403
    if is_loopback(host):
        assert refused(judge(access, host='127.9.9.9:8080')) == 403
        assert refused(judge(access, host='[fe80::2]:8080')) == 403


@pytest.mark.parametrize('host', ['127.0.0.1', '127.0.0.2', 'localhost'])
def test_the_address_that_is_printed_opens_it(host: str) -> None:
    pytest.importorskip('uvicorn')
    from drive_can_bridge.panel.server import address, listen
    with listen(host, 0) as listener:
        access = PanelAccess(port=listener.getsockname()[1], host=host)
        printed = urlsplit(address(listener, access.tokens[PanelRole.VIEWER]))
    assert isinstance(judge(access, host=printed.netloc, query=printed.query, cookie=''), Entry)


@pytest.mark.parametrize('host', ['a..b', 'x' * 70, '192.0.2.300'])
def test_what_is_no_host(host: str) -> None:
    pytest.importorskip('uvicorn')
    from drive_can_bridge.panel.server import listen
    with pytest.raises(DriveCanError, match=f'{host}, port 0: .*, --host chooses another$'):
        listen(host, 0)


def test_two_hosts_or_none_are_refused() -> None:
    access = PanelAccess(port=PORT)
    two = [(b'host', b'127.0.0.1'), (b'host', b'evil.example')]
    assert refused(access.judge('http', 'GET', two, b'')) == 403
    assert refused(access.judge('http', 'GET', [], b'')) == 403


@pytest.mark.parametrize('origin', [
    'http://evil.example', 'http://127.0.0.1:3000', 'null', '', 'http://127.0.0.1',
    'http://127.0.0.1:8080.evil.example', 'file://'])
@pytest.mark.parametrize('kind', ['http', 'websocket'])
def test_another_origin_is_refused(origin: str, kind: str) -> None:
    assert refused(judge(PanelAccess(port=PORT), origin=origin, kind=kind)) == 403


@pytest.mark.parametrize('origin', ['http://127.0.0.1:8080', 'https://127.0.0.1:8080'])
def test_the_own_origin_is_not(origin: str) -> None:
    assert isinstance(judge(PanelAccess(port=PORT), origin=origin), Entry)


def test_another_site_may_lead_here_and_no_more() -> None:
    access = PanelAccess(port=PORT)
    follows = {'sec_fetch_site': 'cross-site', 'sec_fetch_mode': 'navigate',
               'sec_fetch_dest': 'document'}
    assert isinstance(judge(access, **follows), Entry)
    assert refused(judge(access, method='POST', **follows)) == 403
    assert refused(judge(access, **{**follows, 'sec_fetch_dest': 'iframe'})) == 403
    assert refused(judge(access, sec_fetch_site='same-site', sec_fetch_mode='no-cors')) == 403


@pytest.mark.parametrize(('host', 'loopback'), [
    ('127.0.0.1', True), ('127.1.2.3', True), ('::1', True), ('localhost', True),
    ('0.0.0.0', False), ('192.168.1.7', False), ('robot', False), ('', False)])
def test_what_the_loopback_is(host: str, loopback: bool) -> None:
    assert is_loopback(host) is loopback
