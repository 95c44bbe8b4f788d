"""Fits held by another server, or by an earlier one."""

from __future__ import annotations

import time
from pathlib import Path

from app.database import Database
from app.fits.engine import LOST
from tests.app.fits.supervised import Bench


def test_fit_of_another_server_of_this_machine_is_left_alone(
    bench: Bench, database: Database, tmp_path: Path
) -> None:
    """Two servers with separate data directories on one database do not share a fit."""
    fit = bench.queue()
    running = bench.started(1)
    other = Bench(database, tmp_path / "other")
    time.sleep(0.3)  # some polls
    other.supervisor.stop()

    assert other.engine.started == []
    assert not running.is_killed
    assert (bench.state(fit).attempt, bench.state(fit).owner) == (1, bench.owner)


def test_fit_of_a_former_server_is_taken_over_at_once(bench: Bench) -> None:
    """The second attempt starts although the lease has an hour left."""
    fit = bench.queue(
        status="running", attempt=1, owner=bench.former, lease_until=time.time() + 3600
    )

    running = bench.started(1)

    assert (running.job.fit_id, running.job.attempt) == (fit, 2)
    assert bench.state(fit).failures == 0


def test_fit_that_repeatedly_kills_its_server_is_given_up(bench: Bench) -> None:
    """After fifty kills of the server during one fit, the fit fails."""
    fit = bench.queue(
        status="running", attempt=51, interruptions=50, owner=bench.former, lease_until=0.0
    )

    row = bench.ended(fit)

    assert (row.status, row.error and row.error["code"]) == ("failed", "interrupted")


def test_only_server_kills_count_as_interruptions(bench: Bench) -> None:
    """Attempts lost with their engine do not count; the kill of the server does."""
    fit = bench.queue(status="running", attempt=60, owner=bench.former, lease_until=0.0)

    bench.started(1).end = LOST
    bench.started(2).succeed()
    row = bench.ended(fit)

    assert (row.status, row.attempt, row.interruptions) == ("succeeded", 62, 1)


def test_fit_whose_server_was_killed_often_runs_alone(bench: Bench) -> None:
    """After ten kills a fit waits for running fits, and others wait for it."""
    bench.queue()
    beside = bench.started(1)
    suspect = bench.queue(interruptions=10)
    bench.queue()
    time.sleep(0.3)  # some polls
    assert len(bench.engine.started) == 1

    beside.succeed()
    alone = bench.started(2)
    time.sleep(0.3)
    assert (alone.job.fit_id, len(bench.engine.started)) == (suspect, 2)

    alone.succeed()
    bench.started(3)


def test_claimed_fit_without_a_process_is_restarted(bench: Bench) -> None:
    """An error between claim and start leaves such a fit with this server as owner."""
    fit = bench.queue(status="running", attempt=1, failures=1, owner=bench.owner, lease_until=1e12)

    running = bench.started(1)

    assert (running.job.fit_id, running.job.attempt) == (fit, 2)
    assert bench.state(fit).failures == 1
