"""Result of the score test: predicted gain and starting points of a refit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.effects.effect import AbstractEffect, Candidate, effects_of
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit
from identification.model.term import AbstractHold
from identification.selection.start import Along, Start

__all__ = [
    "Score",
    "Key",
    "gathered",
    "recurring",
    "sized",
    "structure_of",
    "key_of",
    "with_fitted_hold",
]

Key = frozenset[tuple[str, str]]
"""Effect types and variants of a model, by which its fit is known."""

_OTHERS: Final = 5
"""Further starting points per structure at most, besides the best."""
_AGREES: Final = 3.0
"""Gain of the log likelihood that a run has to add, for odds of twenty to one that the event
occurred in it too."""


def structure_of(term: AbstractEffect) -> tuple[str, str]:
    """Type and variant of an effect."""
    return term.name, term.variant


def key_of(fit: Fit) -> Key:
    """Types and variants of the effects of a fit."""
    return frozenset(structure_of(term) for term in effects_of(fit.simulator.model.terms))


@dataclass(frozen=True)
class Score:
    """Predicted gain of a candidate."""

    candidate: Candidate
    start: Array
    """(n_parameter,) parameters, with the amplitudes that maximise the gain [unit]."""
    gain: float
    """Predicted gain of the log likelihood."""
    covariance: Array | None = None
    """(n_joint, n_joint) of the amplitudes scored together, as multiples of their prototypes, with
    everything else refitted [-]; None for per-record amplitudes."""
    own: tuple[Array, ...] = ()
    """For each record its per-record amplitudes, in the order of the term's states; empty without
    such amplitudes."""
    along: Along | None = None
    """First-order change of the fitted parameters and states; None if they are held."""
    others: tuple[Start, ...] = ()
    """Starting points of the same structure with a smaller predicted gain."""
    control: float | None = None
    """Median over the other runs of the gain of the same effect there, given this one; None if it
    is not restricted to runs, or if there are no others."""
    best: float = 1.0
    """Amplitude with the predicted gain over that of the start; not 1 if its sign contradicts the
    effect, so that a refit starts from the prototype [-]."""

    @property
    def structure(self) -> tuple[str, str]:
        """Effect type and variant."""
        return structure_of(self.candidate.final)

    @property
    def starts(self) -> tuple[Start, ...]:
        """Starting points of a refit, the largest predicted gain first."""
        return (Start(self.start, self.own, self.along), *self.others)

    def unknowns(self, records: int) -> int:
        """Unknowns that the term adds, those of a record once for each record.

        A ripple is scored by its fundamental wave; it is accepted with its frequency, its drift and
        its harmonics.  Of a law with a grid of starting points, only the scored amplitudes count,
        since its score is no prediction.
        """
        candidate = self.candidate
        if candidate.tried is not None:
            return candidate.joint * (records if candidate.by_record else 1)
        lasting = sum(not state.fades for state in candidate.final.states)
        return len(candidate.final.parameters) + lasting * records


def gathered(scores: Sequence[Score]) -> list[Score]:
    """One score per structure, best first, with the other starting points attached to it."""
    best: dict[tuple[str, str], tuple[Score, list[Start]]] = {}
    for score in scores:
        known, others = best.setdefault(score.structure, (score, list(score.others)))
        if known is not score and len(others) < _OTHERS:
            others += score.starts
    return [replace(score, others=tuple(others)) for score, others in best.values()]


def with_fitted_hold(fit: Fit, scores: Sequence[Score]) -> list[Score]:
    """Scores with the gain of another hold of the voltage from a fit instead of a prediction.

    The hold has no amplitude, and with the wrong one all parameters of a slowly driven motor are
    far off, so that a first-order prediction misses most of the gain.
    """
    found = []
    for score in scores:
        if isinstance(score.candidate.final, AbstractHold):
            hold = fit.simulator.model.adding(score.candidate.final).held
            fitted = fit_declared(fit.simulator.records, hold)
            if fit.cost - fitted.cost > score.gain:
                along = Along.to(fit, fitted.values)
                found.append(replace(score, gain=fit.cost - fitted.cost, along=along))
                continue
        found.append(score)
    return sorted(found, key=lambda score: -score.gain)


def sized(candidate: Candidate, first: int, weights: Array) -> tuple[Array, Array]:
    """Starting point of a refit: amplitudes from the score within their bounds, shapes unchanged.

    Amplitudes scored together are reduced by a common factor: clipping each spline coefficient by
    itself would leave the direction along which the gain is predicted.  A single amplitude outside
    the bounds can be clipped to zero.  The start then has the amplitude of the prototype, because
    an effect that fits well at a finite amplitude need not gain near zero.

    Returns:
        The starting point, and the weights of the prototypes in it.
    """
    columns = candidate.starts[:, first : first + weights.size]
    if columns.size == 0:
        return np.zeros(0), weights
    start, parameters = columns[:, 0].copy(), candidate.term.parameters
    rows = [row for row, parameter in enumerate(parameters) if parameter.vanishes]
    own = columns[rows]
    reach = [3.0 * parameters[row].prior_sd * parameters[row].scale for row in rows]
    low = np.maximum([parameters[row].lower for row in rows], np.negative(reach))
    high = np.minimum([parameters[row].upper for row in rows], reach)
    if weights.size == 1:
        sizes = np.clip(own @ np.clip(weights, -30.0, 30.0), low, high)
        is_clipped = (sizes == 0.0) & own.any(axis=1)
        sizes[is_clipped] = own[is_clipped, 0]
        weights = np.ones(1) if is_clipped.any() else weights
    else:
        sizes = own @ weights
        excess = sizes / np.where(sizes > 0.0, high, low)
        factor = 1.0 / np.max(excess, initial=1.0)
        weights, sizes = factor * weights, factor * sizes
    start[rows] = sizes
    return start, weights


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
