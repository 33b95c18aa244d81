# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What tests of the direct way have in common: most of them have no other master to hear."""

import pytest


@pytest.fixture
def listens() -> None:
    """Whoever opens drives listens for another master as long as for a user."""


@pytest.fixture(autouse=True)
def _brief(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if 'listens' not in request.fixturenames:
        monkeypatch.setattr('drive_can_bridge.client.direct.LISTEN', 0.05)
