"""Outputs of fits that are removed at that moment."""

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
    "report": lambda fits, fit_id: fits.report(CALLER, fit_id).close(),
    "posterior": lambda fits, fit_id: fits.posterior(CALLER, fit_id).close(),
}


@pytest.fixture
def fits(bench: Bench) -> FitService:
    """The calls about the fits of a bench."""
    return FitService(bench.database, bench.storage, bench.supervisor, Quotas())


def succeeded(bench: Bench, *, batch_id: str | None = None) -> FitRow:
    """A fit that succeeded, with its outputs."""
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
    """Let something happen just before a path of an output is used for the n-th time."""
    attempt, left = bench.storage.attempt, iter(range(1, 100))

    def disturbed(fit_id: str, number: int) -> Path:
        if next(left) == turn:
            act()
        return attempt(fit_id, number)

    monkeypatch.setattr(bench.storage, "attempt", disturbed)


@pytest.mark.parametrize(
    ("what", "turn"), [("fit", 1), ("fit", 2), ("report", 1), ("posterior", 1)]
)
def test_fit_that_is_removed_while_it_is_read_is_not_found(
    bench: Bench, fits: FitService, what: str, turn: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between its row and each of its files: neither half an answer nor one about the service."""
    row = succeeded(bench)
    at_its(turn, bench, lambda: fits.delete(CALLER, row.id), monkeypatch)

    with pytest.raises(NotFound, match="there is no such fit"):
        READ[what](fits, row.id)


@pytest.mark.parametrize("what", ["fit", "report"])
def test_output_that_is_lost_is_a_fault_of_the_service(
    bench: Bench, fits: FitService, what: str
) -> None:
    """The fit is there and its files are not: nobody removed it."""
    row = succeeded(bench)
    bench.storage.remove_fit(row.id)

    with pytest.raises(Unavailable, match="is not in the data directory"):
        READ[what](fits, row.id)


def test_fit_without_a_posterior_says_so(bench: Bench, fits: FitService) -> None:
    """The other outputs are there."""
    row = succeeded(bench)
    (bench.storage.attempt(row.id, row.attempt) / "posterior.nc").unlink()

    assert not fits.get(CALLER, row.id).has_posterior
    with pytest.raises(NotReady, match="has no posterior"):
        fits.posterior(CALLER, row.id)


def in_batch(bench: Bench) -> tuple[BatchService, str, list[FitRow]]:
    """A batch of two fits that succeeded."""
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
def test_batch_that_is_removed_while_its_table_is_made_is_not_found(
    bench: Bench, turn: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before its first and before its second result is read."""
    batches, batch_id, _ = in_batch(bench)
    at_its(turn, bench, lambda: batches.delete(CALLER, batch_id), monkeypatch)

    with pytest.raises(NotFound, match="there is no such batch"):
        batches.table(CALLER, batch_id, "csv")


def test_fit_that_is_removed_while_the_table_is_made_is_left_out(
    bench: Bench, fits: FitService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One of two: the table is that of a batch with one."""
    batches, batch_id, rows = in_batch(bench)
    at_its(1, bench, lambda: fits.delete(CALLER, rows[0].id), monkeypatch)

    batch, table = batches.rows(CALLER, batch_id)

    assert [row.id for row in batch.fits] == [rows[1].id]
    assert len(table) == 1
