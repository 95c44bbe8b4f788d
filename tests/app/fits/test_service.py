"""Fits that are deleted while their outputs are read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.access.quotas import Quotas
from app.access.service import Caller
from app.batches.service import BatchService
from app.errors import NotFound, NotReady, Unavailable
from app.fits.service import FitService
from app.identifiers import new_id
from app.tables import BatchRow, FitRow
from tests.app.fits.supervised import Bench
from tests.app.rows import fit_row

CALLER = Caller("default")
READ: dict[str, Callable[[FitService, str], Any]] = {
    "fit": lambda fits, fit_id: fits.get(CALLER, fit_id),
    "report": lambda fits, fit_id: fits.output(CALLER, fit_id, "report.html").close(),
    "posterior": lambda fits, fit_id: fits.output(CALLER, fit_id, "posterior.nc").close(),
}


@pytest.fixture
def fits(bench: Bench) -> FitService:
    """Fit service of a bench."""
    return FitService(bench.database, bench.storage, bench.supervisor, Quotas())


def succeeded(bench: Bench, *, batch_id: str | None = None) -> FitRow:
    """Succeeded fit with its outputs."""
    row = fit_row("default", "succeeded", ended_at=1.0, batch_id=batch_id)
    with bench.database.writing() as session:
        session.add(row)
    place = bench.storage.attempt(row.id, row.attempt)
    place.mkdir(parents=True)
    for name in ("result.json", "report.html", "posterior.nc"):
        (place / name).write_text("{}")
    return row


def at_its(
    turn: int, bench: Bench, act: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Call a function just before the n-th use of an output path."""
    attempt, left = bench.storage.attempt, iter(range(1, 100))

    def disturbed(fit_id: str, number: int) -> Path:
        if next(left) == turn:
            act()
        return attempt(fit_id, number)

    monkeypatch.setattr(bench.storage, "attempt", disturbed)


@pytest.mark.parametrize(
    ("what", "turn"), [("fit", 1), ("fit", 2), ("report", 1), ("posterior", 1)]
)
def test_fit_deleted_while_it_is_read_is_not_found(
    bench: Bench, fits: FitService, what: str, turn: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The service raises NotFound, not an error about a lost file."""
    row = succeeded(bench)
    at_its(turn, bench, lambda: fits.delete(CALLER, row.id), monkeypatch)

    with pytest.raises(NotFound, match="there is no such fit"):
        READ[what](fits, row.id)


@pytest.mark.parametrize("what", ["fit", "report"])
def test_lost_output_is_a_fault_of_the_service(bench: Bench, fits: FitService, what: str) -> None:
    """The row of the fit still exists, so no client has deleted it."""
    row = succeeded(bench)
    bench.storage.remove_fit(row.id)

    with pytest.raises(Unavailable, match="is not in the data directory"):
        READ[what](fits, row.id)


def test_missing_posterior_is_not_ready(bench: Bench, fits: FitService) -> None:
    """The fit reports that it has no posterior; its result can be read."""
    row = succeeded(bench)
    (bench.storage.attempt(row.id, row.attempt) / "posterior.nc").unlink()

    assert not fits.get(CALLER, row.id).has_posterior
    with pytest.raises(NotReady, match="has no posterior"):
        fits.output(CALLER, row.id, "posterior.nc")


def in_batch(bench: Bench) -> tuple[BatchService, str, list[FitRow]]:
    """Batch of two succeeded fits."""
    batch = BatchRow(
        id=new_id("batch"),
        workspace="default",
        name=None,
        created_at=1.0,
        idempotency_key=None,
        request_sha256="",
    )
    with bench.database.writing() as session:
        session.add(batch)
    rows = [succeeded(bench, batch_id=batch.id) for _ in range(2)]
    service = BatchService(bench.database, bench.storage, bench.supervisor, Quotas())
    return service, batch.id, rows


@pytest.mark.parametrize("turn", [1, 2])
def test_batch_deleted_while_its_table_is_made_is_not_found(
    bench: Bench, turn: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The batch is deleted before its first or second result is read."""
    batches, batch_id, _ = in_batch(bench)
    at_its(turn, bench, lambda: batches.delete(CALLER, batch_id), monkeypatch)

    with pytest.raises(NotFound, match="there is no such batch"):
        batches.table(CALLER, batch_id, "csv")


def test_fit_deleted_while_the_table_is_made_is_left_out(
    bench: Bench, fits: FitService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The table has one row for the remaining one of two fits."""
    batches, batch_id, rows = in_batch(bench)
    at_its(1, bench, lambda: fits.delete(CALLER, rows[0].id), monkeypatch)

    batch, table = batches.rows(CALLER, batch_id)

    assert [row.id for row in batch.fits] == [rows[1].id]
    assert len(table) == 1
