"""Fits that are passed over for some time after they could not be begun or were interrupted."""

from __future__ import annotations

import random
import time

__all__ = ["Postponed"]

_FIRST_PAUSE_S = 0.5
_LONGEST_PAUSE_S = 10.0
_FORGOTTEN_S = 3600.0


class Postponed:
    """Pauses of fits, each about twice as long as the one before.

    A pause is drawn at random around its length, so that fits which were interrupted together are
    not begun together again: one of them may be the cause.
    """

    def __init__(self) -> None:
        self._times: dict[str, int] = {}
        self._until: dict[str, float] = {}

    def postpone(self, fit_id: str, *, free: int = 0) -> int:
        """Begin a pause.

        Args:
            fit_id: The fit.
            free: How many times there is no pause at first.

        Returns:
            How often the fit was postponed in a row.
        """
        times = self._times[fit_id] = self._times.get(fit_id, 0) + 1
        doublings = min(times - 1 - free, 10)
        pause = 0.0 if doublings < 0 else min(_LONGEST_PAUSE_S, _FIRST_PAUSE_S * 2.0**doublings)
        self._until[fit_id] = time.monotonic() + pause * random.uniform(0.5, 1.0)
        return times

    def forget(self, fit_id: str) -> None:
        """End the row of a fit."""
        self._times.pop(fit_id, None)
        self._until.pop(fit_id, None)

    def now(self) -> list[str]:
        """Ids of fits whose pause has not ended."""
        moment = time.monotonic()
        # Those that another server has ended are not heard of again.
        for fit_id in [f for f, until in self._until.items() if until < moment - _FORGOTTEN_S]:
            self.forget(fit_id)
        return [fit_id for fit_id, until in self._until.items() if until > moment]
