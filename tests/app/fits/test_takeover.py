"""Fits that another server holds, or held before it ended."""

from __future__ import annotations

import time
from pathlib import Path

from app.database import Database
from app.fits.engine import LOST
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
    """Fifty kills of the server during one fit are no coincidence."""
    fit = bench.queue(
        status="running", attempt=51, interruptions=50, owner=bench.former, lease_until=0.0
    )

    row = bench.ended(fit)

    assert (row.status, row.error and row.error["code"]) == ("failed", "interrupted")


def test_only_a_kill_of_the_server_is_counted(bench: Bench) -> None:
    """Sixty attempts that ended with their engine count nothing; the kill of the server counts."""
    fit = bench.queue(status="running", attempt=60, owner=bench.former, lease_until=0.0)

    bench.started(1).end = LOST
    bench.started(2).succeed()
    row = bench.ended(fit)

    assert (row.status, row.attempt, row.interruptions) == ("succeeded", 62, 1)


def test_fit_whose_server_was_killed_often_runs_alone(bench: Bench) -> None:
    """Ten kills make it suspect: it waits for the fit that runs, and others wait for it."""
    bench.queue()
    beside = bench.started(1)
    suspect = bench.queue(interruptions=10)
    bench.queue()
    time.sleep(1.2)  # one look around
    assert len(bench.engine.started) == 1

    beside.succeed()
    alone = bench.started(2)
    time.sleep(1.2)
    assert (alone.job.fit_id, len(bench.engine.started)) == (suspect, 2)

    alone.succeed()
    bench.started(3)


def test_fit_that_was_claimed_and_never_started_is_found(bench: Bench) -> None:
    """As after an error between the two: this server holds it and no process computes it."""
    fit = bench.queue(status="running", attempt=1, failures=1, owner=bench.owner, lease_until=1e12)

    running = bench.started(1)

    assert (running.job.fit_id, running.job.attempt) == (fit, 2)
    assert bench.state(fit).failures == 1
