"""Batch service: submit, list, cancel and delete batches, and read their results.

A batch is accepted or rejected as a whole; its fits then succeed or fail independently.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app import queries
from app.access.quotas import Quotas
from app.access.service import Caller
from app.batches import MOST_RUNS
from app.database import Database, portions
from app.errors import FieldRefused, NotAcceptable
from app.fits import repository as fits
from app.fits.outputs import read_result
from app.fits.repository import ENDED
from app.fits.request import FitRequest, check_runs, checked_key, new_row, request_hash
from app.fits.supervisor import Supervisor
from app.identifiers import new_id
from app.storage import Storage
from app.tables import BatchRow, FitRow
from app.texts import checked_label, moment
from identification.fleet.refit import Refit, compared_with, refit_of
from identification.fleet.table import MissingParquet, csv_text, parquet_bytes, rows_of

__all__ = ["BatchService", "StoredBatch", "refits_of"]

_MISSING = "its result is missing or damaged in the data directory"
# A batch can have a thousand results, which the table and the page each read in full.
_MOST_KEPT = 4000


@dataclass(frozen=True)
class StoredBatch:
    """A batch with its derived data."""

    row: BatchRow
    counts: Mapping[str, int]
    """Number of its fits in each state."""
    fraction: float = 0.0
    fits: Sequence[FitRow] = ()
    """Its fits in order, if requested."""

    @property
    def status(self) -> str:
        """Combined state of all fits; ``partial`` if some succeeded and others did not."""
        states = {state for state, number in self.counts.items() if number}
        if not states:
            # All fits were deleted singly, which requires that they had ended.
            return "succeeded"
        if states <= {"queued"}:
            return "queued"
        if states & {"queued", "running"}:
            return "running"
        if len(states) == 1:
            return states.pop()
        return "partial" if "succeeded" in states else "failed"


class BatchService:
    """Operations on batches; each is restricted to the workspace of its caller.

    `NotFound` is raised for an ID that this workspace does not have.
    """

    def __init__(
        self, database: Database, storage: Storage, supervisor: Supervisor, quotas: Quotas
    ) -> None:
        self._quotas = quotas
        self._database = database
        self._storage = storage
        self._supervisor = supervisor

    def create(
        self,
        caller: Caller,
        requests: Sequence[FitRequest],
        name: str | None,
        idempotency_key: str | None,
    ) -> StoredBatch:
        """Submit a batch of one fit per motor.

        The same key with the same request returns the same batch, as for a fit.

        Raises:
            NotFound: A run is not in the caller's workspace.
            FieldRefused: A fit names a run twice, a validation run equals a training run, a name or
                key is invalid, or the motors together exceed the maximum number of runs.
            OptionError: An option is invalid.
            KeyReused: The key was used before with a different request.
            WaitingQuota: The workspace would exceed its quota of waiting fits.
            BatchQuota: The batch alone exceeds that quota.
        """
        key = checked_key(idempotency_key)
        _check_size(requests)
        row = BatchRow(
            id=new_id("batch"),
            workspace=caller.workspace,
            name=checked_label("name", name),
            created_at=time.time(),
            idempotency_key=key,
            request_sha256=request_hash(*requests),
        )
        # Build the rows before the transaction, which blocks other writers.
        made = [(_fit_row(caller, row, n, request), request) for n, request in enumerate(requests)]

        def add(session: Session) -> None:
            self._quotas.check_fits(session, caller.workspace, len(requests))
            for (own, _), motor in zip(made, check_runs(session, caller, *requests), strict=True):
                own.motor = own.motor or motor
            session.add(row)
            session.flush()
            fits.add(session, *made)

        stored = queries.requested_once(self._database, row, add)
        self._supervisor.wake()
        return self.get(caller, stored.id)

    def page(
        self, caller: Caller, *, after: str | None, limit: int
    ) -> tuple[list[StoredBatch], str | None]:
        """Page of batches, newest first, and the cursor of the next page, if any."""
        with self._database.reading() as session:
            rows, following = queries.page(
                session, BatchRow, caller.workspace, after=after, limit=limit
            )
            return _stored(session, rows), following

    def get(self, caller: Caller, batch_id: str) -> StoredBatch:
        """Batch with its fits."""
        with self._database.reading() as session:
            row = queries.known(session, BatchRow, caller.workspace, batch_id)
            [batch] = _stored(session, [row])
            listed = select(FitRow).where(FitRow.batch_id == row.id).order_by(FitRow.position)
            return replace(batch, fits=session.scalars(listed).all())

    def delete(self, caller: Caller, batch_id: str, *, remove: bool = True) -> StoredBatch | None:
        """Cancel the unfinished fits of a batch; if all have ended, delete it and return None.

        Without `remove`, an ended batch is returned as it is.
        """
        with self._database.writing() as session:
            row = queries.known(session, BatchRow, caller.workspace, batch_id)
            cancelled = fits.cancel(session, row.id, time.time(), of_batch=True)
            ids = session.scalars(select(FitRow.id).where(FitRow.batch_id == row.id)).all()
            if remove and not cancelled:
                # The foreign keys delete its fits, too.
                session.delete(row)
        if cancelled:
            self._supervisor.wake()
        if cancelled or not remove:
            return self.get(caller, batch_id)
        for fit_id in ids:
            self._storage.remove_fit(fit_id)
        return None

    def rows(self, caller: Caller, batch_id: str) -> tuple[StoredBatch, list[dict[str, Any]]]:
        """Batch and the rows of its results table, one per motor."""
        batch, refits = self._refits(caller, batch_id)
        return batch, rows_of(refits)

    def table(self, caller: Caller, batch_id: str, kind: Literal["csv", "parquet"]) -> bytes:
        """Results table of a batch as a file; raise `NotAcceptable` if Parquet is not installed."""
        _, rows = self.rows(caller, batch_id)
        if kind == "csv":
            return csv_text(rows).encode()
        try:
            return parquet_bytes(rows)
        except MissingParquet as error:
            raise NotAcceptable(
                "Parquet is not available, because pyarrow is not installed; request text/csv or "
                "application/json"
            ) from error

    def report(self, caller: Caller, batch_id: str) -> str:
        """Page of all motors of a batch, with the results available so far."""
        # Lazy import: the plotting library would slow down every start.
        from identification.fleet.page import render_fleet

        batch, refits = self._refits(caller, batch_id)
        return render_fleet(batch.row.name or "Batch", refits, back="/")

    def _refits(
        self, caller: Caller, batch_id: str, *, is_again: bool = False
    ) -> tuple[StoredBatch, list[Refit]]:
        batch = self.get(caller, batch_id)
        motors = sorted({fit.motor for fit in batch.fits if fit.motor})
        with self._database.reading() as session:
            earlier = _earlier(session, caller.workspace, motors, batch.row.created_at)
        refits = refits_of(self._storage, batch.fits, earlier)
        if any(refit.error == _MISSING for refit in refits) and not is_again:
            # A fit is deleted before its files, so a missing file may mean a deleted fit.
            return self._refits(caller, batch_id, is_again=True)
        return batch, refits


def _check_size(requests: Sequence[FitRequest]) -> None:
    number = sum(len(request.training) + len(request.validation) for request in requests)
    if number > MOST_RUNS:
        raise FieldRefused(
            f"motors: {number} runs; expected at most {MOST_RUNS} in one batch, each counted for "
            "every motor that uses it; send the motors as several batches",
            "motors",
        )


def _fit_row(caller: Caller, batch: BatchRow, position: int, request: FitRequest) -> FitRow:
    row = new_row(caller, request)
    row.batch_id, row.position, row.created_at = batch.id, position, batch.created_at
    return row


def _stored(session: Session, rows: Sequence[BatchRow]) -> list[StoredBatch]:
    """Batches with the states of their fits; an ended fit is complete in any final state."""
    query = (
        select(FitRow.batch_id, FitRow.status, func.count(), func.sum(FitRow.fraction))
        .where(FitRow.batch_id.in_([row.id for row in rows]))
        .group_by(FitRow.batch_id, FitRow.status)
    )
    counts: dict[str | None, dict[str, int]] = {row.id: {} for row in rows}
    done: dict[str | None, float] = dict.fromkeys(counts, 0.0)
    for batch_id, status, number, fraction in session.execute(query):
        counts[batch_id][status] = number
        done[batch_id] += number if status in ENDED else fraction
    totals = {batch_id: sum(found.values()) for batch_id, found in counts.items()}
    return [
        StoredBatch(row, counts[row.id], done[row.id] / totals[row.id] if totals[row.id] else 1.0)
        for row in rows
    ]


def _earlier(
    session: Session, workspace: str, motors: Sequence[str], before: float
) -> dict[str, FitRow]:
    """Newest succeeded fit of each motor that was requested before a given time, by motor."""
    found: dict[str, FitRow] = {}
    for some in portions(motors):
        newest = (
            select(FitRow.motor, func.max(FitRow.created_at).label("created_at"))
            .where(
                FitRow.workspace == workspace,
                FitRow.motor.in_(some),
                FitRow.status == "succeeded",
                FitRow.created_at < before,
            )
            .group_by(FitRow.motor)
            .subquery()
        )
        query = (
            select(FitRow)
            .join(
                newest,
                (FitRow.motor == newest.c.motor) & (FitRow.created_at == newest.c.created_at),
            )
            .where(FitRow.workspace == workspace, FitRow.status == "succeeded")
            # Fits of one batch share their creation time; the last one of a motor counts.
            .order_by(FitRow.position)
        )
        found |= {str(row.motor): row for row in session.scalars(query)}
    return found


def refits_of(
    storage: Storage, fits: Sequence[FitRow], earlier: Mapping[str, FitRow]
) -> list[Refit]:
    """Rows of the table, each compared with the previous fit of its motor."""
    refits = []
    for row in fits:
        before = earlier.get(row.motor) if row.motor and row.status == "succeeded" else None
        previous = None if before is None else _refit(storage, before)
        refits.append(compared_with(_refit(storage, row), previous))
    return refits


def _refit(storage: Storage, row: FitRow) -> Refit:
    motor = row.motor or "unnamed motor"
    if row.status == "succeeded":
        try:
            refit = _read_refit(storage.attempt(row.id, row.attempt))
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            # The last four: malformed content of a result that has no checksum.
            refit = Refit(motor, row.status, error=_MISSING)
    else:
        refit = Refit(motor, row.status, error=str((row.error or {}).get("detail", "")))
    return replace(
        refit,
        motor=motor,
        type=row.motor_type or "",
        status=row.status,
        fit=row.id,
        ended_at=None if row.ended_at is None else moment(row.ended_at),
        link=f"/fits/{row.id}",
    )


@lru_cache(maxsize=_MOST_KEPT)
def _read_refit(directory: Path) -> Refit:
    # Cached: a result never changes once its fit has succeeded.
    return refit_of("", "", read_result(directory))
