"""Number of threads of a calculation: the number of cores, unless limited.

Several calculations on one machine share its cores.  The process that starts them knows their
number and sets the limit of each.
"""

from __future__ import annotations

import os
from contextlib import AbstractContextManager

from threadpoolctl import threadpool_limits

__all__ = ["cores", "repeatable_algebra", "threads", "use_threads"]

_told: int | None = None


def cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def threads() -> int:
    """Number of threads of a calculation in this process."""
    return _told or cores()


def use_threads(most: int) -> None:
    """Limit the threads, at least one, of all calculations in this process from now on."""
    global _told  # noqa: PLW0603  the limit is per process
    if most < 1:
        raise ValueError(f"most is {most}; expected at least one thread")
    _told = most


def repeatable_algebra() -> AbstractContextManager[object]:
    """Limit linear algebra to one thread; the last digit of its sums depends on the thread count.

    The simulation loops keep all threads, since each lane is computed by one of them alone.
    """
    limits: AbstractContextManager[object] = threadpool_limits(1, user_api="blas")
    return limits
