"""Fit queue in the database: claims with leases, requeueing, takeover from dead servers.

The queue is first in, first out, but skips postponed fits, so that no fit blocks the others.

A server holds a fit by a lease, which it renews.  A place is a machine with a data directory.
Only one server runs there at a time, and its name begins with that of the place.  A new server
therefore takes over all fits of its predecessor at once, and fits of other places only after their
lease has expired.
"""

from __future__ import annotations

import functools
import logging
import secrets
import time
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Literal

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.database import Database
from app.fits import repository
from app.fits.job import FitJob, RunFile
from app.settings import Settings
from app.storage import Storage
from app.tables import FitRow, FitRunRow, RunRow

__all__ = ["Claim", "FitQueue"]

_SUSPECT_INTERRUPTIONS = 10
_MOST_INTERRUPTIONS = 50
_MOST_PASSED = 500
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Claim:
    """A fit that this server has claimed."""

    job: FitJob
    """The next attempt at the fit."""
    failures: int
    """Number of earlier attempts that crashed."""
    is_alone: bool
    """Whether the fit must run alone, since it may be the cause of server kills."""


class FitQueue:
    """Queue of fits as seen by one server; the data directory also names this place."""

    def __init__(self, database: Database, storage: Storage, settings: Settings) -> None:
        self._database = database
        self._storage = storage
        self._settings = settings

    @functools.cached_property
    def _owner(self) -> str:
        return f"{self._storage.place}/{secrets.token_hex(8)}"

    def lease(self) -> float:
        """End of a lease that is renewed now [s since 1970]."""
        return time.time() + self._settings.lease_s

    def held(self) -> dict[tuple[str, int], int]:
        """Number of failed attempts of the fits that this server holds, by fit ID and attempt."""
        with self._database.reading() as session:
            query = select(FitRow.id, FitRow.attempt, FitRow.failures)
            held = session.execute(query.filter_by(status="running", owner=self._owner))
            return {(fit_id, attempt): failures for fit_id, attempt, failures in held}

    def has_ended(self, fit_id: str) -> bool:
        """Return True if a fit is in a final state or was deleted."""
        with self._database.reading() as session:
            status = session.scalars(select(FitRow.status).filter_by(id=fit_id)).one_or_none()
        return status in (None, *repository.ENDED)

    def waiting(self, most: int) -> int:
        """Number of queued fits, counted up to a maximum."""
        with self._database.reading() as session:
            query = select(FitRow.id).where(FitRow.status == "queued").limit(most)
            return len(session.scalars(query).all())

    def claim(self, without: Collection[str] = (), *, running: int = 0) -> Claim | None:
        """Claim the fit that has waited longest; None if none waits or it must wait to run alone.

        If a fit's server was killed ten times while it ran, the fit may be the cause.  It is then
        started alone, so that further kills count against no other fit.
        """
        passed = list(without)[:_MOST_PASSED]
        while True:
            # Read first: most polls find nothing, and a write would block other writers.
            with self._database.reading() as session:
                row = repository.next_queued(session, without=passed)
                if row is None or (running and _is_suspect(row)):
                    return None
            with self._database.writing() as session:
                row = repository.next_queued(session, without=passed, lock=True)
                if row is None or (running and _is_suspect(row)):
                    return None
                job = self._job(session, row)
                # If another server was faster, try the next fit.
                if repository.claim(session, row, self._owner, time.time(), self.lease()):
                    return Claim(job, row.failures, _is_suspect(row))

    def unclaim(self, fit_id: str, attempt: int) -> None:
        """Requeue a fit whose attempt could not be started; the attempt is not counted."""
        with self._database.writing() as session:
            repository.put_back(session, fit_id, attempt, attempt=attempt - 1)

    def put_back(self, fit_id: str, attempt: int, failures: int) -> None:
        """Requeue a fit after an attempt without a result."""
        with self._database.writing() as session:
            repository.put_back(session, fit_id, attempt, failures=failures)

    def give_up(self, fit_id: str, attempt: int, error: dict[str, Any]) -> bool:
        """End a fit as failed and delete its files; return False if the attempt is not current."""
        with self._database.writing() as session:
            is_ours = repository.finish(
                session, fit_id, attempt, status="failed", now=time.time(), error=error
            )
        if is_ours:
            self._storage.remove_fit(fit_id)
        return is_ours

    def take_over(self) -> None:
        """Requeue the fits of dead servers; give up a fit during which too many servers died."""
        with self._database.reading() as session:
            rows = repository.expired(
                session, place=self._storage.place, owner=self._owner, now=time.time()
            )
        for row in rows:
            if row.interruptions >= _MOST_INTERRUPTIONS:
                detail = f"the service was killed {row.interruptions} times during the fit"
                self.give_up(row.id, row.attempt, {"code": "interrupted", "detail": detail})
                continue
            with self._database.writing() as session:
                kills = FitRow.interruptions + 1
                repository.put_back(session, row.id, row.attempt, interruptions=kills)
            _log.warning("fit taken over", extra={"fit": row.id, "attempt": row.attempt})

    def _job(self, session: Session, row: FitRow) -> FitJob:
        attempt = row.attempt + 1

        def files(role: Literal["training", "validation"]) -> tuple[RunFile, ...]:
            query = select(RunRow).join(FitRunRow, FitRunRow.run_id == RunRow.id)
            query = query.where(FitRunRow.fit_id == row.id, FitRunRow.role == role)
            return tuple(
                RunFile(str(self._storage.run(run.id)), run.file, run.mapping, run.sha256)
                for run in session.scalars(query.order_by(FitRunRow.position))
            )

        return FitJob(
            fit_id=row.id,
            attempt=attempt,
            directory=str(self._storage.attempt(row.id, attempt)),
            training=files("training"),
            validation=files("validation"),
            options=row.options,
            pipeline=self._settings.pipeline,
            checkpoint_s=self._settings.checkpoint_s,
            motor=row.motor or "",
        )


def _is_suspect(row: FitRow) -> bool:
    return row.interruptions >= _SUSPECT_INTERRUPTIONS
