"""Retention sweep: deletes expired rows, and files without a row.

Rows are deleted before their files.  If the service ends between the two, a later sweep finds the
files without a row.
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass

from app.database import Database, portions
from app.fits import repository as fits
from app.metrics import Metrics
from app.retention import repository
from app.runs import repository as runs
from app.storage import Storage

__all__ = ["Removed", "Retention"]

# Deleting a fit also deletes the rows of its runs, of which it may have 400.
_FITS_AT_ONCE = 25
_RUNS_AT_ONCE = 200
_DAY_S = 86_400.0
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Removed:
    """Number of deleted items.

    Args:
        fits: Ended fits.
        runs: Runs that no fit named, and uploads never confirmed as runs.
        batches: Batches without fits.
        files: Files and directories without a row.
    """

    fits: int = 0
    runs: int = 0
    batches: int = 0
    files: int = 0


class Retention:
    """Removal of expired data from the database and the data directory.

    Args:
        database: Database of the service.
        storage: Data directory.
        metrics: Counters of deletions.
        days: Age at which fits and runs expire [days]; 0 keeps them.
    """

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
            ids = repository.old_fits(session, before)
        for some in portions(ids, _FITS_AT_ONCE):
            with self._database.writing() as session:
                repository.remove_fits(session, some)
            for fit_id in some:
                self._storage.remove_fit(fit_id)
        return len(ids)

    def _remove_batches(self, before: float) -> int:
        with self._database.writing() as session:
            return repository.remove_old_batches(session, before)

    def _remove_runs(self, before: float) -> int:
        with self._database.reading() as session:
            ids = repository.old_runs(session, before)
        total = 0
        for some in portions(ids, _RUNS_AT_ONCE):
            with self._database.writing() as session:
                removed = repository.remove_old_runs(session, some, before)
            for run_id in removed:
                self._storage.remove_run(run_id)
            total += len(removed)
        with self._database.writing() as session:
            pending = repository.remove_old_pending(session, before)
        for run_id in pending:
            self._storage.remove_run(run_id)
        return total + len(pending)

    def _sweep_files(self, now: float) -> int:
        with self._database.reading() as session:
            known_runs, known_fits = runs.all_ids(session), fits.all_ids(session)
        return self._storage.sweep(known_runs, known_fits, now)
