"""What tests of the service's parts share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.database import Database


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    """An empty database with all tables."""
    made = Database(f"sqlite:///{tmp_path / 'test.sqlite3'}")
    made.migrate()
    yield made
    made.close()
