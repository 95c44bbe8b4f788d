"""Housekeeping thread: periodic work outside the requests.

At least every minute the thread stores when keys were last used; every `sweep_s` seconds it removes
expired data.

Expiry depends on the wall clock, and a clock that jumps a year ahead would make everything expire.
The thread therefore compares the wall clock with the monotonic clock.  After a difference of more
than 30 s it removes nothing for a day, in which an operator or NTP can correct the clock.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from sqlalchemy.exc import SQLAlchemyError

from app.access.service import AccessService
from app.retention.service import Retention

__all__ = ["Housekeeper"]

_LOOK_S = 60.0
_LARGEST_DRIFT_S = 30.0
_CALM_S = 86_400.0
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
