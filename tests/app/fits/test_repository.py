"""Optimistic locking of fits: only the current attempt can write."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import event, select

from app.access.service import Caller
from app.database import Database
from app.fits import repository
from app.fits.queue import FitQueue
from app.fits.request import FitRequest, new_row
from app.settings import load_settings
from app.storage import Storage
from app.tables import FitRow, FitRunRow
from identification.options import FitOptions
from tests.app.statements import statements

CALLER = Caller("default")
OPTIONS = {"seed": 0, "controllers": list(FitOptions().controllers)}


@pytest.fixture
def server(database: Database, tmp_path: Path) -> FitQueue:
    """Queue as seen by one server, with leases of ten seconds."""
    storage = Storage(tmp_path / "data", "bench")
    storage.prepare()
    return FitQueue(database, storage, load_settings(lease_s=10.0))


def queue(database: Database, number: int = 1) -> list[str]:
    """Insert some queued fits."""
    rows = [new_row(CALLER, FitRequest([f"run{n}"], [], OPTIONS)) for n in range(number)]
    for position, row in enumerate(rows):
        row.position = position
        row.created_at = 1000.0
    with database.writing() as session:
        repository.add(session, *((row, FitRequest(["run"], [], OPTIONS)) for row in rows))
    return [row.id for row in rows]


def state(database: Database, fit_id: str) -> FitRow:
    """Current row of a fit."""
    with database.reading() as session:
        row = session.get(FitRow, fit_id)
    assert row is not None
    return row


def finished(server: FitQueue, fit_id: str, attempt: int) -> bool:
    """Try to end a fit as succeeded."""
    return server.finish(fit_id, attempt, "succeeded")


def renewed(server: FitQueue, fit_id: str, attempt: int) -> bool:
    """Try to renew a lease and store progress."""
    return server.renew(fit_id, attempt, {"stage": "x", "fraction": 0.5})


def put_back(server: FitQueue, fit_id: str, attempt: int) -> bool:
    """Try to requeue a fit."""
    return server.put_back(fit_id, attempt, failures=1)


@pytest.mark.parametrize("write", [finished, renewed, put_back])
def test_replaced_attempt_cannot_write(
    database: Database, server: FitQueue, write: Callable[[FitQueue, str, int], bool]
) -> None:
    """The first attempt cannot change the row; the second, which replaced it, can."""
    [fit] = queue(database)
    server.claim()
    server.put_back(fit, 1)
    server.claim()
    before = state(database, fit)

    accepted = write(server, fit, 1)

    after = state(database, fit)
    assert not accepted
    assert (after.version, after.status, after.attempt) == (before.version, "running", 2)
    assert write(server, fit, 2)


@pytest.mark.parametrize("write", [finished, renewed, put_back])
def test_cancelled_fit_accepts_no_write(
    database: Database, server: FitQueue, write: Callable[[FitQueue, str, int], bool]
) -> None:
    """A cancelled fit stays cancelled, whatever its process still reports."""
    [fit] = queue(database)
    server.claim()
    with database.writing() as session:
        assert repository.cancel(session, fit, 5.0)

    assert not write(server, fit, 1)

    assert state(database, fit).status == "cancelled"
    with database.writing() as session:
        assert not repository.cancel(session, fit, 6.0)


def test_each_fit_is_claimed_once_by_concurrent_servers(
    database: Database, server: FitQueue
) -> None:
    """Six threads claim twenty fits once each, as first attempts."""
    fits = queue(database, 20)
    taken: list[str] = []

    def work() -> None:
        while claim := server.claim():
            assert claim.job.attempt == 1
            taken.append(claim.job.fit_id)

    threads = [threading.Thread(target=work) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    assert sorted(taken) == sorted(fits)


def test_fits_are_claimed_in_order(database: Database, server: FitQueue) -> None:
    """Fits of a batch have equal creation times and are ordered by position."""
    fits = queue(database, 5)

    taken = [server.claim() for _ in fits]

    assert [claim.job.fit_id for claim in taken if claim] == fits
    assert server.claim() is None


@pytest.mark.parametrize(
    ("owner", "lease_s", "is_expired"),
    [
        ("other/a", 60.0, False),
        ("other/a", -1.0, True),
        ("{place}/old", 60.0, True),
        ("{own}", -1.0, False),
        ("{place}2/a", 60.0, False),
    ],
)
def test_fit_is_taken_over_when_its_server_is_gone(
    database: Database, server: FitQueue, owner: str, lease_s: float, *, is_expired: bool
) -> None:
    """A fit of another place needs an expired lease; one of a former server here does not."""
    [fit] = queue(database)
    server.claim()
    own = server._owner
    with database.writing() as session:
        row = session.get_one(FitRow, fit)
        row.owner = owner.format(place=own.partition("/")[0], own=own)
        row.lease_until = time.time() + lease_s

    server.take_over()

    assert state(database, fit).status == ("queued" if is_expired else "running")


def test_heartbeat_does_not_change_the_version(database: Database, server: FitQueue) -> None:
    """The version, by which listeners detect changes, increases with progress only."""
    [fit] = queue(database)
    server.claim()
    before = state(database, fit)

    server.renew(fit, 1, {})
    silent = state(database, fit)
    renewed(server, fit, 1)

    assert silent.version == before.version
    assert (silent.lease_until or 0.0) > (before.lease_until or 0.0)
    assert state(database, fit).version == before.version + 1


def test_removing_a_fit_removes_its_assignment_of_runs(database: Database) -> None:
    """No row of the fit remains in either table."""
    [fit] = queue(database)
    with database.reading() as session:
        assert repository.run_ids(session, [fit])[fit]["training"] == ["run"]

    with database.writing() as session:
        repository.remove(session, fit)

    with database.reading() as session:
        assert repository.run_ids(session, [fit])[fit]["training"] == []
        assert session.scalars(select(FitRow.id)).all() == []


@pytest.mark.parametrize("number", [1, 600])
def test_runs_of_many_fits_need_two_queries_and_no_objects(database: Database, number: int) -> None:
    """Two queries read the runs of 600 fits; ORM objects would take six times as long."""
    training, validation = [f"run{n}" for n in (3, 1, 2)], ["run0"]
    request = FitRequest(training, validation, {"controllers": ["P:1"]})
    made = [(new_row(Caller("alice"), request), request) for _ in range(number)]
    with database.writing() as session:
        repository.add(session, *made)
    objects: list[object] = []

    def note(target: object, _context: object) -> None:
        objects.append(target)

    event.listen(FitRunRow, "load", note)
    try:
        with statements(database, written=False) as seen, database.reading() as session:
            found = repository.run_ids(session, [row.id for row, _ in made])
    finally:
        event.remove(FitRunRow, "load", note)

    assert found == {row.id: {"training": training, "validation": validation} for row, _ in made}
    assert sum(words.startswith("SELECT") for words in seen) <= 2
    assert objects == []
