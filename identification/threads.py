"""Number of threads of a calculation: as many as there are cores, or as it was told.

Several calculations on one machine share its cores; whoever starts them knows how many they are,
and says it to each.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

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
    """Bound the threads of all calculations in this process from now on.

    Args:
        most: How many; at least 1.
    """
    global _told  # noqa: PLW0603  it is the process that is told
    if most < 1:
        raise ValueError(f"most is {most}; expected at least one thread")
    _told = most


@contextmanager
def repeatable_algebra() -> Iterator[None]:
    """One thread for linear algebra, whose sums else depend in their last digit on the threads.

    The simulation loops keep all threads: each lane is computed by one of them alone.
    """
    with threadpool_limits(1, user_api="blas"):
        yield
