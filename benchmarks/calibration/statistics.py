"""Coverage and rank statistics of a log, with their sampling errors.

Source: Talts, Betancourt, Simpson, Vehtari, Gelman, Validating Bayesian inference algorithms with
simulation-based calibration, arXiv:1804.06788 (2018).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import stats

__all__ = ["BINS", "Coverage", "Line", "band", "coverage", "ranks", "uniformity"]

Line = dict[str, Any]
Array = NDArray[np.float64]

BINS: Final = 10
_LOW, _HIGH = 0.05, 0.95
_LEVEL: Final = 0.90


@dataclass(frozen=True)
class Coverage:
    """Fraction of the 90 % intervals that contain the true value.

    Args:
        intervals: Number of intervals.
        campaigns: Number of campaigns with an interval.
        fraction: Fraction that contain the true value [-].
        error: Standard error [-].  The intervals of one campaign share its runs, so the campaigns
            are the independent units.
    """

    intervals: int
    campaigns: int
    fraction: float
    error: float

    def __str__(self) -> str:
        return f"{100 * self.fraction:.1f} ± {100 * self.error:.1f} %"


def ranks(line: Line, what: str, name: str | None = None) -> list[float]:
    """Ranks of one campaign: those of identified parameters, or of the feedback metrics.

    Args:
        line: Line of the log.
        what: ``parameters`` or ``feedback``.
        name: A parameter, or a metric as ``rise_time_s@25``; None for all.
    """
    found = []
    for key, entry in line.get(what, {}).items():
        if name not in (None, key):
            continue
        if what == "feedback":
            found.append(float(entry))
        elif entry[3] and entry[0] is not None:
            found.append(float(entry[0]))
    return found


def coverage(lines: Iterable[Line], what: str, name: str | None = None) -> Coverage | None:
    """Coverage over campaigns; None without an interval.

    Args:
        lines: Lines of the log.
        what: ``parameters`` or ``feedback``.
        name: A parameter or metric; None for all.
    """
    found = [np.array(own) for line in lines if (own := ranks(line, what, name))]
    if not found:
        return None
    held = np.array([np.sum((own >= _LOW) & (own <= _HIGH)) for own in found], dtype=np.float64)
    sizes = np.array([own.size for own in found], dtype=np.float64)
    fraction = float(held.sum() / sizes.sum())
    # Ratio estimator over clusters; with one interval per campaign it is the binomial error.
    error = float(np.sqrt(np.sum((held - fraction * sizes) ** 2)) / sizes.sum())
    if sizes.max() == 1.0:
        error = float(np.sqrt(_LEVEL * (1.0 - _LEVEL) / sizes.sum()))
    return Coverage(int(sizes.sum()), len(found), fraction, error)


def band(count: int, share: float, level: float = 0.99) -> tuple[float, float]:
    """Interval of a binomial count around its expectation.

    Args:
        count: Number of trials.
        share: Probability of success [-].
        level: Probability of the interval [-].
    """
    low, high = stats.binom.interval(level, count, share)
    return float(low), float(high)


def uniformity(values: Sequence[float]) -> float:
    """Probability of a larger chi-square statistic of the rank histogram under uniform ranks."""
    counts, _ = np.histogram(values, bins=BINS, range=(0.0, 1.0))
    return float(stats.chisquare(counts).pvalue)
