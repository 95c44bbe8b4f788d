"""Start of attempts: claim the next fit from the queue and start it on the engine.

A fit that cannot be started does not block the others.  A resource shortage of the machine
(processes, file descriptors, disk space) does not count against the fit, which waits until the
shortage ends.  Any other error counts, and after three of them the fit fails with the reason.
"""

from __future__ import annotations

import dataclasses
import errno
import logging
from collections import Counter
from pathlib import Path
from typing import Final

from app.disk import is_full
from app.fits.engine import AbstractEngine, AbstractRunning
from app.fits.job import FitJob
from app.fits.queue import Claim, FitQueue

__all__ = ["CannotStart", "Starter"]

_MOST_REFUSALS = 3
_SHORTAGES: Final = (
    *(errno.EAGAIN, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ETOOMANYREFS),
    *(errno.EIO, errno.EROFS, errno.ESTALE, errno.EPIPE, errno.ECONNRESET),
    None,  # errors of an engine itself, for example without a connection
)
_REFUSALS = (OSError, ValueError, TypeError, RuntimeError, MemoryError)
_log = logging.getLogger(__name__)


class CannotStart(Exception):
    """A resource shortage prevents the start of any fit."""


class Starter:
    """Component that starts queued fits one after the other."""

    def __init__(self, queue: FitQueue, engine: AbstractEngine) -> None:
        self._queue = queue
        self._engine = engine
        self._refusals: Counter[str] = Counter()

    def start(self, running: int) -> tuple[Claim, AbstractRunning] | None:
        """Start the fit that has waited longest, skipping those that cannot be started now.

        Raises:
            CannotStart: A resource shortage prevents the start of any fit.
        """
        # Count up to the capacity only, which bounds the number of fits that can run in parallel.
        waiting = self._queue.waiting(self._engine.capacity())
        if not waiting:
            return None
        threads = self._engine.threads(running + waiting)
        while (claim := self._queue.claim(running=running)) is not None:
            try:
                Path(claim.job.directory).mkdir(parents=True, exist_ok=True)
                started = self._engine.start(dataclasses.replace(claim.job, threads=threads))
            except _REFUSALS as error:
                _log.exception("a fit could not be started", extra={"fit": claim.job.fit_id})
                self._refused(claim.job, error)
                continue
            del self._refusals[claim.job.fit_id]
            return claim, started
        return None

    def _refused(self, job: FitJob, error: Exception) -> None:
        self._queue.postpone(job.fit_id)
        if _is_shortage(error):
            self._queue.put_back(job.fit_id, job.attempt, attempt=job.attempt - 1)
            raise CannotStart from error
        self._refusals[job.fit_id] += 1
        times = self._refusals[job.fit_id]
        if times < _MOST_REFUSALS:
            self._queue.put_back(job.fit_id, job.attempt, attempt=job.attempt - 1)
            return
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        detail = f"the process could not be started in {times} attempts; last error: {reason[:300]}"
        self._queue.give_up(job.fit_id, job.attempt, {"code": "start", "detail": detail})
        del self._refusals[job.fit_id]


def _is_shortage(error: Exception) -> bool:
    """Return True for a resource shortage, which any other fit would meet as well."""
    if not isinstance(error, OSError):
        return isinstance(error, MemoryError)
    return error.errno in _SHORTAGES or isinstance(error, TimeoutError) or is_full(error)
