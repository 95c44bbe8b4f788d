"""Workspace quotas on stored runs, bytes and waiting fits."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest

from app.access.quotas import Quotas
from app.database import Database
from app.errors import BytesQuota, QuotaExceeded, RunsQuota, WaitingQuota
from tests.app.rows import fit_row, run_row


def keep(database: Database, *rows: object) -> None:
    """Insert rows."""
    with database.writing() as session:
        session.add_all(rows)


def test_runs_are_counted_within_their_workspace(database: Database) -> None:
    """The runs of alice do not count against the quota of bob."""
    keep(database, run_row("alice"), run_row("alice"))
    quotas = Quotas(runs=2)

    with database.writing() as session:
        quotas.check_run(session, "bob", 1)
        with pytest.raises(RunsQuota, match="2 runs of 2"):
            quotas.check_run(session, "alice", 1)


def test_bytes_may_reach_the_quota_and_not_pass_it(database: Database) -> None:
    """With 60 of 100 bytes stored, a run of 40 bytes is accepted and one of 41 is not."""
    keep(database, run_row("alice", size=60))
    quotas = Quotas(stored_bytes=100)

    with database.writing() as session:
        quotas.check_run(session, "alice", 40)
        with pytest.raises(BytesQuota, match="60 bytes of 100"):
            quotas.check_run(session, "alice", 41)


def test_only_waiting_fits_count(database: Database) -> None:
    """Running and ended fits do not count against the quota of waiting fits."""
    keep(database, *(fit_row("alice", status) for status in ("queued", "running", "failed")))
    quotas = Quotas(waiting_fits=3)

    with database.writing() as session:
        quotas.check_fits(session, "alice", 2)
        with pytest.raises(WaitingQuota, match="1 fits .* wait and 3 more"):
            quotas.check_fits(session, "alice", 3)


def test_no_quota_is_no_limit(database: Database) -> None:
    """The default quota of 0 is unlimited."""
    keep(database, run_row("alice", size=10**15), fit_row("alice", "queued"))

    with database.writing() as session:
        Quotas().check_run(session, "alice", 10**15)
        Quotas().check_fits(session, "alice", 10**6)


def race(attempts: int, attempt: Callable[[], None]) -> int:
    """Number of concurrent attempts that pass the quota."""
    passed: list[int] = []

    def once() -> None:
        try:
            attempt()
        except QuotaExceeded:
            return
        passed.append(1)

    threads = [threading.Thread(target=once) for _ in range(attempts)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return len(passed)


def test_concurrent_calls_cannot_exceed_the_quota(database: Database) -> None:
    """Of sixteen concurrent insertions with a quota of five, five succeed."""
    quotas = Quotas(runs=5)

    def add() -> None:
        with database.writing() as session:
            quotas.check_run(session, "alice", 1)
            session.add(run_row("alice"))

    assert race(16, add) == 5
