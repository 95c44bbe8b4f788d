"""Exponential backoff with jitter for fits that could not be started or were interrupted."""

from __future__ import annotations

import random
import time

__all__ = ["Postponed"]

_FIRST_PAUSE_S = 0.5
_LONGEST_PAUSE_S = 10.0
_FORGOTTEN_S = 3600.0


class Postponed:
    """Backoff delays of fits; each delay is about twice the previous one.

    Delays are random, so fits that were interrupted together do not start together again: one of
    them may have caused the interruption.
    """

    def __init__(self) -> None:
        self._times: dict[str, int] = {}
        self._until: dict[str, float] = {}

    def postpone(self, fit_id: str, *, free: int = 0) -> int:
        """Start a delay.

        Args:
            fit_id: ID of the fit.
            free: Number of initial postponements without a delay.

        Returns:
            Number of consecutive postponements of the fit.
        """
        times = self._times[fit_id] = self._times.get(fit_id, 0) + 1
        doublings = min(times - 1 - free, 10)
        pause = 0.0 if doublings < 0 else min(_LONGEST_PAUSE_S, _FIRST_PAUSE_S * 2.0**doublings)
        self._until[fit_id] = time.monotonic() + pause * random.uniform(0.5, 1.0)
        return times

    def forget(self, fit_id: str) -> None:
        """Reset the backoff of a fit."""
        self._times.pop(fit_id, None)
        self._until.pop(fit_id, None)

    def now(self) -> list[str]:
        """IDs of the fits whose delay has not ended."""
        moment = time.monotonic()
        # Drop old entries: a fit that another server has ended is never reset here.
        for fit_id in [f for f, until in self._until.items() if until < moment - _FORGOTTEN_S]:
            self.forget(fit_id)
        return [fit_id for fit_id, until in self._until.items() if until > moment]
