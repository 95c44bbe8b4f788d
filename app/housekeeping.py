"""Housekeeping: a thread for periodic work outside the requests, and removal of expired data.

At least every minute the thread stores when keys were last used; every `sweep_s` seconds it removes
expired data.

Expiry depends on the wall clock, and a clock that jumps a year ahead would make everything expire.
The thread therefore compares the wall clock with the monotonic clock.  After a difference of more
than 30 s it removes nothing for a day, in which an operator or NTP can correct the clock.

Expired rows are searched for in read transactions, which block no writer, and are deleted in
portions.  Rows are deleted before their files.  If the service ends between the two, a later sweep
finds the files without a row.

A fit has expired if it ended before a cutoff time.  A fit of a batch has expired only if the whole
batch has, so that a batch is deleted as a whole.  A run has expired if its latest upload was before
the cutoff and no fit names it.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from sqlalchemy import ColumnElement, delete, exists, func, or_, select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from app.access.service import AccessService
from app.database import Database, portions
from app.fits.repository import ENDED
from app.metrics import Metrics
from app.storage import Storage
from app.tables import BatchRow, FitRow, FitRunRow, PendingRow, RunRow

__all__ = ["Housekeeper", "Retention"]

_LOOK_S = 60.0
_LARGEST_DRIFT_S = 30.0
_CALM_S = 86_400.0
# Deleting a fit also deletes the rows of its runs, of which it may have 400.
_FITS_AT_ONCE = 25
_RUNS_AT_ONCE = 200
_DAY_S = 86_400.0
_UNSYNCHRONISED: dict[str, Any] = {"execution_options": {"synchronize_session": False}}
_log = logging.getLogger(__name__)


class Housekeeper:
    """Thread that removes expired data every `sweep_s` seconds and writes deferred updates."""

    def __init__(self, access: AccessService, retention: Retention, sweep_s: float) -> None:
        self._access = access
        self._retention = retention
        self._sweep_s = sweep_s
        self._clocks = (time.time(), time.monotonic())
        self._next_sweep = time.monotonic() + sweep_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="housekeeper", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Write the outstanding updates and end the thread."""
        self._stop.set()
        self._thread.join()

    def turn(self) -> None:
        """Do the work that is due."""
        self._access.write_uses()
        self._watch_the_clock()
        if time.monotonic() >= self._next_sweep:
            self._next_sweep = time.monotonic() + self._sweep_s
            self._retention.sweep(self._clocks[0])

    def _watch_the_clock(self) -> None:
        wall, steady = self._clocks
        self._clocks = (time.time(), time.monotonic())
        jump = (self._clocks[0] - wall) - (self._clocks[1] - steady)
        if abs(jump) > _LARGEST_DRIFT_S:
            self._next_sweep = self._clocks[1] + max(_CALM_S, self._sweep_s)
            _log.warning(
                "the clock jumped; nothing old is removed for a day",
                extra={"seconds": round(jump, 1)},
            )

    def _run(self) -> None:
        while not self._stop.wait(min(_LOOK_S, self._sweep_s)):
            self._try(self.turn)
        self._try(self._access.write_uses)

    def _try(self, work: Callable[[], None]) -> None:
        try:
            work()
        except (SQLAlchemyError, OSError, ValueError):
            # Not urgent: the next turn retries.  ValueError: a row with an invalid id.
            _log.exception("housekeeping has to wait")


class Retention:
    """Removal of expired data; 0 days keep them."""

    def __init__(self, database: Database, storage: Storage, metrics: Metrics, days: float) -> None:
        self._database = database
        self._storage = storage
        self._metrics = metrics
        self._days = days

    def sweep(self, now: float | None = None) -> dict[str, int]:
        """Delete expired items; return the number of each kind of which there were any.

        The kinds are `fits`, `batches`, `runs` (uploads never confirmed as runs included), and
        `files` without a row.
        """
        now = time.time() if now is None else now
        found = {"files": self._sweep_files(now)}
        if self._days:
            before = now - self._days * _DAY_S
            found["fits"] = self._remove_fits(before)
            found["batches"] = self._remove_batches(before)
            found["runs"] = self._remove_runs(before)
        removed = {kind: number for kind, number in found.items() if number}
        for kind, number in removed.items():
            self._metrics.removed.labels(kind).inc(number)
        if removed:
            _log.info("old things were removed", extra=removed)
        return removed

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
            fits, runs, pending = (
                set(session.scalars(select(table.id))) for table in (FitRow, RunRow, PendingRow)
            )
        return self._storage.sweep(runs | pending, fits, now)


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
