"""Housekeeping: a thread that does, now and then, what no call should wait for.

Every minute it writes down when keys were used; every `sweep_s` seconds it removes what is old.

What is old is told by the wall clock, and a clock that jumps a year ahead would make everything
old.  So each look compares the wall clock with one that never jumps; after a difference nothing is
removed for a day, in which an operator or the network's time can set it right.
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
    """Removes what is old and writes down what can wait.

    Args:
        access: Keys, whose uses are written down.
        retention: Removes what is old.
        sweep_s: Interval in which it is asked to [s].
    """

    def __init__(self, access: AccessService, retention: Retention, sweep_s: float) -> None:
        self._access = access
        self._retention = retention
        self._sweep_s = sweep_s
        self._clocks = (time.time(), time.monotonic())
        self._next_sweep = time.monotonic() + sweep_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="housekeeper", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """Write down what is left to write, and end."""
        self._stop.set()
        self._thread.join()

    def turn(self) -> None:
        """Do what is due."""
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
            # Nothing of this is urgent: the next look tries again, past a row with a bad id, too.
            _log.exception("housekeeping has to wait")
