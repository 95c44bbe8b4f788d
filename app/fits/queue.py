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
import random
import secrets
import time
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
_FIRST_PAUSE_S = 0.5
_LONGEST_PAUSE_S = 10.0
_FORGOTTEN_S = 3600.0
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Claim:
    """A fit that this server has claimed."""

    job: FitJob
    """The next attempt at the fit."""
    failures: int
    """Number of earlier attempts that crashed."""
    is_alone: bool
    """True if the fit must run alone, since it may be the cause of server kills."""


class FitQueue:
    """Queue of fits as seen by one server; the data directory also names this place."""

    def __init__(self, database: Database, storage: Storage, settings: Settings) -> None:
        self._database = database
        self._storage = storage
        self._settings = settings
        self._delays: dict[str, tuple[int, float]] = {}

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

    def claim(self, *, running: int = 0) -> Claim | None:
        """Claim the fit that has waited longest; None if none waits or it must wait to run alone.

        If a fit's server was killed ten times while it ran, the fit may be the cause.  It is then
        started alone, so that further kills count against no other fit.
        """
        query = select(FitRow).where(FitRow.status == "queued", FitRow.id.not_in(self._postponed()))
        query = query.order_by(FitRow.created_at, FitRow.position, FitRow.id).limit(1)
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

    def postpone(self, fit_id: str, *, free: int = 0) -> None:
        """Start a delay before a fit is claimed again; the first `free` ones in a row are zero.

        Delays grow exponentially.  They are random, so fits that were interrupted together do not
        start together again: one of them may have caused the interruption.
        """
        times = self._delays.get(fit_id, (0, 0.0))[0] + 1
        doublings = min(times - 1 - free, 10)
        pause = 0.0 if doublings < 0 else min(_LONGEST_PAUSE_S, _FIRST_PAUSE_S * 2.0**doublings)
        self._delays[fit_id] = times, time.monotonic() + pause * random.uniform(0.5, 1.0)

    def finish(
        self, fit_id: str, attempt: int, status: str, error: dict[str, Any] | None = None
    ) -> bool:
        """End a fit with the outcome of an attempt; return False if the attempt is not current.

        The call is idempotent, so a commit whose confirmation was lost can be repeated.
        """
        values: dict[str, Any] = {"status": status, "error": error, "ended_at": time.time()}
        if status == "succeeded":
            values |= {"stage": "done", "fraction": 1.0}
        self._delays.pop(fit_id, None)
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

    def _postponed(self) -> list[str]:
        """IDs of the fits whose delay has not ended."""
        now = time.monotonic()
        # Drop old entries: a fit that another server has ended is never reset here.
        self._delays = {f: d for f, d in self._delays.items() if d[1] >= now - _FORGOTTEN_S}
        return [f for f, (_, until) in self._delays.items() if until > now][:_MOST_PASSED]

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
