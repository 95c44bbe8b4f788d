"""Shared fixture of the supervisor tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.database import Database
from tests.app.fits.supervised import Bench


@pytest.fixture
def bench(database: Database, tmp_path: Path) -> Iterator[Bench]:
    """Supervisor on a mock engine, stopped after the test."""
    made = Bench(database, tmp_path / "data")
    yield made
    made.supervisor.stop()
