"""Retention sweep: deletes expired rows, and files without a row.

Expired rows are searched for in read transactions, which block no writer, and are deleted in
portions.  Rows are deleted before their files.  If the service ends between the two, a later sweep
finds the files without a row.

A fit has expired if it ended before a cutoff time.  A fit of a batch has expired only if the whole
batch has, so that a batch is deleted as a whole.  A run has expired if its latest upload was before
the cutoff and no fit names it.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, delete, exists, func, or_, select
from sqlalchemy.orm import Session

from app.database import Database, portions
from app.fits import repository as fits
from app.fits.repository import ENDED
from app.metrics import Metrics
from app.runs import repository as runs
from app.storage import Storage
from app.tables import BatchRow, FitRow, FitRunRow, PendingRow, RunRow

__all__ = ["Removed", "Retention"]

# Deleting a fit also deletes the rows of its runs, of which it may have 400.
_FITS_AT_ONCE = 25
_RUNS_AT_ONCE = 200
_DAY_S = 86_400.0
_UNSYNCHRONISED: dict[str, Any] = {"execution_options": {"synchronize_session": False}}
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Removed:
    """Number of deleted items."""

    fits: int = 0
    """Ended fits."""
    runs: int = 0
    """Runs that no fit named, and uploads never confirmed as runs."""
    batches: int = 0
    """Batches without fits."""
    files: int = 0
    """Files and directories without a row."""


class Retention:
    """Removal of expired data; 0 days keep them."""

    def __init__(self, database: Database, storage: Storage, metrics: Metrics, days: float) -> None:
        self._database = database
        self._storage = storage
        self._metrics = metrics
        self._days = days

    def sweep(self, now: float | None = None) -> Removed:
        """Delete expired items and return their number."""
        now = time.time() if now is None else now
        found = Removed(files=self._sweep_files(now))
        if self._days:
            before = now - self._days * _DAY_S
            found = Removed(
                fits=self._remove_fits(before),
                batches=self._remove_batches(before),
                runs=self._remove_runs(before),
                files=found.files,
            )
        counted = {name: number for name, number in vars(found).items() if number}
        for kind, number in counted.items():
            self._metrics.removed.labels(kind).inc(number)
        if counted:
            _log.info("old things were removed", extra=counted)
        return found

    def _remove_fits(self, before: float) -> int:
        with self._database.reading() as session:
            ids = _old_fits(session, before)
        for some in portions(ids, _FITS_AT_ONCE):
            with self._database.writing() as session:
                session.execute(delete(FitRow).where(FitRow.id.in_(some)))
            for fit_id in some:
                self._storage.remove_fit(fit_id)
        return len(ids)

    def _remove_batches(self, before: float) -> int:
        """Delete batches created before a cutoff that have no fit left; return their number."""
        has_fit = exists().where(FitRow.batch_id == BatchRow.id)
        statement = delete(BatchRow).where(BatchRow.created_at < before, ~has_fit)
        with self._database.writing() as session:
            return len(session.scalars(statement.returning(BatchRow.id), **_UNSYNCHRONISED).all())

    def _remove_runs(self, before: float) -> int:
        with self._database.reading() as session:
            query = select(RunRow.id).where(*_is_old(before)).order_by(RunRow.created_at)
            ids = session.scalars(query).all()
        total = 0
        for some in portions(ids, _RUNS_AT_ONCE):
            with self._database.writing() as session:
                removed = _remove_old_runs(session, some, before)
            for run_id in removed:
                self._storage.remove_run(run_id)
            total += len(removed)
        # Uploads that were never confirmed as runs.
        unconfirmed = delete(PendingRow).where(PendingRow.created_at < before)
        with self._database.writing() as session:
            statement = unconfirmed.returning(PendingRow.id)
            pending = session.scalars(statement, **_UNSYNCHRONISED).all()
        for run_id in pending:
            self._storage.remove_run(run_id)
        return total + len(pending)

    def _sweep_files(self, now: float) -> int:
        with self._database.reading() as session:
            known_runs, known_fits = runs.all_ids(session), fits.all_ids(session)
        return self._storage.sweep(known_runs, known_fits, now)


def _old_fits(session: Session, before: float) -> Sequence[str]:
    """IDs of the fits that have expired at a cutoff time, in order of their ends.

    An ended fit never starts again and a batch never gains fits, so an expired fit stays expired.
    """
    # Evaluate this subquery once.  A subquery per fit would read the other fits of its batch up to
    # a thousand times.
    young = select(FitRow.batch_id).where(
        FitRow.batch_id.is_not(None), or_(FitRow.ended_at.is_(None), FitRow.ended_at >= before)
    )
    query = (
        select(FitRow.id)
        .where(
            FitRow.status.in_(ENDED),
            FitRow.ended_at < before,
            or_(FitRow.batch_id.is_(None), FitRow.batch_id.not_in(young)),
        )
        .order_by(FitRow.ended_at)
    )
    return session.scalars(query).all()


def _remove_old_runs(session: Session, run_ids: Sequence[str], before: float) -> Sequence[str]:
    """Delete those of the given runs that are still expired; return their IDs."""
    query = select(RunRow.id).where(RunRow.id.in_(run_ids)).with_for_update(skip_locked=True)
    ids = session.scalars(query).all()
    # Check again now that the rows are locked: a new fit may have named one of the runs.
    statement = delete(RunRow).where(RunRow.id.in_(ids), *_is_old(before)).returning(RunRow.id)
    return session.scalars(statement, **_UNSYNCHRONISED).all()


def _is_old(before: float) -> tuple[ColumnElement[bool], ...]:
    is_named = exists().where(FitRunRow.run_id == RunRow.id)
    return func.coalesce(RunRow.sent_at, RunRow.created_at) < before, ~is_named
