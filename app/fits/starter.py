"""Start of attempts: takes the next fit from the queue and has the engine begin it.

A fit that cannot be started keeps no other waiting.  A shortage of the machine (no process, no
descriptor, no space) is no fault of the fit, which waits for as long as it lasts; any other refusal
is counted, and after a few of them the fit has failed with the reason.
"""

from __future__ import annotations

import dataclasses
import errno
import logging
from collections import Counter
from pathlib import Path
from typing import Final

from app.fits.engine import AbstractEngine, AbstractRunning
from app.fits.job import Job
from app.fits.postponed import Postponed
from app.fits.queue import Claim, FitQueue
from app.space import is_full

__all__ = ["CannotStart", "Starter"]

_MOST_REFUSALS = 3
_SHORTAGES: Final = (
    *(errno.EAGAIN, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ETOOMANYREFS),
    *(errno.EIO, errno.EROFS, errno.ESTALE, errno.EPIPE, errno.ECONNRESET),
    None,  # what an engine raises itself, such as one without a connection
)
_REFUSALS = (OSError, ValueError, TypeError, RuntimeError, MemoryError)
_log = logging.getLogger(__name__)


class CannotStart(Exception):
    """The machine has no room for any fit now."""


class Starter:
    """Begins one fit after the other.

    Args:
        queue: Fits that wait.
        engine: What computes.
        postponed: Fits to pass over.
    """

    def __init__(self, queue: FitQueue, engine: AbstractEngine, postponed: Postponed) -> None:
        self._queue = queue
        self._engine = engine
        self._postponed = postponed
        self._refusals: Counter[str] = Counter()

    def start(self, running: int) -> tuple[Claim, AbstractRunning] | None:
        """Begin the fit that waits longest, passing over those that cannot be begun.

        Args:
            running: How many fits run here.

        Returns:
            What was begun, or None where no fit waits that may be begun now.

        Raises:
            CannotStart: Nothing can be begun now.
        """
        # Not all of a long queue is counted: what matters is how many will run at once.
        waiting = self._queue.waiting(self._engine.capacity())
        if not waiting:
            return None
        threads = self._engine.threads(running + waiting)
        while (claim := self._queue.claim(self._postponed.now(), running=running)) is not None:
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

    def _refused(self, job: Job, error: Exception) -> None:
        self._postponed.postpone(job.fit_id)
        if _is_shortage(error):
            self._queue.unclaim(job.fit_id, job.attempt)
            raise CannotStart from error
        self._refusals[job.fit_id] += 1
        times = self._refusals[job.fit_id]
        if times < _MOST_REFUSALS:
            self._queue.unclaim(job.fit_id, job.attempt)
            return
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        detail = f"its process could not be started {times} times, at last with: {reason[:300]}"
        self._queue.give_up(job.fit_id, job.attempt, {"code": "start", "detail": detail})
        self._postponed.forget(job.fit_id)
        del self._refusals[job.fit_id]


def _is_shortage(error: Exception) -> bool:
    """Whether another fit would meet the same error."""
    if not isinstance(error, OSError):
        return isinstance(error, MemoryError)
    return error.errno in _SHORTAGES or isinstance(error, TimeoutError) or is_full(error)
