"""Retention: data that expire, and data that are never removed."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from app.access.service import AccessService
from app.database import Database
from app.housekeeping import Housekeeper, Retention
from app.identifiers import new_id
from app.metrics import Metrics
from app.storage import Storage
from app.tables import BatchRow, FitRow, RunRow
from tests.app.rows import fit_row, role_row, run_row
from tests.app.statements import statements

DAY = 86_400.0
NOW = time.time()
OLD, YOUNG = NOW - 31 * DAY, NOW - 29 * DAY


@pytest.fixture
def storage(tmp_path: Path) -> Storage:
    """Prepared data directory."""
    made = Storage(tmp_path / "data", "bench")
    made.prepare()
    return made


@pytest.fixture
def retention(database: Database, storage: Storage) -> Retention:
    """Retention of thirty days."""
    return Retention(database, storage, Metrics(), 30.0)


def keep(database: Database, storage: Storage, *rows: object) -> None:
    """Insert rows and write the files that belong to them."""
    with database.writing() as session:
        for row in rows:
            session.add(row)
            session.flush()
    for row in rows:
        if isinstance(row, RunRow):
            storage.run(row.id).write_bytes(b"bytes of a run")
        if isinstance(row, FitRow):
            storage.attempt(row.id, 1).mkdir(parents=True)
            (storage.attempt(row.id, 1) / "result.json").write_text("{}")


def left(storage: Storage) -> tuple[set[str], set[str]]:
    """Names of the runs and fits that have files."""
    return tuple({p.name for p in (storage.directory / n).iterdir()} for n in ("runs", "fits"))  # type: ignore[return-value]


def test_old_fit_is_removed_with_its_run_and_files(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """A fit that ended 31 days ago is removed after 30 days, together with its run."""
    run, fit = run_row("a", created_at=OLD), fit_row("a", "succeeded", ended_at=OLD)
    keep(database, storage, run, fit, role_row(fit, run))

    assert retention.sweep() == {"fits": 1, "runs": 1}
    assert left(storage) == (set(), set())


@pytest.mark.parametrize("status", ["queued", "running"])
def test_unfinished_fit_is_never_removed(
    database: Database, storage: Storage, retention: Retention, status: str
) -> None:
    """The run that an old waiting or running fit needs is kept as well."""
    run, fit = run_row("a", created_at=OLD), fit_row("a", status)
    fit.created_at = OLD
    keep(database, storage, run, fit, role_row(fit, run))

    assert retention.sweep() == {}
    assert left(storage) == ({run.id}, {fit.id})


def test_run_stays_as_long_as_a_fit_names_it(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """An old run of an old and a recent fit is kept; the old fit is removed."""
    run = run_row("a", created_at=OLD)
    old, young = (fit_row("a", "succeeded", ended_at=at) for at in (OLD, YOUNG))
    keep(database, storage, run, old, young, role_row(old, run), role_row(young, run))

    assert retention.sweep() == {"fits": 1}
    assert left(storage) == ({run.id}, {young.id})


def test_repeated_upload_renews_a_run(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """The age of a run counts from its latest upload."""
    again, once = run_row("a", created_at=OLD, sent_at=NOW), run_row("a", created_at=OLD)
    keep(database, storage, again, once)

    assert retention.sweep() == {"runs": 1}
    assert left(storage) == ({again.id}, set())


def test_batch_is_removed_as_a_whole(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """A batch with a recent or running fit keeps all its fits."""
    batches = [
        BatchRow(id=new_id("batch"), workspace="a", created_at=OLD, request_sha256="")
        for _ in range(3)
    ]
    gone, young, runs = (batch.id for batch in batches)
    fits = [
        fit_row("a", "succeeded", ended_at=OLD, batch_id=gone),
        fit_row("a", "failed", ended_at=OLD, batch_id=gone),
        fit_row("a", "succeeded", ended_at=OLD, batch_id=young),
        fit_row("a", "succeeded", ended_at=YOUNG, batch_id=young),
        fit_row("a", "succeeded", ended_at=OLD, batch_id=runs),
        fit_row("a", "running", batch_id=runs),
    ]
    keep(database, storage, *batches, *fits)

    assert retention.sweep() == {"fits": 2, "batches": 1}
    assert left(storage)[1] == {fit.id for fit in fits[2:]}


def test_removal_is_in_portions_and_searches_without_a_write_lock(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """60 fits are removed in three transactions, 240 runs in two."""
    with database.writing() as session:
        session.add_all(fit_row("a", "succeeded", ended_at=OLD) for _ in range(60))
        session.add_all(run_row("a", created_at=OLD) for _ in range(240))

    with statements(database, written=True) as seen:
        assert retention.sweep() == {"fits": 60, "runs": 240}
    deleted = [words.split()[2] for words in seen if words.startswith("DELETE")]
    assert [deleted.count(table) for table in ("fits", "runs", "batches")] == [3, 2, 1]
    looked = [words for words in seen if words.startswith("SELECT") and "ORDER BY" in words]
    assert not looked or database.url.get_backend_name() == "postgresql"


def test_default_retention_removes_nothing(database: Database, storage: Storage) -> None:
    """The default of 0 days keeps everything that has a row."""
    run, fit = run_row("a", created_at=1.0), fit_row("a", "failed", ended_at=1.0)
    keep(database, storage, run, fit)

    assert Retention(database, storage, Metrics(), 0.0).sweep() == {}


def test_old_files_without_a_row_are_removed(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """A crash can leave a file without a row; a recent file may still get its row."""
    keep(database, storage, run_row("a"))
    old, young = (storage.run(new_id("run")) for _ in range(2))
    for path in (old, young):
        path.write_bytes(b"")
    os.utime(old, (OLD, OLD))

    assert retention.sweep() == {"files": 1}
    assert (old.exists(), young.exists()) == (False, True)


def test_many_items_are_removed_in_portions(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """500 fits with their runs exceed the size of one transaction."""
    rows: list[object] = []
    for _ in range(500):
        run, fit = run_row("a", created_at=OLD), fit_row("a", "failed", ended_at=OLD)
        rows += [run, fit, role_row(fit, run)]
    with database.writing() as session:
        session.add_all(rows)

    assert retention.sweep() == {"fits": 500, "runs": 500}


class Clocks:
    """Wall clock and monotonic clock, set by the test."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.wall, self.steady = NOW, 1000.0
        monkeypatch.setattr(time, "time", lambda: self.wall)
        monkeypatch.setattr(time, "monotonic", lambda: self.steady)

    def pass_by(self, seconds: float, jump: float = 0.0) -> None:
        """Advance both clocks, and the wall clock by an additional jump."""
        self.steady += seconds
        self.wall += seconds + jump


def test_removal_follows_the_interval(
    database: Database, storage: Storage, retention: Retention, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With an interval of an hour, nothing is removed after 59 minutes."""
    clocks = Clocks(monkeypatch)
    housekeeper = Housekeeper(AccessService(database), retention, sweep_s=3600.0)
    keep(database, storage, run_row("a", created_at=OLD))

    clocks.pass_by(3540.0)
    housekeeper.turn()
    assert left(storage)[0]
    clocks.pass_by(120.0)
    housekeeper.turn()
    assert not left(storage)[0]


@pytest.mark.parametrize("jump", [365 * DAY, -365 * DAY])
def test_clock_jump_does_not_expire_data(
    database: Database,
    storage: Storage,
    retention: Retention,
    monkeypatch: pytest.MonkeyPatch,
    jump: float,
) -> None:
    """A recent run survives a jump of a year that is corrected within a day."""
    clocks = Clocks(monkeypatch)
    housekeeper = Housekeeper(AccessService(database), retention, sweep_s=3600.0)
    run = run_row("a", created_at=YOUNG)
    keep(database, storage, run)

    clocks.pass_by(60.0, jump)
    for _ in range(20):
        housekeeper.turn()
        clocks.pass_by(3600.0)
    clocks.pass_by(60.0, -jump)
    for _ in range(20):
        housekeeper.turn()
        clocks.pass_by(3600.0)

    assert left(storage)[0] == {run.id}


def test_uses_of_keys_are_stored_later(
    database: Database, retention: Retention, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A call does not wait for the write; the housekeeper stores the time within a minute."""
    clocks = Clocks(monkeypatch)
    access = AccessService(database)
    housekeeper = Housekeeper(access, retention, sweep_s=3600.0)
    _, secret = access.create_key("bench")
    clocks.pass_by(60.0)

    access.caller_of_key(secret)
    before = access.list_keys()[0].last_used_at
    housekeeper.turn()

    assert before is None
    assert access.list_keys()[0].last_used_at == pytest.approx(NOW + 60.0)
