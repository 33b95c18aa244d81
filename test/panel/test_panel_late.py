# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A restore that takes longer than a browser waits, or than the panel lives: it is never killed.

Asked to end, it takes the mode in which settings are written back, and says what it has written.
"""

import asyncio
from collections.abc import Iterator

from jumping import jumping
import pytest

pytest.importorskip('nicegui', reason="needs the extra 'panel'")

#: s that it takes to end, once it is asked to
ENDING = 3.0
SAID = 'conveyor: interrupted. Written: ramp_time. Not written: mode'


class Restore:
    """
    A process that has far to go.

    :ivar signals: that it got, in words.
    :ivar ended: is set when it has gone.
    """

    def __init__(self, last: float) -> None:
        self.returncode: int | None = None
        self.signals: list[str] = []
        self.ended = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        self._loop.call_later(last, self._end, 0)

    def _end(self, code: int) -> None:
        if self.returncode is None:
            self.returncode = code
            self.ended.set()

    async def communicate(self) -> tuple[bytes, None]:
        await self.ended.wait()
        return SAID.encode(), None

    async def wait(self) -> int | None:
        await self.ended.wait()
        return self.returncode

    def terminate(self) -> None:
        self.signals.append('terminate')
        self._loop.call_later(ENDING, self._end, 143)

    def kill(self) -> None:
        self.signals.append('kill')
        self._end(-9)


@pytest.fixture(name='loop')
def _loop() -> Iterator[asyncio.AbstractEventLoop]:
    from panel_bench import JumpingLoop
    with jumping(0) as clock:
        loop = JumpingLoop(clock)
        yield loop
        loop.close()


def started(monkeypatch: pytest.MonkeyPatch, last: float) -> list[Restore]:
    """Have what is started be a process of this kind; return what has been started."""
    made: list[Restore] = []

    async def start(*_: object, **__: object) -> Restore:
        made.append(Restore(last))
        return made[-1]
    monkeypatch.setattr('asyncio.create_subprocess_exec', start)
    return made


@pytest.mark.parametrize(('last', 'took', 'signals', 'code'), [
    (299.0, 299.0, [], 0), (1000.0, 300.0 + ENDING, ['terminate'], 143),
    (301.0, 301.0, ['terminate'], 0)], ids=['in time', 'too long', 'just then'])
def test_it_is_asked_to_end_and_waited_for(
        loop: asyncio.AbstractEventLoop, monkeypatch: pytest.MonkeyPatch, last: float,
        took: float, signals: list[str], code: int) -> None:
    from drive_can_bridge.panel.actions import _command
    made, begun = started(monkeypatch, last), loop.time()
    found, text = loop.run_until_complete(_command(['restore'], ''))
    assert (found, made[0].signals) == (code, signals)
    assert loop.time() - begun == pytest.approx(took, abs=0.01)
    assert text.splitlines() == [*['not done after 300 s: ended'] * bool(code), SAID]


def test_a_panel_that_ends_waits_for_it(loop: asyncio.AbstractEventLoop,
                                        monkeypatch: pytest.MonkeyPatch) -> None:
    from drive_can_bridge.panel.actions import _command
    made, begun = started(monkeypatch, 1000.0), loop.time()
    task = loop.create_task(_command(['restore'], ''))
    # the web server cancels what is under way, and then the event loop all that is left
    for _ in range(2):
        loop.run_until_complete(asyncio.sleep(1.0))
        for each in asyncio.all_tasks(loop):
            each.cancel()
    with pytest.raises(asyncio.CancelledError):
        loop.run_until_complete(task)
    assert (made[0].returncode, made[0].signals) == (143, ['terminate'])
    assert loop.time() - begun == pytest.approx(1.0 + ENDING, abs=0.01)
