"""Short versions of `make torture`, for what the jobs of the service promise."""

from __future__ import annotations

import random
from contextlib import closing
from pathlib import Path

import pytest

from benchmarks.torture import kills, throughput
from tests.app.postgresql import MISSING


@pytest.mark.parametrize(
    ("database", "engine", "count"), [("sqlite", "local", 3), ("postgresql", "dask", 7)]
)
def test_kills_lose_nothing_and_double_nothing(
    tmp_path: Path, database: str, engine: str, count: int
) -> None:
    """Each kind of process once; each fit that was accepted succeeds once, and nothing is left."""
    if database == "postgresql" and MISSING:
        pytest.skip(MISSING)

    outcome = kills.torture(tmp_path, database, engine, count, random.Random(1))

    assert outcome.passed, outcome.measured


@pytest.mark.parametrize("engine", ["local", "dask"])
def test_cancelled_fit_is_gone_within_a_second(tmp_path: Path, engine: str) -> None:
    """From the call over HTTP to the end of the process and of what that started."""
    outcome = kills.cancelled(tmp_path, engine, 1)

    assert outcome.passed, outcome.measured


def test_two_workers_compute_two_fits_at_once(tmp_path: Path) -> None:
    """Fits that only wait, for 1.4 s each, so that it does not matter how busy the machine is."""
    settings = {"PIPELINE": "benchmarks.torture.pretended:identify"}
    kind = throughput.Kind("fits that wait", {}, fits=2, turns=1, seconds=0.0)

    with closing(throughput.turns(tmp_path, 2, kind, has_bare=False, **settings)) as measured:
        turn = next(measured)

    assert turn.ratio > 1.4
