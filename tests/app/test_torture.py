"""Short torture test of fits; `make torture` runs the long versions."""

from __future__ import annotations

import random
from pathlib import Path

from benchmarks.torture import kills
from tests.app.postgresql import MISSING


def test_kills_lose_and_repeat_no_fit(tmp_path: Path) -> None:
    """After one kill of each kind of process, every accepted fit succeeds exactly once."""
    database, engine, count = ("sqlite", "local", 3) if MISSING else ("postgresql", "dask", 7)

    outcome = kills.torture(tmp_path, database, engine, count, random.Random(1))

    assert outcome.passed, outcome.measured
