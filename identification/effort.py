"""Effort levels: how many operations the stages of an identification may spend.

Each number is a count of floating-point operations (see `work`), never a time, so that a level
means the same answer on every machine.  One core of 2026 computes about ten giga-operations a
second.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

__all__ = ["EFFORTS", "Effort", "EffortName"]

EffortName = Literal["quick", "normal", "thorough"]


@dataclass(frozen=True)
class Effort:
    """Limits of one level.

    Args:
        search: Operations of the search for effects, whatever the length of the runs.
        search_each: Operations of the search for each sample on top.
        sampling: Operations of the sampler.
        steps: Steps of the sampler at most.
    """

    search: float
    search_each: float
    sampling: float
    steps: int

    def search_of(self, rows: int) -> float:
        """Operations of the search on so many samples."""
        return self.search + self.search_each * rows


EFFORTS: Final[dict[EffortName, Effort]] = {
    "quick": Effort(search=1.5e10, search_each=3e6, sampling=2e11, steps=600),
    "normal": Effort(search=6e10, search_each=1.2e7, sampling=1.2e12, steps=3000),
    "thorough": Effort(search=6e11, search_each=1.2e8, sampling=1e13, steps=20000),
}
"""A normal search of 24,000 samples may take half a minute of one core, one of 370 samples six
seconds; most end long before, since nothing is left to find."""
