"""Optimistic locking of fits: only the current attempt can write."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest
from sqlalchemy import event, select
from sqlalchemy.orm import Session

from app.access.service import Caller
from app.database import Database
from app.fits import repository
from app.fits.request import FitRequest, new_row
from app.tables import FitRow, FitRunRow
from identification.options import FitOptions
from tests.app.statements import statements

CALLER = Caller("default")
OPTIONS = {"seed": 0, "controllers": list(FitOptions().controllers)}


def queue(database: Database, number: int = 1) -> list[str]:
    """Insert some queued fits."""
    rows = [new_row(CALLER, FitRequest([f"run{n}"], [], OPTIONS)) for n in range(number)]
    for position, row in enumerate(rows):
        row.position = position
        row.created_at = 1000.0
    with database.writing() as session:
        repository.add(session, *((row, FitRequest(["run"], [], OPTIONS)) for row in rows))
    return [row.id for row in rows]


def take(database: Database, owner: str, now: float = 0.0) -> FitRow | None:
    """Claim the fit that has waited longest, with a lease of ten seconds."""
    with database.writing() as session:
        row = repository.next_queued(session)
        if row is None or not repository.claim(session, row, owner, now, now + 10.0):
            return None
    with database.reading() as session:
        return session.get(FitRow, row.id)


def state(database: Database, fit_id: str) -> FitRow:
    """Current row of a fit."""
    with database.reading() as session:
        row = session.get(FitRow, fit_id)
    assert row is not None
    return row


def finished(session: Session, fit_id: str, attempt: int) -> bool:
    """Try to end a fit as succeeded."""
    return repository.finish(session, fit_id, attempt, status="succeeded", now=9.0)


def renewed(session: Session, fit_id: str, attempt: int) -> bool:
    """Try to renew a lease and store progress."""
    return repository.renew(
        session, fit_id, attempt, lease_until=99.0, progress={"stage": "x", "fraction": 0.5}
    )


def put_back(session: Session, fit_id: str, attempt: int) -> bool:
    """Try to requeue a fit."""
    return repository.put_back(session, fit_id, attempt, failures=1)


@pytest.mark.parametrize("write", [finished, renewed, put_back])
def test_replaced_attempt_cannot_write(
    database: Database, write: Callable[[Session, str, int], bool]
) -> None:
    """The first attempt cannot change the row; the second, which replaced it, can."""
    [fit] = queue(database)
    take(database, "first")
    with database.writing() as session:
        repository.put_back(session, fit, 1, failures=0)
    take(database, "second")
    before = state(database, fit)

    with database.writing() as session:
        accepted = write(session, fit, 1)

    after = state(database, fit)
    assert not accepted
    assert (after.version, after.status, after.attempt) == (before.version, "running", 2)
    with database.writing() as session:
        assert write(session, fit, 2)


@pytest.mark.parametrize("write", [finished, renewed, put_back])
def test_cancelled_fit_accepts_no_write(
    database: Database, write: Callable[[Session, str, int], bool]
) -> None:
    """A cancelled fit stays cancelled, whatever its process still reports."""
    [fit] = queue(database)
    take(database, "first")
    with database.writing() as session:
        assert repository.cancel(session, fit, 5.0)

    with database.writing() as session:
        assert not write(session, fit, 1)

    assert state(database, fit).status == "cancelled"
    with database.writing() as session:
        assert not repository.cancel(session, fit, 6.0)


def test_each_fit_is_claimed_once_by_concurrent_servers(database: Database) -> None:
    """Six threads claim twenty fits once each, as first attempts."""
    fits = queue(database, 20)
    taken: list[str] = []

    def work(owner: str) -> None:
        while row := take(database, owner):
            assert row.attempt == 1
            taken.append(row.id)

    threads = [threading.Thread(target=work, args=(f"t{n}",)) for n in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    assert sorted(taken) == sorted(fits)


def test_fits_are_claimed_in_order(database: Database) -> None:
    """Fits of a batch have equal creation times and are ordered by position."""
    fits = queue(database, 5)

    taken = [take(database, "owner") for _ in fits]

    assert [row.id for row in taken if row] == fits
    assert take(database, "owner") is None


@pytest.mark.parametrize(
    ("owner", "now", "is_expired"),
    [
        ("other/a", 9.0, False),
        ("other/a", 11.0, True),
        ("bench/old", 9.0, True),
        ("bench/me", 11.0, False),
        ("bench2/a", 9.0, False),
    ],
)
def test_fit_is_taken_over_when_its_server_is_gone(
    database: Database, owner: str, now: float, *, is_expired: bool
) -> None:
    """A fit of another place needs an expired lease; one of a former server here does not."""
    queue(database)
    take(database, owner)

    with database.reading() as session:
        rows = repository.expired(session, place="bench", owner="bench/me", now=now)

    assert bool(rows) == is_expired


def test_heartbeat_does_not_change_the_version(database: Database) -> None:
    """The version, by which listeners detect changes, increases with progress only."""
    [fit] = queue(database)
    take(database, "owner")
    version = state(database, fit).version

    with database.writing() as session:
        repository.renew(session, fit, 1, lease_until=50.0, progress={})
    silent = state(database, fit)
    with database.writing() as session:
        renewed(session, fit, 1)

    assert (silent.version, silent.lease_until) == (version, 50.0)
    assert state(database, fit).version == version + 1


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
