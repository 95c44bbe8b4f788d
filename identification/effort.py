"""Effort levels: how many operations the stages of an identification may spend.

Each number is a count of floating-point operations (see `work`), never a time, so that a level
means the same answer on every machine.  One core of 2026 computes about ten giga-operations a
second.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

__all__ = ["EFFORTS", "PART_ROWS", "Effort", "EffortName"]

EffortName = Literal["quick", "normal", "thorough"]


@dataclass(frozen=True)
class Effort:
    """Limits of one level.

    Args:
        search: Operations of the search for effects, whatever the length of the runs.
        search_part: Operations for each of the first samples on top, as many as a part of long
            records has.
        search_each: Operations for each sample on top: what was found is fitted to all.
        sampling: Operations of the sampler.
        steps: Steps of the sampler at most.
    """

    search: float
    search_part: float
    search_each: float
    sampling: float
    steps: int

    def search_of(self, rows: int) -> float:
        """Operations of the search on so many samples."""
        return self.search + self.search_part * min(rows, PART_ROWS) + self.search_each * rows


PART_ROWS: Final = 10_000
"""Samples on which the search works where there are many more."""

EFFORTS: Final[dict[EffortName, Effort]] = {
    "quick": Effort(1.5e10, 1e7, 1.25e6, sampling=2e11, steps=600),
    "normal": Effort(6e10, 4e7, 5e6, sampling=1.2e12, steps=3000),
    "thorough": Effort(6e11, 4e8, 5e7, sampling=1e13, steps=20000),
}
"""A normal search of 24,000 samples may take a minute of one core, one of 370 samples six seconds;
most end long before, since nothing is left to find."""
