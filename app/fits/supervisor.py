"""Supervisor: claims queued fits, runs them on the engine and records their outcome.

    queued --claim--> running --done--> succeeded
       ^                 |---- reported failure -----------> failed
       +---- crashed ----+---- crashed too often ----------> failed
                         +---- cancelled by a caller ------> cancelled

The supervisor polls in one thread of the server, about ten times a second while fits run.  Every
write is conditional on the attempt number, so a kill of any process at any moment costs at most
repeated work: a fit is computed at least once and ends exactly once.

A crash of the computing process counts against the fit.  The loss of its engine (fork server,
worker) and an orderly shutdown of the server do not count.  A kill of the server counts only if it
happens so often that the fit itself is suspect.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sqlalchemy.exc import SQLAlchemyError

from app.database import Database
from app.fits.engine import LOST, AbstractEngine, AbstractRunning
from app.fits.job import FitJob
from app.fits.queue import Claim, FitQueue
from app.fits.starter import CannotStart, Starter
from app.metrics import Metrics
from app.settings import Settings
from app.storage import Storage

__all__ = ["Attempt", "Supervisor"]

_BUSY_S = 0.1
_IDLE_S = 1.0
_LOOK_S = 0.5
_LONGEST_STAGE = 100
_log = logging.getLogger(__name__)


@dataclass
class Attempt:
    """An attempt that runs under this server."""

    claim: Claim
    running: AbstractRunning
    began: float
    """Time of the start, on the monotonic clock [s]."""
    told: dict[str, Any] = field(default_factory=dict)
    """Fields of all messages so far; a later value replaces an earlier one."""
    news: dict[str, Any] = field(default_factory=dict)
    """Stage and fraction that are not stored yet."""
    renewed: float = 0.0
    """Time of the last renewal of the lease, on the monotonic clock [s]."""

    @property
    def job(self) -> FitJob:
        """The job of the attempt."""
        return self.running.job

    def hear(self, message: dict[str, Any]) -> None:
        """Process a message; ignore progress that the database could not store."""
        self.told |= message
        progress = message.get("progress")
        if not isinstance(progress, dict):
            return
        stage, fraction = progress.get("stage"), progress.get("fraction")
        if isinstance(stage, str) and isinstance(fraction, int | float) and math.isfinite(fraction):
            self.news = {"stage": stage[:_LONGEST_STAGE], "fraction": float(fraction)}


class Supervisor:
    """Supervisor of fits; runs as many in parallel as the engine has capacity for."""

    def __init__(
        self,
        database: Database,
        storage: Storage,
        engine: AbstractEngine,
        settings: Settings,
        metrics: Metrics,
    ) -> None:
        self._storage = storage
        self._engine = engine
        self._settings = settings
        self._metrics = metrics
        self._queue = FitQueue(database, storage, settings)
        self._starter = Starter(self._queue, engine)
        self._attempts: dict[str, Attempt] = {}
        self._looked = 0.0
        self._wake = threading.Event()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="supervisor", daemon=True)

    def start(self) -> None:
        """Start the thread, which also takes over the fits of dead servers."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread; running fits are killed and return to the queue."""
        self._stop.set()
        self._wake.set()
        self._thread.join()

    def wake(self) -> None:
        """Poll at once, since a fit was queued or cancelled."""
        self._looked = 0.0
        self._wake.set()

    @property
    def is_alive(self) -> bool:
        """True if the thread runs."""
        return self._thread.is_alive()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self._turn()
            except (SQLAlchemyError, OSError):
                # Finished work is in the database and the rest is retried; wait for the
                # fault to pass.
                _log.exception("database or operating system error")
                self._stop.wait(_IDLE_S)
            self._wake.wait(_BUSY_S if self._attempts else _IDLE_S)
            self._wake.clear()
        self._release()

    def _turn(self) -> None:
        for attempt in list(self._attempts.values()):
            self._attend(attempt)
        if time.monotonic() - self._looked >= _LOOK_S:
            self._looked = time.monotonic()
            self._compare()
            self._queue.take_over()
        self._metrics.fit_capacity.set(self._engine.capacity())
        while self._has_room() and self._begin():
            pass

    def _attend(self, attempt: Attempt) -> None:
        """Process the messages of an attempt, and conclude the attempt if it has ended."""
        # Read the exit first, so that all messages before it are available below.
        end = attempt.running.exit()
        for message in attempt.running.messages():
            attempt.hear(message)
        if end is not None:
            self._conclude(attempt, end)
        elif time.monotonic() - attempt.began > self._settings.fit_wall_s:
            attempt.running.kill()
            limit = f"{self._settings.fit_wall_s:g} s (MOTORID_FIT_WALL_S)"
            detail = f"the fit exceeded the time limit of {limit}"
            self._fail(attempt, {"code": "time", "detail": detail})
        else:
            self._renew(attempt)

    def _renew(self, attempt: Attempt) -> None:
        elapsed = time.monotonic() - attempt.renewed
        wait = _LOOK_S if attempt.news else self._settings.heartbeat_s
        if elapsed < wait:
            return
        job = attempt.job
        is_ours = self._queue.renew(job.fit_id, job.attempt, attempt.news)
        attempt.renewed = time.monotonic()
        attempt.news = {}
        if not is_ours:
            self._drop(attempt)

    def _conclude(self, attempt: Attempt, end: str) -> None:
        told = attempt.told
        if told.get("done") and (Path(attempt.job.directory) / "result.json").is_file():
            self._succeed(attempt)
        elif "failed" in told:
            self._fail(attempt, told["failed"])
        elif end == LOST:
            self._interrupt(attempt)
        else:
            self._crash(attempt, told.get("crashed", end))

    def _succeed(self, attempt: Attempt) -> None:
        job = attempt.job
        seconds = time.monotonic() - attempt.began
        if self._queue.finish(job.fit_id, job.attempt, "succeeded"):
            self._storage.keep_attempt(job.fit_id, job.attempt)
            self._metrics.fit_seconds.observe(seconds)
            self._close(attempt, "succeeded", seconds=round(seconds, 3))
        else:
            self._drop(attempt)

    def _fail(self, attempt: Attempt, error: dict[str, Any]) -> None:
        job = attempt.job
        if self._queue.give_up(job.fit_id, job.attempt, error):
            self._close(attempt, "failed", reason=error["detail"])
        else:
            self._drop(attempt)

    def _crash(self, attempt: Attempt, end: str) -> None:
        job = attempt.job
        failures = attempt.claim.failures + 1
        self._metrics.fit_attempts_failed.inc()
        _log.warning(
            "an attempt ended without a result",
            extra={
                "fit": job.fit_id,
                "attempt": job.attempt,
                "end": end,
                "printed": attempt.running.log_tail(),
            },
        )
        if failures >= self._settings.max_attempts:
            times = "once" if failures == 1 else f"{failures} times"
            detail = f"the process ended without a result {times}; last cause: {end}"
            self._fail(attempt, {"code": "crashed", "detail": detail})
            return
        self._queue.put_back(job.fit_id, job.attempt, failures=failures)
        self._drop(attempt)

    def _interrupt(self, attempt: Attempt) -> None:
        """Requeue a fit whose engine ended; the fit is not at fault."""
        job = attempt.job
        refused = attempt.told.get("refused")
        _log.warning("an attempt was interrupted", extra={"fit": job.fit_id, "reason": refused})
        # The first interruption causes no delay, but a machine without free processes must not be
        # asked often.
        self._queue.postpone(job.fit_id, free=0 if refused else 1)
        self._queue.put_back(job.fit_id, job.attempt)
        self._drop(attempt)

    def _close(self, attempt: Attempt, status: str, **details: object) -> None:
        attempt.running.kill()
        del self._attempts[attempt.job.fit_id]
        self._metrics.fits_ended.labels(status).inc()
        _log.info(
            f"fit {status}",
            extra={"fit": attempt.job.fit_id, "attempt": attempt.job.attempt} | details,
        )

    def _drop(self, attempt: Attempt) -> None:
        """Kill an attempt that is no longer current, and delete its files."""
        attempt.running.kill()
        self._storage.remove_attempt(attempt.job.fit_id, attempt.job.attempt)
        self._attempts.pop(attempt.job.fit_id, None)

    def _compare(self) -> None:
        """Reconcile the running attempts with those that the database assigns to this server."""
        held = self._queue.held()
        running = {(a.job.fit_id, a.job.attempt): a for a in self._attempts.values()}
        for key, attempt in running.items():
            if key not in held:
                # Cancelled, or taken over by another server.
                self._drop(attempt)
                if self._queue.has_ended(attempt.job.fit_id):
                    self._storage.remove_checkpoints(attempt.job.fit_id)
                _log.info("fit abandoned", extra={"fit": attempt.job.fit_id})
        for fit_id, number in held - running.keys():
            # The fit was claimed, but an error prevented both its start and its return
            # to the queue.
            self._queue.put_back(fit_id, number)
            _log.warning("fit found without a process", extra={"fit": fit_id})

    def _has_room(self) -> bool:
        is_taken = any(attempt.claim.is_alone for attempt in self._attempts.values())
        return len(self._attempts) < self._engine.capacity() and not is_taken

    def _begin(self) -> bool:
        """Start the fit that has waited longest; return False if no fit can be started."""
        try:
            begun = self._starter.start(len(self._attempts))
        except CannotStart:
            # The machine is short of resources, so pause this thread as well.
            self._stop.wait(_IDLE_S)
            return False
        if begun is None:
            return False
        claim, running = begun
        job, now = claim.job, time.monotonic()
        self._attempts[job.fit_id] = Attempt(claim, running, began=now, renewed=now)
        _log.info("fit begun", extra={"fit": job.fit_id, "attempt": job.attempt})
        return True

    def _release(self) -> None:
        """Stop all attempts that run here without counting it against their fits."""
        # Close the engine first: killing one attempt after another could exceed the shutdown time.
        self._engine.close()
        for attempt in list(self._attempts.values()):
            attempt.running.kill()
            job = attempt.job
            try:
                self._queue.put_back(job.fit_id, job.attempt)
            except SQLAlchemyError:
                # The next server takes the fit over when it finds the old lease.
                _log.exception("a fit could not be requeued")
            else:
                _log.info("fit requeued", extra={"fit": job.fit_id, "attempt": job.attempt})
            self._drop(attempt)
