"""What a prototype promises."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.effects.effect import Candidate
from identification.effects.start import Along, Start

__all__ = ["Score", "gathered", "sized"]

Array = NDArray[np.float64]

_OTHERS: Final = 5
"""Starts beside the most promising one from which a refit may go on."""


@dataclass(frozen=True)
class Score:
    """A prototype and what it promises.

    Args:
        candidate: The structure.
        start: (n_parameter,) its parameters, scaled to the size that explains most [unit].
        gain: Promised gain of the log likelihood.
        covariance: (n_joint, n_joint) of the amplitudes that were scored together, as multiples of
            their prototypes, everything else fitted along [-]; None where they are a record's own.
        own: For each record the amplitudes that are its own, in the order of the term's states;
            empty where there are none.
        along: How what was fitted so far moves along; None where it is held.
        others: Starts of the same structure that promised less.
    """

    candidate: Candidate
    start: Array
    gain: float
    covariance: Array | None = None
    own: tuple[Array, ...] = ()
    along: Along | None = None
    others: tuple[Start, ...] = ()

    @property
    def starts(self) -> tuple[Start, ...]:
        """Where a refit may start, the most promising first."""
        return (Start(self.start, self.own, self.along), *self.others)


def gathered(scores: Sequence[Score]) -> list[Score]:
    """One score of each structure, its other starts with it.

    Args:
        scores: Best first.
    """
    best: dict[tuple[str, str], Score] = {}
    for score in scores:
        key = (score.candidate.term.name, score.candidate.final.variant)
        known = best.setdefault(key, score)
        if known is not score and len(known.others) < _OTHERS:
            best[key] = replace(known, others=(*known.others, *score.starts))
    return list(best.values())


def sized(candidate: Candidate, first: int, weights: Array) -> tuple[Array, Array]:
    """Start of a refit: amplitudes scaled as the score says, within reason, shapes kept.

    Where that leaves nothing, since the score points where the effect cannot go, the prototype is
    the start: what is best far from nothing need not show there.

    Returns:
        The start and the weights of the prototypes in it.
    """
    parameters = candidate.term.parameters
    columns = candidate.starts[:, first : first + weights.size]
    if columns.size == 0:
        return np.zeros(0), weights
    start = columns[:, 0].copy()
    for row, parameter in enumerate(parameters):
        if parameter.vanishes:
            factor = np.clip(weights, -30.0, 30.0)
            value = float(columns[row] @ factor)
            reach = 3.0 * parameter.prior_sd * parameter.scale
            low, high = max(parameter.lower, -reach), min(parameter.upper, reach)
            start[row] = float(np.clip(value, low, high))
            if start[row] == 0.0 and columns[row].any():
                start[row] = float(columns[row][np.argmax(np.abs(columns[row]))])
                weights = np.ones(1) if weights.size == 1 else weights
    return start, weights
