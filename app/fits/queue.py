"""The queue: which fit comes next, and which fall back into it.

    queue.claim()             the next attempt at the fit that waits longest, taken for this server
    queue.put_back(...)       it waits again
    queue.take_over()         so do those of a server that is gone

The fit that waits longest comes next, unless it is passed over: no fit may keep the others waiting.

A server holds a fit by a lease that it renews.  Its name begins with that of its place, a machine
and a data directory, which has one server at a time: whatever a former one held there is free when
the next one starts, and what others hold is not before their lease has ended.
"""

from __future__ import annotations

import functools
import logging
import secrets
import time
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Literal

from sqlalchemy.orm import Session

from app.database import Database
from app.fits import repository, roles
from app.fits.job import Job, RunFile
from app.storage import Storage
from app.tables import FitRow

__all__ = ["Claim", "FitQueue"]

_SUSPECT_INTERRUPTIONS = 10
_MOST_INTERRUPTIONS = 50
_MOST_PASSED = 500
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Claim:
    """A fit that was taken for this server.

    Args:
        job: The next attempt at it.
        failures: How many attempts failed before.
        is_alone: Whether it has to run alone, since it may be what ends its server.
    """

    job: Job
    failures: int
    is_alone: bool


class FitQueue:
    """Fits that wait, as one server sees them.

    Args:
        database: Where the fits are.
        storage: Where their files are, and the name of this place.
        lease_s: How long a fit is held without a heartbeat [s].
        pipeline: Function that computes, as module:function.
        checkpoint_s: Least time between two checkpoints of a fit [s].
    """

    def __init__(
        self,
        database: Database,
        storage: Storage,
        *,
        lease_s: float,
        pipeline: str,
        checkpoint_s: float,
    ) -> None:
        self._database = database
        self._storage = storage
        self._lease_s = lease_s
        self._pipeline = pipeline
        self._checkpoint_s = checkpoint_s

    @functools.cached_property
    def _owner(self) -> str:
        return f"{self._storage.place}/{secrets.token_hex(8)}"

    def lease(self) -> float:
        """Until when a fit is held that is heard of now [s since 1970]."""
        return time.time() + self._lease_s

    def held(self) -> dict[tuple[str, int], int]:
        """Fits and attempts that this server holds, and how many attempts failed before."""
        with self._database.reading() as session:
            return repository.held(session, self._owner)

    def has_ended(self, fit_id: str) -> bool:
        """Whether a fit is in a state that it does not leave, or was removed."""
        with self._database.reading() as session:
            return repository.has_ended(session, fit_id)

    def waiting(self, most: int) -> int:
        """How many fits wait, counted up to a number."""
        with self._database.reading() as session:
            return repository.waiting(session, most)

    def claim(self, without: Collection[str] = (), *, running: int = 0) -> Claim | None:
        """Take the fit that waits longest.

        A fit whose server was killed ten times during it may be the cause.  It is begun alone, so
        that further kills are counted against no other fit.

        Args:
            without: Ids of fits to pass over.
            running: How many fits run here.

        Returns:
            What was taken, or None where no fit waits or the next one must wait to be alone.
        """
        passed = list(without)[:_MOST_PASSED]
        while True:
            # Read first: most looks find nothing, and a write would keep other writers waiting.
            with self._database.reading() as session:
                row = repository.next_queued(session, without=passed)
                if row is None or (running and _is_suspect(row)):
                    return None
            with self._database.writing() as session:
                row = repository.next_queued(session, without=passed, lock=True)
                if row is None or (running and _is_suspect(row)):
                    return None
                job = self._job(session, row)
                # Where another server was faster, the next one is tried.
                if repository.claim(session, row, self._owner, time.time(), self.lease()):
                    return Claim(job, row.failures, _is_suspect(row))

    def unclaim(self, fit_id: str, attempt: int) -> None:
        """Let a fit wait again whose attempt could not be begun; the attempt is not counted.

        Args:
            fit_id: The fit.
            attempt: The attempt that was claimed.
        """
        with self._database.writing() as session:
            repository.unclaim(session, fit_id, attempt)

    def put_back(self, fit_id: str, attempt: int, failures: int) -> None:
        """Let a fit wait again.

        Args:
            fit_id: The fit.
            attempt: The attempt that ended.
            failures: How many attempts failed by themselves.
        """
        with self._database.writing() as session:
            repository.put_back(session, fit_id, attempt, failures=failures)

    def give_up(self, fit_id: str, attempt: int, error: dict[str, Any]) -> bool:
        """End a fit as failed and remove its files; False where the attempt is not the current one.

        Args:
            fit_id: The fit.
            attempt: Its current attempt.
            error: `code` and `detail`.
        """
        with self._database.writing() as session:
            is_ours = repository.finish(
                session, fit_id, attempt, status="failed", now=time.time(), error=error
            )
        if is_ours:
            self._storage.remove_fit(fit_id)
        return is_ours

    def take_over(self) -> None:
        """Let fits wait again whose server is gone, unless that happened too often during one."""
        with self._database.reading() as session:
            rows = repository.expired(
                session, place=self._storage.place, owner=self._owner, now=time.time()
            )
        for row in rows:
            if row.interruptions >= _MOST_INTERRUPTIONS:
                detail = f"the service was killed {row.interruptions} times during it"
                self.give_up(row.id, row.attempt, {"code": "interrupted", "detail": detail})
                continue
            with self._database.writing() as session:
                repository.put_back(
                    session, row.id, row.attempt, failures=row.failures, interruptions=1
                )
            _log.warning("fit taken over", extra={"fit": row.id, "attempt": row.attempt})

    def _job(self, session: Session, row: FitRow) -> Job:
        attempt = row.attempt + 1

        def files(role: Literal["training", "validation"]) -> tuple[RunFile, ...]:
            return tuple(
                RunFile(str(self._storage.run(run.id)), run.file, run.mapping, run.sha256)
                for run in roles.runs_of(session, row.id, role)
            )

        return Job(
            fit_id=row.id,
            attempt=attempt,
            directory=str(self._storage.attempt(row.id, attempt)),
            training=files("training"),
            validation=files("validation"),
            options=row.options,
            pipeline=self._pipeline,
            checkpoint_s=self._checkpoint_s,
        )


def _is_suspect(row: FitRow) -> bool:
    return row.interruptions >= _SUSPECT_INTERRUPTIONS
