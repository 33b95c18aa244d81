# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Questions to whoever sits at a terminal."""

from collections.abc import Iterator
import io
import os

import pytest

from drive_can_bridge.cli.command import answered


@pytest.fixture(name='keyboard')
def keyboard_fixture(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Return what is typed on."""
    keyboard, terminal = os.openpty()
    with open(terminal, encoding='utf-8') as stdin:
        monkeypatch.setattr('sys.stdin', stdin)
        yield keyboard
    os.close(keyboard)


@pytest.mark.parametrize('ahead', [b'', b'y\n', b'y\ny\n', b'y'])
@pytest.mark.parametrize(('answer', 'agreed'), [(b'y\n', True), (b'n\n', False)])
def test_what_was_typed_before_a_question_is_no_answer(
        keyboard: int, ahead: bytes, answer: bytes, agreed: bool,
        monkeypatch: pytest.MonkeyPatch) -> None:
    class Screen(io.StringIO):
        """Shows the question to somebody who answers."""

        def flush(self) -> None:
            os.write(keyboard, answer)

    os.write(keyboard, ahead)
    monkeypatch.setattr('sys.stderr', Screen())
    assert answered('Write?') is agreed
