# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Whoever may look, and says what no page says: over the channel that pages have, by polling."""

from collections.abc import Iterator
import html
import json
import re
from typing import TYPE_CHECKING

from panel_builders import Answer
import pytest

if TYPE_CHECKING:
    from panel_bench import House

pytest.importorskip('rclpy')
pytest.importorskip('nicegui', reason="needs the extra 'panel'")

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

    def __init__(self, house: 'House', role: str, page: str) -> None:
        self._house = house
        self._role = role
        text = house.get(page, role).text
        self.client = self._find(r"'client_id': '([0-9a-f-]{36})'", text)
        elements = self._find(r'parseElements\(String\.raw`(.*?)`\)', text)
        self.listeners: list[tuple[int, str]] = [
            (int(number), event['listener_id'])
            for number, element in json.loads(html.unescape(elements)).items()
            for event in element.get('events', [])]
        query = (f'&client_id={self.client}&tab_id=tab&document_id=document&next_message_id=0'
                 '&implicit_handshake=true')
        opened = house.get(f'{CHANNEL}{query}', role)
        self._path = f'{CHANNEL}&sid={json.loads(opened.text[1:])["sid"]}'
        assert self.send('40').status == 200
        assert house.get(self._path, role).text.startswith('40{')

    @staticmethod
    def _find(pattern: str, text: str) -> str:
        found = re.search(pattern, text, re.DOTALL)
        assert found is not None, f'{pattern} in {text}'
        return found[1]

    def send(self, packet: str, role: str | None = None) -> Answer:
        """Send what would be a frame of the WebSocket."""
        return self._house.ask('POST', self._path, role or self._role, {
            'Content-Type': 'text/plain', 'Origin': f'http://{self._house.host}'}, packet.encode())

    def tell(self, event: str, message: object) -> None:
        """Send an event."""
        assert self.send(f'42{json.dumps([event, message])}').status == 200
        self._house.live(0.001)     # what becomes of it comes behind the answer

    def log(self, text: str) -> None:
        """Tell what browsers may tell of their troubles."""
        self.tell('log', {'client_id': self.client, 'level': 'error', 'message': text})


@pytest.fixture(autouse=True)
def goes_on(house: 'House') -> Iterator[None]:
    """Look whether panel and bridge go on, and what was said of it."""
    yield
    house.check_alive()


@pytest.mark.parametrize('page', ['/', '/drive/conveyor', '/log'])
def test_no_element_of_a_page_can_be_harmed(house: 'House', page: str) -> None:
    channel = Channel(house, 'viewer', page)
    for element, listener in channel.listeners:
        for arguments in ODD:
            channel.tell('event', {'client_id': channel.client, 'id': element,
                                   'listener_id': listener, 'args': arguments})
    # others see their pages
    assert house.get(page, 'operator').status == 200


def test_what_is_no_message_is_thrown_away(house: 'House') -> None:
    channel = Channel(house, 'viewer', '/')
    for message in (7, None, [], {}, {'client_id': 'nobody'}, {'client_id': channel.client}):
        for event in ('event', 'handshake', 'log', 'ack', 'javascript_response', 'nothing'):
            channel.tell(event, message)
    for packet in ('4', '42', '42[', '42{}', '42["event"]', '45-["x"]', '9', '\x1e\x1e', '41',
                   '451-["event",{"_placeholder":true,"num":0}]', f'42["event",{"[" * 50_000}'):
        Channel(house, 'viewer', '/').send(packet)
    assert house.get(f'{CHANNEL}&sid=%1b%5b2J', 'viewer').status == 400


def test_what_a_browser_says_neither_rules_nor_fills_the_terminal(house: 'House') -> None:
    house.clock.stand_still(61.0)    # what others had it say is forgotten
    channel = Channel(house, 'viewer', '/')
    before = len(house.errors)
    for number in range(200):
        channel.log(f'{number} \x1b[2J\x1b]0;title\x07\u202e {"x" * 5000}')
    lines = house.errors[before:]
    assert 0 < len(lines) <= 10
    assert all(line.isprintable() and len(line) < 300 for line in lines)
    # how many there were besides is said with the next one
    house.clock.stand_still(61.0)
    Channel(house, 'viewer', '/').log('the next')
    assert f'({200 - len(lines)} lines' in house.errors[-1]


def test_a_page_of_an_operator_makes_nobody_one(house: 'House') -> None:
    channel = Channel(house, 'operator', '/')
    # whoever has got hold of its number
    assert channel.send('42["event",{}]', 'viewer').status == 200
    answer = house.do('quick_stop', 'viewer', {'drive': '/lift'})
    assert answer.status == 403
    # nor does anybody without a token take part
    assert house.get(f'{CHANNEL}&client_id={channel.client}').status == 401
