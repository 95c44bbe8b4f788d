"""Short torture tests of fits; `make torture` runs the long versions."""

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
def test_kills_lose_and_repeat_no_fit(
    tmp_path: Path, database: str, engine: str, count: int
) -> None:
    """After one kill of each kind of process, every accepted fit succeeds exactly once."""
    if database == "postgresql" and MISSING:
        pytest.skip(MISSING)

    outcome = kills.torture(tmp_path, database, engine, count, random.Random(1))

    assert outcome.passed, outcome.measured


@pytest.mark.parametrize("engine", ["local", "dask"])
def test_cancelled_fit_is_gone_within_a_second(tmp_path: Path, engine: str) -> None:
    """The time is from the HTTP call to the end of the process and its child."""
    outcome = kills.cancelled(tmp_path, engine, 1)

    assert outcome.passed, outcome.measured


def test_two_workers_compute_two_fits_in_parallel(tmp_path: Path) -> None:
    """Each fit only sleeps for 1.4 s, so the load of the machine does not matter."""
    settings = {"PIPELINE": "benchmarks.torture.pretended:identify"}
    kind = throughput.Kind("fits that wait", {}, fits=2, turns=1, seconds=0.0)

    with closing(throughput.turns(tmp_path, 2, kind, has_bare=False, **settings)) as measured:
        turn = next(measured)

    assert turn.ratio > 1.4
