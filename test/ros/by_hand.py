# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Commands in this process, and the local way to bridges of this process, without sockets."""

from collections import deque
from collections.abc import Callable, Sequence
import os
from typing import Any

from bridges import Bridge
import pytest

from drive_can_bridge.cli.main import main
from drive_can_bridge.client import local
from drive_can_bridge.process import environment, local_stop
from drive_can_bridge.process.local_server import LocalRequest
from drive_can_bridge.process.local_way import Inbound, packets_of, VERSION
from drive_can_bridge.process.presence import bridges, Present, SWITCH
from drive_can_bridge.ros.client import client_node, search

Run = Callable[..., tuple[int, list[str], str]]


def command(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Return what runs a command, and returns exit code, lines, and standard error."""
    # others may use this host meanwhile
    for module in (local_stop, local, search, environment):
        monkeypatch.setattr(module, 'bridges', lambda: [
            each for each in bridges() if each.process == os.getpid()])

    def started(*words: str) -> tuple[int, list[str], str]:
        capsys.readouterr()
        code = main(words)
        told = capsys.readouterr()
        return code, told.out.splitlines(), told.err
    return started


def no_way(*_: Any) -> Any:
    """Fail, in the place of what is not to be done."""
    raise AssertionError('looked for a bridge')


def no_ros(patch: pytest.MonkeyPatch) -> None:
    """Let no command become part of the graph."""
    patch.setattr(client_node.ClientNode, '__init__', no_way)


class Line:
    """
    A connection that is none: what is said travels in packets all the same.

    :param asked: takes what is asked.
    :param trusted: who asks is root, or the user of the bridge.
    """

    def __init__(self, bridge: Bridge | None, asked: list[list[str]], *,
                 trusted: bool = True) -> None:
        self.believed = True
        self._trusted = trusted
        self._bridge = bridge
        self._asked = asked
        self._messages: deque[list[str]] = deque()

    def ask(self, *words: str) -> None:
        """Ask the bridge; one that hangs keeps it for itself."""
        message = travelled([VERSION, *words])
        self._asked.append(message[1:])
        if self._bridge is not None:
            caller: Any = self
            runtime: Any = self._bridge.node._runtime
            runtime.local_way.serve(LocalRequest(
                caller, message[1], message[2:], trusted=self._trusted,
                whom='user robot, process 4321'))

    def say(self, message: Sequence[str], *, last: bool = False) -> None:
        """Take what the bridge says."""
        self._messages.append(travelled(message))

    def take(self) -> list[str] | None:
        """Return the next message."""
        return self._messages.popleft() if self._messages else None

    def close(self) -> None:
        """Hang up."""


def travelled(message: Sequence[str]) -> list[str]:
    """Return a message as it arrives."""
    inbound = Inbound(1 << 20)
    *first, last = packets_of(message)
    assert not any(inbound.take(each) for each in first)
    arrived = inbound.take(last)
    assert arrived is not None
    return arrived


class Lines:
    """
    Lines to bridges.

    :ivar asked: all that was asked.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._patch = monkeypatch
        self.asked: list[list[str]] = []

    def __call__(self, *listening: Bridge, hung: Sequence[str] = ()) -> None:
        """
        Let commands ask from now on.

        :param hung: full names of bridges that take calls, and nothing more.
        """
        def line(present: Present) -> Line:
            for bridge in listening:
                if present.name == bridge.node.get_fully_qualified_name():
                    return Line(bridge, self.asked)
            if present.name in hung:
                return Line(None, self.asked)
            raise ConnectionRefusedError
        self._patch.setenv(SWITCH, 'on')
        for module in (local_stop, local):
            self._patch.setattr(module, 'Line', line)
