"""Fit queue in the database: claims with leases, requeueing, takeover from dead servers.

The queue is first in, first out, but skips postponed fits, so that no fit blocks the others.

A server holds a fit by a lease, which it renews.  A place is a machine with a data directory.
Only one server runs there at a time, and its name begins with that of the place.  A new server
therefore takes over all fits of its predecessor at once, and fits of other places only after their
lease has expired.

Every update of a running fit is conditional on the attempt number (optimistic locking), so a slow
process whose attempt was replaced cannot overwrite the state of its successor.
"""

from __future__ import annotations

import functools
import logging
import secrets
import time
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Literal

from sqlalchemy import ColumnElement, func, or_, select
from sqlalchemy.orm import Session

from app.database import Database
from app.fits.job import FitJob, RunFile
from app.fits.repository import ENDED, RELEASED, changed
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

    def held(self) -> set[tuple[str, int]]:
        """Fit ID and attempt of the fits that this server holds."""
        query = select(FitRow.id, FitRow.attempt).filter_by(status="running", owner=self._owner)
        with self._database.reading() as session:
            return {(fit_id, attempt) for fit_id, attempt in session.execute(query)}

    def has_ended(self, fit_id: str) -> bool:
        """Return True if a fit is in a final state or was deleted."""
        with self._database.reading() as session:
            status = session.scalars(select(FitRow.status).filter_by(id=fit_id)).one_or_none()
        return status in (None, *ENDED)

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
        query = select(FitRow).where(FitRow.status == "queued", FitRow.id.not_in(passed)).limit(1)
        query = query.order_by(FitRow.created_at, FitRow.position, FitRow.id)
        while True:
            # Read first: most polls find nothing, and a write would block other writers.
            with self._database.reading() as session:
                row = session.scalars(query).one_or_none()
                if row is None or (running and _is_suspect(row)):
                    return None
            with self._database.writing() as session:
                # Rows that another server has locked are skipped.
                row = session.scalars(query.with_for_update(skip_locked=True)).one_or_none()
                if row is None or (running and _is_suspect(row)):
                    return None
                job = self._job(session, row)
                is_ours = changed(
                    session,
                    FitRow.id == row.id,
                    FitRow.attempt == row.attempt,
                    FitRow.status == "queued",
                    status="running",
                    stage="starting",
                    fraction=0.0,
                    attempt=job.attempt,
                    owner=self._owner,
                    lease_until=self._lease(),
                    started_at=func.coalesce(FitRow.started_at, time.time()),
                )
                # If another server was faster, try the next fit.
                if is_ours:
                    return Claim(job, row.failures, _is_suspect(row))

    def renew(self, fit_id: str, attempt: int, progress: dict[str, Any]) -> bool:
        """Renew the lease of an attempt and store its progress; return False if not current."""
        step = 1 if progress else 0
        with self._database.writing() as session:
            current = _current(fit_id, attempt)
            return 0 < changed(session, *current, step=step, lease_until=self._lease(), **progress)

    def put_back(self, fit_id: str, attempt: int, /, **changes: Any) -> bool:
        """Requeue a fit after an attempt without a result; return False if it is not current.

        `changes` are values of further columns.
        """
        values = RELEASED | {"status": "queued", "stage": "queued", "fraction": 0.0} | changes
        with self._database.writing() as session:
            return 0 < changed(session, *_current(fit_id, attempt), **values)

    def finish(
        self, fit_id: str, attempt: int, status: str, error: dict[str, Any] | None = None
    ) -> bool:
        """End a fit with the outcome of an attempt; return False if the attempt is not current.

        The call is idempotent, so a commit whose confirmation was lost can be repeated.
        """
        values: dict[str, Any] = {"status": status, "error": error, "ended_at": time.time()}
        if status == "succeeded":
            values |= {"stage": "done", "fraction": 1.0}
        same = select(FitRow.id).filter_by(id=fit_id, attempt=attempt, status=status)
        with self._database.writing() as session:
            is_done = changed(session, *_current(fit_id, attempt), **values, **RELEASED)
            return bool(is_done) or session.scalars(same).one_or_none() is not None

    def give_up(self, fit_id: str, attempt: int, error: dict[str, Any]) -> bool:
        """End a fit as failed and delete its files; return False if the attempt is not current."""
        is_ours = self.finish(fit_id, attempt, "failed", error)
        if is_ours:
            self._storage.remove_fit(fit_id)
        return is_ours

    def take_over(self) -> None:
        """Requeue the fits of dead servers; give up a fit during which too many servers died."""
        is_former = FitRow.owner.startswith(f"{self._storage.place}/", autoescape=True)
        query = select(FitRow).where(
            FitRow.status == "running",
            FitRow.owner != self._owner,
            or_(FitRow.lease_until < time.time(), is_former),
        )
        with self._database.reading() as session:
            rows = session.scalars(query).all()
        for row in rows:
            if row.interruptions >= _MOST_INTERRUPTIONS:
                detail = f"the service was killed {row.interruptions} times during the fit"
                self.give_up(row.id, row.attempt, {"code": "interrupted", "detail": detail})
                continue
            self.put_back(row.id, row.attempt, interruptions=FitRow.interruptions + 1)
            _log.warning("fit taken over", extra={"fit": row.id, "attempt": row.attempt})

    def _lease(self) -> float:
        """End of a lease that is renewed now [s since 1970]."""
        return time.time() + self._settings.lease_s

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


def _current(fit_id: str, attempt: int) -> tuple[ColumnElement[bool], ...]:
    """Conditions for an attempt that runs and was not replaced."""
    return FitRow.id == fit_id, FitRow.attempt == attempt, FitRow.status == "running"
