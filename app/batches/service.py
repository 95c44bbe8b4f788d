"""What can be done with batches: many motors at once, each a fit of its own.

A batch is accepted whole or not at all; after that one motor's failure is its own.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from app.access.quotas import Quotas
from app.access.service import Caller
from app.batches import repository
from app.batches.limits import MOST_RUNS
from app.batches.results import MISSING, refits_of
from app.database import Database
from app.errors import FieldRefused, KeyReused, NotAcceptable, NotFound
from app.fits import repository as fits
from app.fits.repository import ENDED
from app.fits.request import FitRequest, check_runs, checked_key, new_row, request_hash
from app.fits.supervisor import Supervisor
from app.identifiers import is_id, new_id
from app.paging import cursor_of, position_of
from app.storage import Storage
from app.tables import BatchRow, FitRow
from app.texts import checked_label
from identification.fleet.refit import Refit
from identification.fleet.table import MissingParquet, csv_text, parquet_bytes, rows_of

__all__ = ["ENDED", "Batch", "BatchService"]


@dataclass(frozen=True)
class Batch:
    """A batch with what belongs to it.

    Args:
        row: The batch.
        counts: Number of its fits in each state.
        fraction: Share of the whole that is done.
        fits: Its fits in order, where they were asked for.
    """

    row: BatchRow
    counts: Mapping[str, int]
    fraction: float = 0.0
    fits: Sequence[FitRow] = ()

    @property
    def status(self) -> str:
        """One word for all fits: ``partial`` where some succeeded and others did not."""
        states = {state for state, number in self.counts.items() if number}
        if not states:
            # Its fits were removed one by one, which only fits that ended can be.
            return "succeeded"
        if states <= {"queued"}:
            return "queued"
        if states & {"queued", "running"}:
            return "running"
        if len(states) == 1:
            return states.pop()
        return "partial" if "succeeded" in states else "failed"


class BatchService:
    """Batches of all workspaces; each call is made for one caller."""

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
    ) -> Batch:
        """Accept a batch.

        Args:
            caller: For whom.
            requests: One for each motor.
            name: What lists show.
            idempotency_key: As with a fit: the same word with the same request is the same batch.

        Raises:
            NotFound: A run is not in the caller's workspace.
            FieldRefused: A run is named twice in one fit, a name or key is not accepted, or the
                motors together have more runs than a batch may.
            OptionError: An option is not accepted.
            KeyReused: The key came before with another request.
            WaitingQuota: More fits of the workspace would wait than may.
            BatchQuota: The batch alone has more.
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
        # All that needs no database comes before the transaction, for which other writers wait.
        made = [(_fit_row(caller, row, n, request), request) for n, request in enumerate(requests)]
        known = None
        try:
            with self._database.writing() as session:
                known = repository.by_key(session, caller.workspace, key) if key else None
                if known is None:
                    self._quotas.check_fits(session, caller.workspace, len(requests))
                    check_runs(session, caller, *requests)
                    repository.add(session, row)
                    fits.add(session, *made)
        except IntegrityError:
            # The same key came twice at the same time, and the other was first.
            if key is None:
                raise
            with self._database.reading() as session:
                known = repository.by_key(session, caller.workspace, key)
        if known is not None and known.request_sha256 != row.request_sha256:
            raise KeyReused("this Idempotency-Key came before with another request; take a new key")
        self._supervisor.wake()
        return self.get(caller, row.id if known is None else known.id)

    def page(
        self, caller: Caller, *, after: str | None, limit: int
    ) -> tuple[list[Batch], str | None]:
        """Batches, newest first, and where the next page begins, if there is one.

        Raises:
            FieldRefused: `after` is no position that was given before.
        """
        with self._database.reading() as session:
            rows = repository.page(
                session, caller.workspace, after=position_of(after), limit=limit + 1
            )
            ids = [row.id for row in rows[:limit]]
            counts = repository.counts(session, ids)
            shares = repository.fractions(session, ids)
        batches = [Batch(row, counts[row.id], shares[row.id]) for row in rows[:limit]]
        return batches, cursor_of(rows, limit)

    def get(self, caller: Caller, batch_id: str) -> Batch:
        """One batch, with its fits.

        Raises:
            NotFound: There is no such batch in the caller's workspace.
        """
        with self._database.reading() as session:
            row = _known(session, caller, batch_id)
            counts = repository.counts(session, [row.id])[row.id]
            share = repository.fractions(session, [row.id])[row.id]
            return Batch(row, counts, share, fits.of_batch(session, row.id))

    def delete(self, caller: Caller, batch_id: str) -> Batch | None:
        """Cancel the fits of a batch that have not ended, or remove it where all have.

        Returns:
            The batch where fits were cancelled, None where it was removed.

        Raises:
            NotFound: There is no such batch in the caller's workspace.
        """
        with self._database.writing() as session:
            row = _known(session, caller, batch_id)
            cancelled = repository.cancel(session, row.id, time.time())
            ids = repository.fit_ids(session, row.id)
            if not cancelled:
                repository.remove(session, row.id)
        if cancelled:
            self._supervisor.wake()
            return self.get(caller, batch_id)
        for fit_id in ids:
            self._storage.remove_fit(fit_id)
        return None

    def rows(self, caller: Caller, batch_id: str) -> tuple[Batch, list[dict[str, Any]]]:
        """The batch and the table of its results, a row for each motor; see `table`.

        Raises:
            NotFound: There is no such batch in the caller's workspace.
        """
        batch, refits = self._refits(caller, batch_id)
        return batch, rows_of(refits)

    def table(self, caller: Caller, batch_id: str, kind: Literal["csv", "parquet"]) -> bytes:
        """The table of the results of a batch as a file.

        Args:
            caller: For whom.
            batch_id: The batch.
            kind: Form of the file.

        Raises:
            NotFound: There is no such batch in the caller's workspace.
            NotAcceptable: This service cannot write Parquet.
        """
        _, rows = self.rows(caller, batch_id)
        if kind == "csv":
            return csv_text(rows).encode()
        try:
            return parquet_bytes(rows)
        except MissingParquet as error:
            raise NotAcceptable(
                "this service writes no Parquet, since pyarrow is not installed; ask for text/csv "
                "or application/json"
            ) from error

    def report(self, caller: Caller, batch_id: str) -> str:
        """All motors of a batch on one page, with what is known by now.

        Raises:
            NotFound: There is no such batch in the caller's workspace.
        """
        # Imported with the first page: it brings what draws, for which every start would wait.
        from identification.fleet.page import render_fleet

        batch, refits = self._refits(caller, batch_id)
        return render_fleet(batch.row.name or "Batch", refits)

    def _refits(self, caller: Caller, batch_id: str) -> tuple[Batch, list[Refit]]:
        batch = self.get(caller, batch_id)
        refits = self._read(caller, batch)
        if any(refit.error == MISSING for refit in refits):
            # Fits are removed before their files: what is left of the batch is asked for again.
            batch = self.get(caller, batch_id)
            refits = self._read(caller, batch)
        return batch, refits

    def _read(self, caller: Caller, batch: Batch) -> list[Refit]:
        motors = sorted({fit.motor for fit in batch.fits if fit.motor})
        with self._database.reading() as session:
            earlier = repository.earlier(
                session, caller.workspace, motors, before=batch.row.created_at
            )
        return refits_of(self._storage, batch.fits, earlier)


def _check_size(requests: Sequence[FitRequest]) -> None:
    number = sum(len(request.training) + len(request.validation) for request in requests)
    if number > MOST_RUNS:
        raise FieldRefused(
            f"motors: they name {number} runs together, and one batch takes {MOST_RUNS}, each "
            "counted as often as a motor names it; send the motors as several batches",
            "motors",
        )


def _fit_row(caller: Caller, batch: BatchRow, position: int, request: FitRequest) -> FitRow:
    row = new_row(caller, request)
    row.batch_id, row.position, row.created_at = batch.id, position, batch.created_at
    return row


def _known(session: Session, caller: Caller, batch_id: str) -> BatchRow:
    found = None
    if is_id("batch", batch_id):
        found = repository.get(session, caller.workspace, batch_id)
    if found is None:
        raise NotFound("there is no such batch; GET /api/v1/batches lists them")
    return found
