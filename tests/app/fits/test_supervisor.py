"""What the supervisor makes of jobs that succeed, fail, crash, hang or cannot be started."""

from __future__ import annotations

import errno
import time
from pathlib import Path
from typing import Any

import pytest

from app.database import Database
from app.fits import repository
from app.fits.engine import LOST
from tests.app.fits.supervised import Bench, until


def test_fit_succeeds_when_its_job_is_done(bench: Bench) -> None:
    """Progress is written while it runs, the end when it is over."""
    fit = bench.queue()
    running = bench.started(1)
    running.told.append({"progress": {"stage": "posterior", "fraction": 0.25}})
    until(lambda: bench.state(fit).fraction == 0.25)
    running.succeed()

    row = bench.ended(fit)

    assert (row.status, row.attempt, row.failures) == ("succeeded", 1, 0)
    assert row.lease_until is None
    assert row.ended_at is not None
    # Counted once the row is written, by which the end is seen here.
    until(lambda: bench.metrics.registry.get_sample_value("motorid_fit_seconds_count") == 1)


@pytest.mark.parametrize(
    "told", [[], [{"progress": {"stage": "fit", "fraction": 1.0}}], [{"done": True}]]
)
def test_job_that_ends_without_its_result_is_tried_three_times(
    bench: Bench, told: list[dict[str, Any]]
) -> None:
    """Whether it was silent or claims to be done with nothing on the disk."""
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


def test_job_that_says_why_it_failed_is_not_tried_again(bench: Bench) -> None:
    """The same input fails in the same way."""
    fit = bench.queue()
    running = bench.started(1)
    running.told.append({"failed": {"code": "computation", "detail": "no solution"}})
    running.end = "exit status 0"

    row = bench.ended(fit)

    assert (row.status, row.attempt) == ("failed", 1)
    assert row.error == {"code": "computation", "detail": "no solution"}


def test_end_of_the_engine_is_not_counted_against_the_fit(bench: Bench) -> None:
    """Lost five times, more than the crashes that are allowed; then it succeeds."""
    fit = bench.queue()
    for number in range(1, 6):
        bench.started(number).end = LOST
    bench.started(6).succeed()

    row = bench.ended(fit)

    assert (row.status, row.attempt, row.failures) == ("succeeded", 6, 0)


def test_cancelled_fit_is_killed_and_leaves_nothing(bench: Bench) -> None:
    """Within a look around of the supervisor after it was woken."""
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


def test_result_that_comes_after_the_cancelling_is_dropped(bench: Bench) -> None:
    """The job was done in the moment in which it was cancelled."""
    fit = bench.queue()
    running = bench.started(1)
    with bench.database.writing() as session:
        repository.cancel(session, fit, time.time())
        # Before the cancelling can be seen: its outputs still have a place.
        running.succeed()
    until(lambda: not bench.storage.attempt(fit, 1).exists())

    assert bench.state(fit).status == "cancelled"


def test_job_that_takes_too_long_is_ended(database: Database, tmp_path: Path) -> None:
    """A limit of a tenth of a second."""
    bench = Bench(database, tmp_path / "data", fit_wall_s=0.1)
    fit = bench.queue()

    row = bench.ended(fit)
    bench.supervisor.stop()

    assert (row.status, row.error and row.error["code"]) == ("failed", "time")
    assert bench.engine.started[0].is_killed


def test_crash_that_told_its_reason_is_known_by_it(database: Database, tmp_path: Path) -> None:
    """An exit status says nothing to a user; that there was no memory does."""
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


def test_no_more_jobs_run_than_there_are_workers(bench: Bench) -> None:
    """Two of three; the third begins when one has ended."""
    for _ in range(3):
        bench.queue()
    first = bench.started(2)
    time.sleep(0.3)
    assert len(bench.engine.started) == 2

    first.succeed()

    bench.started(3)


def test_fits_share_the_cores_among_those_that_run_or_wait(bench: Bench) -> None:
    """Of eight: all for one that is alone, half for the second, and half when a third waits too."""
    bench.queue()
    assert bench.started(1).job.threads == 8

    bench.queue()
    bench.queue()
    assert bench.started(2).job.threads == 4
    bench.started(1).succeed()

    assert bench.started(3).job.threads == 4


def test_stopped_supervisor_puts_its_fits_back_without_blame(bench: Bench) -> None:
    """Queued, no failure counted, the process killed."""
    fit = bench.queue()
    running = bench.started(1)

    bench.supervisor.stop()

    row = bench.state(fit)
    assert (row.status, row.failures, row.owner) == ("queued", 0, None)
    assert running.is_killed
    assert not bench.supervisor.is_alive


def test_job_that_cannot_be_started_waits(bench: Bench) -> None:
    """No process was to be had once; the attempt that never began is not counted at all."""
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
def test_job_that_cannot_be_started_fails_and_keeps_no_other_waiting(
    bench: Bench, error: Exception, reason: str
) -> None:
    """The one behind it is begun while it is tried three times; then it says why it failed."""
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


def test_shortage_of_the_machine_is_no_fault_of_a_fit(bench: Bench) -> None:
    """No process is to be had four times, more than the refusals that a fit may cause."""
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
def test_progress_that_is_none_stops_nothing(bench: Bench, progress: object) -> None:
    """The job goes on to its end, and so does the one beside it."""
    fit, other = bench.queue(), bench.queue()
    bench.started(2)
    for running in bench.engine.started:
        running.told.append({"progress": progress})
    time.sleep(0.2)
    for running in bench.engine.started:
        running.succeed()

    assert [bench.ended(one).status for one in (fit, other)] == ["succeeded"] * 2


def test_fits_wait_while_the_engine_can_take_none(bench: Bench) -> None:
    """Its scheduler is away, say; no attempt is spent on it."""
    bench.engine.most = 0
    fit = bench.queue()
    time.sleep(0.3)
    assert (bench.state(fit).status, bench.state(fit).attempt) == ("queued", 0)

    bench.engine.most = 1
    bench.supervisor.wake()

    assert bench.started(1).job.attempt == 1


def test_success_is_kept_where_the_answer_to_its_commit_was_lost(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The row says succeeded, the connection broke: the second try must not remove the result."""
    from sqlalchemy.exc import OperationalError

    real = repository.finish
    broken: list[bool] = []

    def finish(session: Any, *words: Any, **values: Any) -> bool:
        is_ours = real(session, *words, **values)
        if not broken:
            broken.append(is_ours)
            session.commit()
            raise OperationalError("COMMIT", {}, Exception("server closed the connection"))
        return is_ours

    monkeypatch.setattr(repository, "finish", finish)
    fit = bench.queue()
    running = bench.started(1)
    running.succeed()
    until(lambda: running.is_killed)

    assert broken == [True]
    assert bench.state(fit).status == "succeeded"
    assert (bench.storage.attempt(fit, 1) / "result.json").is_file()


def test_supervisor_survives_a_database_that_does_not_answer(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It fails for some looks around, then the fit goes on as if nothing had been."""
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
