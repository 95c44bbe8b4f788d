"""Effort levels: operation budgets of the stages of an identification.

Each number counts floating-point operations (see `work`), not time, so that a level gives the same
answer on every machine.  One core of 2026 computes about ten giga-operations per second.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

__all__ = ["EFFORTS", "PART_ROWS", "Effort", "EffortName"]

EffortName = Literal["quick", "normal", "thorough"]


@dataclass(frozen=True)
class Effort:
    """Limits of one level."""

    search: float
    """Operations of the search for effects, independent of the length of the runs."""
    search_part: float
    """Additional operations for each of the first `PART_ROWS` samples, the size of the
    representative subset."""
    search_each: float
    """Additional operations for each sample; the model found is fitted to all samples."""
    sampling: float
    """Operations of the sampler."""
    steps: int
    """Largest number of sampler steps."""

    def search_of(self, rows: int) -> float:
        """Operations of the search on `rows` samples."""
        return self.search + self.search_part * min(rows, PART_ROWS) + self.search_each * rows


PART_ROWS: Final = 10_000
"""Samples in the representative subset that the search uses if there are many more."""

EFFORTS: Final[dict[EffortName, Effort]] = {
    "quick": Effort(1.5e10, 1e7, 1.25e6, sampling=2e11, steps=600),
    "normal": Effort(6e10, 4e7, 5e6, sampling=1.2e12, steps=3000),
    "thorough": Effort(6e11, 4e8, 5e7, sampling=1e13, steps=20000),
}
"""A normal search of 24,000 samples may take a minute on one core, one of 370 samples eight
seconds.  Most searches end long before, when no effect is left to find."""
