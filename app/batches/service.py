"""What can be done with batches: many motors at once, each a fit of its own.

A batch is accepted whole or not at all; after that one motor's failure is its own.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy.exc import IntegrityError

from app.access.quotas import Quotas
from app.access.service import Caller
from app.batches import repository
from app.database import Database
from app.errors import KeyReused, NotFound
from app.fits import repository as fits
from app.fits.request import FitRequest, check_runs, checked_key, new_row, request_hash
from app.fits.supervisor import Supervisor
from app.identifiers import is_id, new_id
from app.paging import cursor_of, position_of
from app.runs.service import checked_label
from app.tables import BatchRow, FitRow

__all__ = ["Batch", "BatchService"]


@dataclass(frozen=True)
class Batch:
    """A batch with what belongs to it.

    Args:
        row: The batch.
        counts: Number of its fits in each state.
        fits: Its fits in order, where they were asked for.
    """

    row: BatchRow
    counts: Mapping[str, int]
    fits: Sequence[FitRow] = ()

    @property
    def status(self) -> str:
        """One word for all fits: ``partial`` where some succeeded and others did not."""
        states = {state for state, number in self.counts.items() if number}
        if states <= {"queued"}:
            return "queued"
        if states & {"queued", "running"}:
            return "running"
        if len(states) == 1:
            return states.pop()
        return "partial" if "succeeded" in states else "failed"


class BatchService:
    """Batches of all workspaces; each call is made for one caller."""

    def __init__(self, database: Database, supervisor: Supervisor, quotas: Quotas) -> None:
        self._quotas = quotas
        self._database = database
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
            FieldRefused: A run is named twice in one fit, or a name or key is not accepted.
            OptionError: An option is not accepted.
            KeyReused: The key came before with another request.
            WaitingQuota: More fits of the workspace would wait than may.
        """
        key = checked_key(idempotency_key)
        row = BatchRow(
            id=new_id("batch"),
            workspace=caller.workspace,
            name=checked_label("name", name),
            created_at=time.time(),
            idempotency_key=key,
            request_sha256=request_hash(*requests),
        )
        known = None
        try:
            with self._database.writing() as session:
                known = repository.by_key(session, caller.workspace, key) if key else None
                if known is None:
                    self._quotas.check_fits(session, caller.workspace, len(requests))
                    repository.add(session, row)
                    for position, request in enumerate(requests):
                        check_runs(session, caller, request)
                        fit = new_row(caller, request)
                        fit.batch_id, fit.position = row.id, position
                        fit.created_at = row.created_at
                        fits.add(session, fit, request.training, request.validation)
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
            counts = repository.counts(session, [row.id for row in rows])
        return [Batch(row, counts[row.id]) for row in rows[:limit]], cursor_of(rows, limit)

    def get(self, caller: Caller, batch_id: str) -> Batch:
        """One batch, with its fits.

        Raises:
            NotFound: There is no such batch in the caller's workspace.
        """
        with self._database.reading() as session:
            row = (
                repository.get(session, caller.workspace, batch_id)
                if is_id("batch", batch_id)
                else None
            )
            if row is None:
                raise NotFound("there is no such batch; GET /api/v1/batches lists them")
            counts = repository.counts(session, [row.id])[row.id]
            return Batch(row, counts, fits.of_batch(session, row.id))
