"""Shared fixture of the supervisor tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.database import Database
from app.fits import supervisor
from tests.app.fits.supervised import Bench


@pytest.fixture
def bench(database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    """Supervisor on a mock engine that polls ten times as often, stopped after the test."""
    for name, pause_s in (("_BUSY_S", 0.01), ("_IDLE_S", 0.1), ("_LOOK_S", 0.05)):
        monkeypatch.setattr(supervisor, name, pause_s)
    made = Bench(database, tmp_path / "data")
    yield made
    made.supervisor.stop()
