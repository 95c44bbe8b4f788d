"""Supervisor: jobs that succeed, fail, crash, hang or cannot be started."""

from __future__ import annotations

import errno
import time
from pathlib import Path
from typing import Any

import pytest

from app.database import Database
from app.fits import queue, repository
from app.fits.engine import LOST
from app.fits.queue import FitQueue
from tests.app.fits.supervised import Bench, until


def test_fit_succeeds_when_its_job_is_done(bench: Bench) -> None:
    """Progress is stored while the job runs, the final state when it ends."""
    fit = bench.queue()
    running = bench.started(1)
    running.told.append({"progress": {"stage": "posterior", "fraction": 0.25}})
    until(lambda: bench.state(fit).fraction == 0.25)
    running.succeed()

    row = bench.ended(fit)

    assert (row.status, row.attempt, row.failures) == ("succeeded", 1, 0)
    assert row.lease_until is None
    assert row.ended_at is not None
    # The counter increases after the row is written, which ended() has seen.
    until(lambda: bench.metrics.registry.get_sample_value("motorid_fit_seconds_count") == 1)


@pytest.mark.parametrize(
    "told", [[], [{"progress": {"stage": "fit", "fraction": 1.0}}], [{"done": True}]]
)
def test_job_without_a_result_is_attempted_three_times(
    bench: Bench, told: list[dict[str, Any]]
) -> None:
    """A job crashes if it ends silently, or reports `done` without files on disk."""
    fit = bench.queue()
    for number in (1, 2, 3):
        running = bench.started(number)
        assert running.job.attempt == number
        running.told += told
        running.end = "signal 11 (SIGSEGV)"

    row = bench.ended(fit)

    assert (row.status, row.attempt) == ("failed", 3)
    assert row.error is not None
    assert row.error["code"] == "crashed"
    assert "SIGSEGV" in row.error["detail"]
    assert len(bench.engine.started) == 3
    until(lambda: not bench.storage.fit(fit).exists())


def test_reported_failure_is_not_retried(bench: Bench) -> None:
    """The same input would fail in the same way."""
    fit = bench.queue()
    running = bench.started(1)
    running.told.append({"failed": {"code": "computation", "detail": "no solution"}})
    running.end = "exit status 0"

    row = bench.ended(fit)

    assert (row.status, row.attempt) == ("failed", 1)
    assert row.error == {"code": "computation", "detail": "no solution"}


def test_end_of_the_engine_is_not_counted_against_the_fit(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fit that was lost with its engine five times still succeeds."""
    monkeypatch.setattr(queue, "_FIRST_PAUSE_S", 0.05)
    fit = bench.queue()
    for number in range(1, 6):
        bench.started(number).end = LOST
    bench.started(6).succeed()

    row = bench.ended(fit)

    assert (row.status, row.attempt, row.failures) == ("succeeded", 6, 0)


def test_cancelled_fit_is_killed_and_leaves_nothing(bench: Bench) -> None:
    """The job is killed within a second after the supervisor was woken."""
    fit = bench.queue()
    running = bench.started(1)

    with bench.database.writing() as session:
        repository.cancel(session, fit, time.time())
    began = time.monotonic()
    bench.supervisor.wake()
    until(lambda: running.is_killed)

    assert time.monotonic() - began < 1.0
    until(lambda: not bench.storage.attempt(fit, 1).exists())
    assert bench.state(fit).status == "cancelled"


def test_result_after_the_cancellation_is_discarded(bench: Bench) -> None:
    """The job succeeds at the moment of the cancellation."""
    fit = bench.queue()
    running = bench.started(1)
    with bench.database.writing() as session:
        repository.cancel(session, fit, time.time())
        # The directory still exists, because the cancellation is not committed yet.
        running.succeed()
    until(lambda: not bench.storage.attempt(fit, 1).exists())

    assert bench.state(fit).status == "cancelled"


def test_job_beyond_the_time_limit_is_killed(database: Database, tmp_path: Path) -> None:
    """The time limit is 0.1 s."""
    bench = Bench(database, tmp_path / "data", fit_wall_s=0.1)
    fit = bench.queue()

    row = bench.ended(fit)
    bench.supervisor.stop()

    assert (row.status, row.error and row.error["code"]) == ("failed", "time")
    assert bench.engine.started[0].is_killed


def test_reported_cause_of_a_crash_is_shown(database: Database, tmp_path: Path) -> None:
    """A cause such as "out of memory" helps a user more than an exit status."""
    bench = Bench(database, tmp_path / "data", max_attempts=1)
    fit = bench.queue()
    running = bench.started(1)
    running.told.append({"crashed": "out of memory"})
    running.end = "exit status 1"

    error = bench.ended(fit).error
    bench.supervisor.stop()

    assert error == {
        "code": "crashed",
        "detail": "the process ended without a result once; last cause: out of memory",
    }


def test_parallel_jobs_are_limited_by_the_capacity(bench: Bench) -> None:
    """With a capacity of two, the third job starts when another one has ended."""
    for _ in range(3):
        bench.queue()
    first = bench.started(2)
    time.sleep(0.3)
    assert len(bench.engine.started) == 2

    first.succeed()

    bench.started(3)


def test_fits_share_the_cores_among_those_that_run_or_wait(bench: Bench) -> None:
    """Of eight cores a single fit gets all; with more fits each gets half."""
    bench.queue()
    assert bench.started(1).job.threads == 8

    bench.queue()
    bench.queue()
    assert bench.started(2).job.threads == 4
    bench.started(1).succeed()

    assert bench.started(3).job.threads == 4


def test_stopped_supervisor_requeues_its_fits(bench: Bench) -> None:
    """The process is killed, and the stop does not count as a failure."""
    fit = bench.queue()
    running = bench.started(1)

    bench.supervisor.stop()

    row = bench.state(fit)
    assert (row.status, row.failures, row.owner) == ("queued", 0, None)
    assert running.is_killed
    assert not bench.supervisor.is_alive


def test_job_that_cannot_be_started_waits(bench: Bench) -> None:
    """A refused start does not count as an attempt."""
    bench.engine.refusals = 1
    fit = bench.queue()
    bench.started(1).succeed()

    row = bench.ended(fit)

    assert (row.status, row.attempt, row.failures) == ("succeeded", 1, 0)


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (OSError(errno.EMSGSIZE, "Message too long"), "Message too long"),
        (ValueError("embedded null byte"), "embedded null byte"),
    ],
    ids=["system", "value"],
)
def test_job_that_cannot_be_started_fails_without_blocking_others(
    bench: Bench, error: Exception, reason: str
) -> None:
    """The next fit starts between its three attempts; the error gives the last cause."""
    bench.engine.most = 0
    bad, good = bench.queue(), bench.queue()
    bench.engine.refused[bad] = error
    bench.engine.most = 1
    bench.supervisor.wake()
    running = bench.started(1)
    assert running.job.fit_id == good
    running.succeed()

    row = bench.ended(bad)

    assert (row.status, row.error and row.error["code"]) == ("failed", "start")
    expected = f"the process could not be started in 3 attempts; last error: {reason}"
    assert row.error
    assert row.error["detail"] == expected
    until(lambda: not bench.storage.attempt(bad, 1).parent.exists())
    assert bench.ended(good).status == "succeeded"


def test_resource_shortage_does_not_count_against_a_fit(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four refusals exceed the limit of three that applies to other errors."""
    monkeypatch.setattr(queue, "_FIRST_PAUSE_S", 0.05)
    bench.engine.refusals = 4
    fit = bench.queue()
    bench.started(1).succeed()

    row = bench.ended(fit)

    assert (row.status, row.attempt, row.failures) == ("succeeded", 1, 0)


@pytest.mark.parametrize(
    "progress",
    [None, 1, [], {}, {"stage": 1, "fraction": 0.5}, {"stage": "fit", "fraction": "x"}]
    + [{"stage": "x" * 101, "fraction": 0.5, "status": "succeeded"}]
    + [{"stage": "fit", "fraction": float("nan")}],
)
def test_invalid_progress_is_ignored(bench: Bench, progress: object) -> None:
    """The job and a parallel one both succeed."""
    fit, other = bench.queue(), bench.queue()
    bench.started(2)
    for running in bench.engine.started:
        running.told.append({"progress": progress})
    time.sleep(0.2)
    for running in bench.engine.started:
        running.succeed()

    assert [bench.ended(one).status for one in (fit, other)] == ["succeeded"] * 2


def test_fits_wait_while_the_engine_has_no_capacity(bench: Bench) -> None:
    """No attempt is counted, for example while a Dask scheduler is unreachable."""
    bench.engine.most = 0
    time.sleep(0.3)  # a turn of the supervisor that began before has ended
    fit = bench.queue()
    time.sleep(0.3)
    assert (bench.state(fit).status, bench.state(fit).attempt) == ("queued", 0)

    bench.engine.most = 1
    bench.supervisor.wake()

    assert bench.started(1).job.attempt == 1


def test_success_survives_a_lost_commit_confirmation(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The commit succeeds but the connection breaks: the retry must not remove the result."""
    from sqlalchemy.exc import OperationalError

    real = FitQueue.finish
    broken: list[bool] = []

    def finish(queue: FitQueue, *words: Any) -> bool:
        is_ours = real(queue, *words)
        if not broken:
            broken.append(is_ours)
            raise OperationalError("COMMIT", {}, Exception("server closed the connection"))
        return is_ours

    monkeypatch.setattr(FitQueue, "finish", finish)
    fit = bench.queue()
    running = bench.started(1)
    running.succeed()
    until(lambda: running.is_killed)

    assert broken == [True]
    assert bench.state(fit).status == "succeeded"
    assert (bench.storage.attempt(fit, 1) / "result.json").is_file()


def test_supervisor_survives_an_unreachable_database(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After three failed polls the next fit succeeds."""
    from sqlalchemy.exc import OperationalError

    real = bench.database.reading
    failures = iter(range(3))

    def reading() -> Any:
        if next(failures, None) is not None:
            raise OperationalError("SELECT", {}, Exception("disk I/O error"))
        return real()

    monkeypatch.setattr(bench.database, "reading", reading)
    bench.supervisor.wake()
    until(lambda: next(failures, None) is None)
    monkeypatch.undo()
    fit = bench.queue()
    bench.started(1).succeed()

    assert bench.ended(fit).status == "succeeded"
    assert bench.supervisor.is_alive
