# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Who has a place at the panel's gate, in virtual time."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip('nicegui', reason="needs the extra 'panel'")

from drive_can_bridge.panel.access import PanelAccess, PanelRole
from drive_can_bridge.panel.server import (
    Connection, CONNECTIONS_MAX, FIRST_BYTE, KEPT_FOR_OPERATORS, OUTSIDE_MAX,
)


class Wire:
    """Transport of a connection."""

    def __init__(self) -> None:
        self.said = b''
        self.closed = False

    def get_extra_info(self, _: str) -> None:
        return None

    def is_closing(self) -> bool:
        return self.closed

    def write(self, data: bytes) -> None:
        self.said += data

    def close(self) -> None:
        self.closed = True

    abort = close


class House:
    """All connections, and the clock."""

    def __init__(self) -> None:
        from uvicorn.server import ServerState
        self._config = SimpleNamespace(
            loaded=True, loaded_app=None, h11_max_incomplete_event_size=None,
            ws_protocol_class=None, root_path='', asgi_version='3.0', limit_concurrency=None,
            timeout_keep_alive=20)
        self._state = ServerState()
        self._outside: dict[Connection, None] = {}
        self._due: list[tuple[float, Callable[[], object]]] = []
        self.now = 0.0

    def call_later(self, delay: float, what: Callable[[], object]) -> None:
        self._due.append((self.now + delay, what))

    def until(self, now: float) -> None:
        self.now = now
        for due in [each for each in self._due if each[0] <= now]:
            self._due.remove(due)
            due[1]()

    def comes(self) -> tuple[Connection, Wire]:
        wire: Any = Wire()
        connection = Connection(self._outside, PanelAccess(port=0), self._config, self._state, {},
                                _loop=self)    # type: ignore[arg-type]
        connection.connection_made(wire)
        return connection, wire


def test_patience_is_short_until_the_first_byte() -> None:
    house = House()
    silent, slow = house.comes(), house.comes()
    house.until(FIRST_BYTE - 0.1)
    slow[0].data_received(b'G')
    assert not silent[1].closed
    house.until(FIRST_BYTE)
    assert (silent[1].closed, slow[1].closed) == (True, False)
    assert silent[1].said == b''     # a browser that connects in advance has asked nothing yet
    house.until(10.0)
    assert slow[1].closed


def test_who_came_first_leaves_first() -> None:
    house = House()
    come = [house.comes() for _ in range(OUTSIDE_MAX + 3)]
    assert [wire.closed for _, wire in come] == [True] * 3 + [False] * OUTSIDE_MAX


def test_inside_there_is_a_limit_but_not_for_stops() -> None:
    house = House()
    inside = [house.comes()[0].enter(PanelRole.OPERATOR, stop=False)
              for _ in range(CONNECTIONS_MAX + 1)]
    assert inside == [True] * CONNECTIONS_MAX + [False]
    assert house.comes()[0].enter(PanelRole.OPERATOR, stop=True)
    # who is inside stays there, whoever stands outside
    silent = [house.comes() for _ in range(2 * OUTSIDE_MAX)]
    assert sum(wire.closed for _, wire in silent) >= OUTSIDE_MAX
    assert len(house._outside) == OUTSIDE_MAX


def test_viewers_leave_room_for_operators() -> None:
    house = House()
    viewers = CONNECTIONS_MAX - KEPT_FOR_OPERATORS
    inside = [house.comes()[0].enter(PanelRole.VIEWER, stop=False) for _ in range(viewers + 1)]
    assert inside == [True] * viewers + [False]
    assert house.comes()[0].enter(PanelRole.OPERATOR, stop=False)
