"""Fits that another server holds, or held before it ended."""

from __future__ import annotations

import time
from pathlib import Path

from app.database import Database
from tests.app.fits.supervised import Bench


def test_fit_of_another_server_of_this_machine_is_left_alone(
    bench: Bench, database: Database, tmp_path: Path
) -> None:
    """Two on one database, each with its directory: one fit, begun once, as its first attempt."""
    fit = bench.queue()
    running = bench.started(1)
    other = Bench(database, tmp_path / "other")
    time.sleep(1.2)  # two looks around
    other.supervisor.stop()

    assert other.engine.started == []
    assert not running.is_killed
    assert (bench.state(fit).attempt, bench.state(fit).owner) == (1, bench.owner)


def test_fit_of_a_former_server_of_this_machine_is_taken_up(bench: Bench) -> None:
    """Its lease would run for an hour; it is begun at once, as its second attempt."""
    fit = bench.queue(
        status="running", attempt=1, owner=bench.former, lease_until=time.time() + 3600
    )

    running = bench.started(1)

    assert (running.job.fit_id, running.job.attempt) == (fit, 2)
    assert bench.state(fit).failures == 0


def test_fit_that_takes_its_server_down_again_and_again_is_given_up(bench: Bench) -> None:
    """Fifty ends of the server during one fit are no coincidence."""
    fit = bench.queue(status="running", attempt=60, failures=2, owner=bench.former, lease_until=0.0)

    row = bench.ended(fit)

    assert (row.status, row.error and row.error["code"]) == ("failed", "interrupted")


def test_fit_that_was_claimed_and_never_started_is_found(bench: Bench) -> None:
    """As after an error between the two: this server holds it and no process computes it."""
    fit = bench.queue(status="running", attempt=1, failures=1, owner=bench.owner, lease_until=1e12)

    running = bench.started(1)

    assert (running.job.fit_id, running.job.attempt) == (fit, 2)
    assert bench.state(fit).failures == 1
