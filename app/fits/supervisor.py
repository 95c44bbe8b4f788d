"""The supervisor: takes fits that wait, has them computed, and writes down what became of them.

    queued --claim--> running --done--> succeeded
       ^                 |---- failed by its own words ----> failed
       +---- crashed ----+---- crashed too often ----------> failed
                         +---- cancelled by a caller ------> cancelled

It runs in one thread of the server and looks around several times a second.  Every write carries
the attempt it speaks of, so whatever is killed, and whenever, the worst is that work is done again:
a fit is computed at least once, and ends exactly once.

A crash of the computing process counts against the fit.  The end of what computes (a fork server,
a worker) does not, nor does an orderly end of the server; a kill of the server does not unless it
happens so often that the fit itself must be suspected.
"""

from __future__ import annotations

import logging
import threading
import time
from pathlib import Path
from typing import Any

from sqlalchemy.exc import SQLAlchemyError

from app.database import Database
from app.fits import repository
from app.fits.attempt import Attempt
from app.fits.engine import LOST, AbstractEngine
from app.fits.postponed import Postponed
from app.fits.queue import FitQueue
from app.fits.starter import CannotStart, Starter
from app.metrics import Metrics
from app.settings import Settings
from app.storage import Storage

__all__ = ["Supervisor"]

_BUSY_S = 0.1
_IDLE_S = 1.0
_LOOK_S = 0.5
_log = logging.getLogger(__name__)


class Supervisor:
    """Keeps as many fits running as the settings say.

    Args:
        database: Where the fits are.
        storage: Where their files are.
        engine: What computes.
        settings: Leases and limits.
        metrics: Where the ends of fits are counted.
    """

    def __init__(
        self,
        database: Database,
        storage: Storage,
        engine: AbstractEngine,
        settings: Settings,
        metrics: Metrics,
    ) -> None:
        self._database = database
        self._storage = storage
        self._engine = engine
        self._settings = settings
        self._metrics = metrics
        self._queue = FitQueue(
            database,
            storage,
            lease_s=settings.lease_s,
            pipeline=settings.pipeline,
            checkpoint_s=settings.checkpoint_s,
        )
        self._postponed = Postponed()
        self._starter = Starter(self._queue, engine, self._postponed)
        self._attempts: dict[str, Attempt] = {}
        self._looked = 0.0
        self._wake = threading.Event()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="supervisor", daemon=True)

    def start(self) -> None:
        """Begin; fits of a server that is gone are taken up."""
        self._thread.start()

    def stop(self) -> None:
        """End: what runs is stopped and waits for the next start."""
        self._stop.set()
        self._wake.set()
        self._thread.join()

    def wake(self) -> None:
        """Look around now: something was queued or cancelled."""
        self._looked = 0.0
        self._wake.set()

    @property
    def is_alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self._turn()
            except (SQLAlchemyError, OSError):
                # What was done is in the tables or will be tried again; only time helps.
                _log.exception("the database or the system refused")
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
        """Hear what an attempt has to tell, and end it if it is over."""
        # Asked first: what was told before the end is then all there.
        end = attempt.running.exit()
        for message in attempt.running.messages():
            attempt.hear(message)
        if end is not None:
            self._conclude(attempt, end)
        elif time.monotonic() - attempt.began > self._settings.fit_wall_s:
            attempt.running.kill()
            limit = f"{self._settings.fit_wall_s:g} s"
            self._fail(attempt, {"code": "time", "detail": f"the fit took more than {limit}"})
        else:
            self._renew(attempt)

    def _renew(self, attempt: Attempt) -> None:
        elapsed = time.monotonic() - attempt.renewed
        wait = _LOOK_S if attempt.news else self._settings.heartbeat_s
        if elapsed < wait:
            return
        job = attempt.job
        with self._database.writing() as session:
            is_ours = repository.renew(
                session,
                job.fit_id,
                job.attempt,
                lease_until=self._queue.lease(),
                progress=attempt.news,
            )
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
        with self._database.writing() as session:
            is_ours = repository.finish(
                session, job.fit_id, job.attempt, status="succeeded", now=time.time()
            )
        if is_ours:
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
        failures = attempt.failures + 1
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
            detail = f"the computation ended without a result {times}, at last with {end}"
            self._fail(attempt, {"code": "crashed", "detail": detail})
            return
        self._queue.put_back(job.fit_id, job.attempt, failures)
        self._drop(attempt)

    def _interrupt(self, attempt: Attempt) -> None:
        """Let a fit wait again whose engine was ended, which is no fault of the fit."""
        job = attempt.job
        refused = attempt.told.get("refused")
        _log.warning("an attempt was interrupted", extra={"fit": job.fit_id, "reason": refused})
        # Once is no reason to wait; a machine that has no process to give shall not be asked often.
        self._postponed.postpone(job.fit_id, free=0 if refused else 1)
        self._queue.put_back(job.fit_id, job.attempt, attempt.failures)
        self._drop(attempt)

    def _close(self, attempt: Attempt, status: str, **details: object) -> None:
        attempt.running.kill()
        del self._attempts[attempt.job.fit_id]
        self._postponed.forget(attempt.job.fit_id)
        self._metrics.fits_ended.labels(status).inc()
        _log.info(
            f"fit {status}",
            extra={"fit": attempt.job.fit_id, "attempt": attempt.job.attempt} | details,
        )

    def _drop(self, attempt: Attempt) -> None:
        """Let an attempt go that counts no longer, and what it left."""
        attempt.running.kill()
        self._storage.remove_attempt(attempt.job.fit_id, attempt.job.attempt)
        self._attempts.pop(attempt.job.fit_id, None)

    def _compare(self) -> None:
        """Bring what runs here and what the tables say runs here together."""
        held = self._queue.held()
        running = {(a.job.fit_id, a.job.attempt): a for a in self._attempts.values()}
        for key, attempt in running.items():
            if key not in held:
                # Cancelled, or taken over by another server.
                self._drop(attempt)
                if self._queue.has_ended(attempt.job.fit_id):
                    self._storage.remove_checkpoints(attempt.job.fit_id)
                _log.info("fit given up", extra={"fit": attempt.job.fit_id})
        for fit_id, number in held.keys() - running.keys():
            # Claimed, and then an error kept it from being started or given back.
            self._queue.put_back(fit_id, number, held[fit_id, number])
            _log.warning("fit found without a process", extra={"fit": fit_id})

    def _has_room(self) -> bool:
        is_taken = any(attempt.is_alone for attempt in self._attempts.values())
        return len(self._attempts) < self._engine.capacity() and not is_taken

    def _begin(self) -> bool:
        """Begin the fit that waits longest; False where none waits or none can be begun."""
        try:
            begun = self._starter.start(len(self._attempts))
        except CannotStart:
            # The machine has no room: the fits wait, and so does this thread.
            self._stop.wait(_IDLE_S)
            return False
        if begun is None:
            return False
        claim, running = begun
        job, now = claim.job, time.monotonic()
        self._attempts[job.fit_id] = Attempt(
            running, began=now, failures=claim.failures, is_alone=claim.is_alone, renewed=now
        )
        _log.info("fit begun", extra={"fit": job.fit_id, "attempt": job.attempt})
        return True

    def _release(self) -> None:
        """End what runs here, without counting it against the fits."""
        # All at once; one after the other could take longer than there is time to stop.
        self._engine.close()
        for attempt in list(self._attempts.values()):
            attempt.running.kill()
            job = attempt.job
            try:
                self._queue.put_back(job.fit_id, job.attempt, attempt.failures)
            except SQLAlchemyError:
                # The next server finds the lease of one that is gone.
                _log.exception("a fit could not be given back")
            else:
                _log.info("fit put back", extra={"fit": job.fit_id, "attempt": job.attempt})
            self._drop(attempt)
