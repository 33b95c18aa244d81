# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Whoever may look, and says what no page says: over the channel that pages have, by polling."""

from collections.abc import Iterator
import html
import json
import re
import time

from panel_builders import Answer, Site
import pytest
from waiting import wait_for

pytest.importorskip('rclpy')
pytest.importorskip('nicegui', reason="needs the extra 'panel'")

PONG = '3'
CHANNEL = '/_nicegui_ws/socket.io/?EIO=4&transport=polling'
#: values that no element of a page sends, each as its arguments
ODD = [[], ['7'], ['null'], ['{"a": [1]}'], ['"<script>"'], ['[[1]]'], ['1', '2'], ['{'],
       [json.dumps('y' * 100_000)]]


class Channel:
    """
    A page of somebody, without a browser.

    :param role: whose cookie is shown.
    :param page: whose page it is.
    """

    def __init__(self, site: Site, role: str, page: str) -> None:
        self._site = site
        self._role = role
        self._alive_at = time.monotonic()
        text = site.get(page, role).text
        self.client = self._find(r"'client_id': '([0-9a-f-]{36})'", text)
        elements = self._find(r'parseElements\(String\.raw`(.*?)`\)', text)
        self.listeners: list[tuple[int, str]] = [
            (int(number), event['listener_id'])
            for number, element in json.loads(html.unescape(elements)).items()
            for event in element.get('events', [])]
        query = (f'&client_id={self.client}&tab_id=tab&document_id=document&next_message_id=0'
                 '&implicit_handshake=true')
        opened = site.get(f'{CHANNEL}{query}', role)
        self._path = f'{CHANNEL}&sid={json.loads(opened.text[1:])["sid"]}'
        assert self.send('40').status == 200
        assert site.get(self._path, role).text.startswith('40{')

    @staticmethod
    def _find(pattern: str, text: str) -> str:
        found = re.search(pattern, text, re.DOTALL)
        assert found is not None, f'{pattern} in {text}'
        return found[1]

    def send(self, packet: str, role: str | None = None) -> Answer:
        """Send what would be a frame of the WebSocket."""
        return self._site.ask('POST', self._path, role or self._role, {
            'Content-Type': 'text/plain', 'Origin': f'http://{self._site.host}'}, packet.encode())

    def tell(self, event: str, message: object) -> None:
        """Send an event, and now and then what keeps a page alive that is slow."""
        if time.monotonic() - self._alive_at > 1.0:
            self._alive_at = time.monotonic()
            assert self.send(PONG).status == 200
        assert self.send(f'42{json.dumps([event, message])}').status == 200

    def log(self, text: str) -> None:
        """Tell what browsers may tell of their troubles."""
        self.tell('log', {'client_id': self.client, 'level': 'error', 'message': text})


@pytest.fixture(autouse=True)
def goes_on(site: Site) -> Iterator[None]:
    """Look whether panel and bridge go on, and what was said of it."""
    yield
    site.check_alive()
    assert all(line.startswith('drive_can panel: ') for line in site.panel.errors.splitlines())


@pytest.mark.parametrize('page', ['/', '/drive/conveyor', '/log'])
def test_no_element_of_a_page_can_be_harmed(site: Site, page: str) -> None:
    channel = Channel(site, 'viewer', page)
    for element, listener in channel.listeners:
        for arguments in ODD:
            channel.tell('event', {'client_id': channel.client, 'id': element,
                                   'listener_id': listener, 'args': arguments})
    # others see their pages
    assert site.get(page, 'operator').status == 200


def test_what_is_no_message_is_thrown_away(site: Site) -> None:
    channel = Channel(site, 'viewer', '/')
    for message in (7, None, [], {}, {'client_id': 'nobody'}, {'client_id': channel.client}):
        for event in ('event', 'handshake', 'log', 'ack', 'javascript_response', 'nothing'):
            channel.tell(event, message)
    for packet in ('4', '42', '42[', '42{}', '42["event"]', '45-["x"]', '9', '\x1e\x1e', '41',
                   '451-["event",{"_placeholder":true,"num":0}]', f'42["event",{"[" * 50_000}'):
        Channel(site, 'viewer', '/').send(packet)
    assert site.get(f'{CHANNEL}&sid=%1b%5b2J', 'viewer').status == 400


def test_what_a_browser_says_neither_rules_nor_fills_the_terminal(site: Site) -> None:
    channel = Channel(site, 'viewer', '/')
    before = len(site.panel.errors.splitlines())
    for number in range(200):
        channel.log(f'{number} \x1b[2J\x1b]0;title\x07\u202e {"x" * 5000}')
    wait_for(lambda: site.do('disable', 'operator', {'drive': '/lift'}).said['success'],
             'that it goes on')
    lines = site.panel.errors.splitlines()
    assert len(lines) - before <= 20
    assert all(line.isprintable() and len(line) < 300 for line in lines)


def test_a_page_of_an_operator_makes_nobody_one(site: Site) -> None:
    channel = Channel(site, 'operator', '/')
    # whoever has got hold of its number
    assert channel.send('42["event",{}]', 'viewer').status == 200
    answer = site.do('quick_stop', 'viewer', {'drive': '/lift'})
    assert answer.status == 403
    # nor does anybody without a token take part
    assert site.get(f'{CHANNEL}&client_id={channel.client}').status == 401
