"""Greedy selection of the runs in which the same event occurs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.effects.effect import Candidate
from identification.selection.score import Score, sized
from identification.selection.start import Along

__all__ = ["recurring"]

_AGREES: Final = 3.0
"""Gain of the log likelihood that a run has to add, for odds of twenty to one that the event
occurred in it too."""


def recurring(
    candidate: Candidate,
    lane: int,
    projections: Array,
    products: Array,
    along: Along,
    runs: Sequence[int],
) -> list[Score]:
    """Score of one start with a common amplitude in several runs; empty for fewer than two runs.

    Runs are added one at a time while each raises the gain of the common amplitude by `_AGREES`.

    For the start in `lane`, `projections` (n_run,) are those of the residual on the deviation in
    each of the runs, `products` (n_run, n_run) the inner products of these deviations, and `along`
    the first-order change of the fit with each.
    """

    def gain(chosen: Sequence[int]) -> float:
        size = float(products[np.ix_(chosen, chosen)].sum())
        return 0.5 * float(projections[list(chosen)].sum()) ** 2 / size if size > 0 else -np.inf

    left = [k for k in range(len(runs)) if np.isfinite(projections[k]) and products[k, k] > 0]
    chosen: list[int] = []
    reached = 0.0
    while left:
        best = max(left, key=lambda k: gain([*chosen, k]))
        if gain([*chosen, best]) < reached + _AGREES:
            break
        chosen, reached = [*chosen, best], gain([*chosen, best])
        left.remove(best)
    if len(chosen) < 2:
        return []
    weight = float(projections[chosen].sum() / products[np.ix_(chosen, chosen)].sum())
    first, *others = sorted(runs[k] for k in chosen)
    own = replace(candidate.in_runs(first, *others), starts=candidate.starts[:, lane : lane + 1])
    start, weights = sized(own, 0, np.array([weight]))
    weighed = np.zeros(len(runs))
    weighed[chosen] = weights[0]
    covariance = np.array([[1.0 / products[np.ix_(chosen, chosen)].sum()]])
    return [Score(own, start, reached, covariance, (), along.by(weighed))]
