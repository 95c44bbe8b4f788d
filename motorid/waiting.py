"""Waiting for what takes minutes: looking again and again, ever less often."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

from motorid.errors import Busy, Unreachable, WaitedTooLong
from motorid.things import Batch, Fit
from motorid.transport import pause_s

__all__ = ["Tell", "until_cancelled", "until_ended"]

Tell = Callable[[str, float], None]
"""Told what is being done and the share of the whole that is done."""

_FIRST_LOOK_S = 0.1
_SLOWEST_LOOK_S = 2.0
_MOST_TRIES = 5

_Waited = TypeVar("_Waited", Fit, Batch)


def until_ended(
    look: Callable[[], _Waited],
    told: Callable[[_Waited], tuple[str, float]],
    timeout_s: float | None,
    progress: Tell | None,
) -> _Waited:
    """What `look` shows once it has ended.

    Args:
        look: Asks the service.
        told: What to say of it.
        timeout_s: Longest time to wait [s]; None for as long as it takes.
        progress: Told whenever that changes.

    Raises:
        WaitedTooLong: The time is over.
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
                f"{now.id} is {now.status} after {timeout_s:g} s; it goes on, and can be waited "
                "for again by its id"
            )
        time.sleep(min(pause, left))
        pause = min(1.3 * pause, _SLOWEST_LOOK_S)


def until_cancelled(look: Callable[[], _Waited], cancel: Callable[[], None]) -> _Waited:
    """What `look` shows once it has ended, by itself or because it was cancelled.

    Args:
        look: Asks the service.
        cancel: Cancels once.  Where its answer is lost, the next look tells whether it came.

    Raises:
        Unreachable: There was no answer.
        Busy: The service cannot answer now.
    """
    tried = 0
    while not (now := look()).has_ended:
        tried += 1
        try:
            cancel()
        except (Unreachable, Busy):
            if tried == _MOST_TRIES:
                raise
        # A batch ends fit by fit; a look right behind the call may still see one that runs.
        time.sleep(0.0 if tried == 1 else pause_s(tried))
    return now
