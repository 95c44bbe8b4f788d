"""How many threads a calculation uses: as many as there are cores, or as it was told.

Several calculations on one machine share its cores; whoever starts them knows how many they are,
and says it to each.
"""

from __future__ import annotations

import os

__all__ = ["cores", "threads", "use_threads"]

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
