"""What is removed because of its age, and what is never."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from app.access.service import AccessService
from app.database import Database
from app.housekeeping import Housekeeper
from app.identifiers import new_id
from app.metrics import Metrics
from app.retention.service import Removed, Retention
from app.storage import Storage
from app.tables import BatchRow, FitRow, RunRow
from tests.app.rows import fit_row, role_row, run_row
from tests.app.statements import statements

DAY = 86_400.0
NOW = time.time()
OLD, YOUNG = NOW - 31 * DAY, NOW - 29 * DAY


@pytest.fixture
def storage(tmp_path: Path) -> Storage:
    """A data directory that is ready."""
    made = Storage(tmp_path / "data", "bench")
    made.prepare()
    return made


@pytest.fixture
def retention(database: Database, storage: Storage) -> Retention:
    """Thirty days."""
    return Retention(database, storage, Metrics(), 30.0)


def keep(database: Database, storage: Storage, *rows: object) -> None:
    """Add rows, and the files that belong to them."""
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
    """Names of the runs and of the fits that have files."""
    return tuple({p.name for p in (storage.directory / n).iterdir()} for n in ("runs", "fits"))  # type: ignore[return-value]


def test_old_fit_goes_with_its_run_and_all_their_files(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """Ended 31 days ago where 30 are kept; nothing else needs its run."""
    run, fit = run_row("a", created_at=OLD), fit_row("a", "succeeded", ended_at=OLD)
    keep(database, storage, run, fit, role_row(fit, run))

    assert retention.sweep() == Removed(fits=1, runs=1)
    assert left(storage) == (set(), set())


@pytest.mark.parametrize("status", ["queued", "running"])
def test_what_has_not_ended_is_never_removed(
    database: Database, storage: Storage, retention: Retention, status: str
) -> None:
    """A fit that waits since ever, and the run that it needs."""
    run, fit = run_row("a", created_at=OLD), fit_row("a", status)
    fit.created_at = OLD
    keep(database, storage, run, fit, role_row(fit, run))

    assert retention.sweep() == Removed()
    assert left(storage) == ({run.id}, {fit.id})


def test_run_stays_as_long_as_a_fit_names_it(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """An old run of an old and of a young fit: the old fit goes alone."""
    run = run_row("a", created_at=OLD)
    old, young = (fit_row("a", "succeeded", ended_at=at) for at in (OLD, YOUNG))
    keep(database, storage, run, old, young, role_row(old, run), role_row(young, run))

    assert retention.sweep() == Removed(fits=1)
    assert left(storage) == ({run.id}, {young.id})


def test_run_that_came_again_counts_from_then(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """Whoever was told today that a run is known may fit it tomorrow."""
    again, once = run_row("a", created_at=OLD, sent_at=NOW), run_row("a", created_at=OLD)
    keep(database, storage, again, once)

    assert retention.sweep() == Removed(runs=1)
    assert left(storage) == ({again.id}, set())


def test_batch_goes_at_once_or_not_at_all(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """One whose fits are all old goes; one of which a fit is young, or runs, stays whole."""
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

    assert retention.sweep() == Removed(fits=2, batches=1)
    assert left(storage)[1] == {fit.id for fit in fits[2:]}


def test_old_things_go_in_portions_and_are_looked_for_without_a_writer(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """60 fits, with the rows of whose runs the writer is held, and 240 runs."""
    with database.writing() as session:
        session.add_all(fit_row("a", "succeeded", ended_at=OLD) for _ in range(60))
        session.add_all(run_row("a", created_at=OLD) for _ in range(240))

    with statements(database, written=True) as seen:
        assert retention.sweep() == Removed(fits=60, runs=240)
    deleted = [words.split()[2] for words in seen if words.startswith("DELETE")]
    assert [deleted.count(table) for table in ("fits", "runs", "batches")] == [3, 2, 1]
    looked = [words for words in seen if words.startswith("SELECT") and "ORDER BY" in words]
    assert not looked or database.url.get_backend_name() == "postgresql"


def test_nothing_is_removed_where_no_age_is_set(database: Database, storage: Storage) -> None:
    """0 days, the default, keeps everything that has a row."""
    run, fit = run_row("a", created_at=1.0), fit_row("a", "failed", ended_at=1.0)
    keep(database, storage, run, fit)

    assert Retention(database, storage, Metrics(), 0.0).sweep() == Removed()


def test_files_without_a_row_go_once_they_are_old(
    database: Database, storage: Storage, retention: Retention
) -> None:
    """What a crash between a file and its row left; a young one may still get its row."""
    keep(database, storage, run_row("a"))
    old, young = (storage.run(new_id("run")) for _ in range(2))
    for path in (old, young):
        path.write_bytes(b"")
    os.utime(old, (OLD, OLD))

    assert retention.sweep() == Removed(files=1)
    assert (old.exists(), young.exists()) == (False, True)


def test_many_go_in_portions(database: Database, storage: Storage, retention: Retention) -> None:
    """500 fits and their runs are more than one transaction removes."""
    rows: list[object] = []
    for _ in range(500):
        run, fit = run_row("a", created_at=OLD), fit_row("a", "failed", ended_at=OLD)
        rows += [run, fit, role_row(fit, run)]
    with database.writing() as session:
        session.add_all(rows)

    assert retention.sweep() == Removed(fits=500, runs=500)


class Clocks:
    """The clocks of a machine, moved by hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.wall, self.steady = NOW, 1000.0
        monkeypatch.setattr(time, "time", lambda: self.wall)
        monkeypatch.setattr(time, "monotonic", lambda: self.steady)

    def pass_by(self, seconds: float, jump: float = 0.0) -> None:
        """Let time go by; the wall clock jumps besides."""
        self.steady += seconds
        self.wall += seconds + jump


def test_old_things_go_in_the_interval_that_is_set(
    database: Database, storage: Storage, retention: Retention, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every hour: not after 59 minutes, but after 61."""
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
def test_clock_that_jumps_makes_nothing_old(
    database: Database,
    storage: Storage,
    retention: Retention,
    monkeypatch: pytest.MonkeyPatch,
    jump: float,
) -> None:
    """A year ahead a young run would be old; set right within a day, it is still there."""
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


def test_uses_of_keys_are_written_down(
    database: Database, retention: Retention, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not by the call itself, which would wait for a write, but within a minute."""
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
