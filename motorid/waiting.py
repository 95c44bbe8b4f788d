"""Polling of fits and batches with increasing intervals."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

from motorid.errors import WaitedTooLong
from motorid.things import Batch, FitState

__all__ = ["Tell", "until_ended"]

Tell = Callable[[str, float], None]
"""Progress callback with the current stage and the completed fraction."""

_FIRST_LOOK_S = 0.1
_SLOWEST_LOOK_S = 2.0

_Waited = TypeVar("_Waited", FitState, Batch)


def until_ended(
    look: Callable[[], _Waited],
    told: Callable[[_Waited], tuple[str, float]],
    timeout_s: float | None,
    progress: Tell | None,
) -> _Waited:
    """Poll a fit or a batch until it has ended, and return it.

    Args:
        look: Function that requests the current state.
        told: Function that returns the stage and the fraction of a state.
        timeout_s: Time limit [s]; None for no limit.
        progress: Called when stage or fraction change.

    Raises:
        WaitedTooLong: The time limit is exceeded.
    """
    began = time.monotonic()
    pause = _FIRST_LOOK_S
    before: tuple[str, float] | None = None
    while True:
        now = look()
        if progress and told(now) != before:
            before = told(now)
            progress(*before)
        if now.has_ended:
            return now
        left = pause if timeout_s is None else began + timeout_s - time.monotonic()
        if left <= 0.0:
            raise WaitedTooLong(
                f"{now.id} is {now.status} after {timeout_s:g} s; it continues at "
                "the service; wait for it again by its id"
            )
        time.sleep(min(pause, left))
        pause = min(1.3 * pause, _SLOWEST_LOOK_S)
