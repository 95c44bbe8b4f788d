"""Which effects could explain the residual: a score of every prototype, one simulation each.

A prototype's deviation from the current model, with everything taken out that the fitted
parameters and initial states could imitate, is compared with the residual:

    gain = (d' W r)^2 / (2 d_perp' W d_perp)                    [log likelihood]

This is what the log likelihood would gain if the effect's size were free and all parameters were
fitted again, to first order.  Marginal correlation would not do: the parameters that were fitted
without the effect have soaked part of it up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.effects.effect import Candidate
from identification.fit.normal_equations import gradient_of
from identification.fit.solve import Fit
from identification.model.simulate import Simulator, initial_states

__all__ = ["Score", "screened"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """A prototype and what it promises.

    Args:
        candidate: The structure.
        start: (n_parameter,) its parameters, scaled to the size that explains most [unit].
        gain: Promised gain of the log likelihood.
    """

    candidate: Candidate
    start: Array
    gain: float


def screened(fit: Fit, candidates: Sequence[Candidate]) -> list[Score]:
    """The best prototypes of every candidate, best first.

    Args:
        fit: The current model at its optimum.
        candidates: Structures to try.
    """
    scores: list[Score] = []
    residuals = [
        record.measured - logged
        for record, logged in zip(fit.simulator.records, fit.equations.logged, strict=True)
    ]
    for candidate in candidates:
        scores += _scores(fit, candidate, residuals)
    return sorted(scores, key=lambda score: -score.gain)


def _scores(fit: Fit, candidate: Candidate, residuals: Sequence[Array]) -> list[Score]:
    deviations = _deviations(fit, candidate)
    if candidate.by_record:
        return _scores_by_record(fit, candidate, deviations, residuals)
    lanes = max(candidate.starts.shape[1], 1)
    projections, products = _normal(fit, deviations, residuals)
    scores = []
    for first in range(0, lanes, candidate.joint):
        span = slice(first, first + candidate.joint)
        gain, weights = _gain(products[span, span], projections[span])
        if np.isfinite(gain):
            scores.append(Score(candidate, _sized(candidate, first, weights), gain))
    return scores


def _scores_by_record(
    fit: Fit, candidate: Candidate, deviations: Sequence[Array], residuals: Sequence[Array]
) -> list[Score]:
    """Scores of starts whose amplitudes are free in each record; what else may move is held."""
    lanes, group = candidate.starts.shape[1], candidate.joint
    gains = np.zeros(lanes // group)
    for k, (deviation, residual) in enumerate(zip(deviations, residuals, strict=True)):
        right = gradient_of(residual, deviation, fit.weighting, k)
        for number in range(gains.size):
            span = slice(number * group, (number + 1) * group)
            square = np.column_stack(
                [
                    gradient_of(deviation[:, :, j], deviation[:, :, span], fit.weighting, k)
                    for j in range(span.start, span.stop)
                ]
            )
            gains[number] += _gain(square, right[span])[0]
    count = len(candidate.final.parameters)
    return [
        Score(candidate, candidate.starts[:count, number * group].copy(), float(gain))
        for number, gain in enumerate(gains)
        if np.isfinite(gain)
    ]


def _gain(square: Array, right: Array) -> tuple[float, Array]:
    """Gain of the log likelihood by amplitudes at their best, and the amplitudes."""
    if not (np.isfinite(square).all() and np.isfinite(right).all()):
        return np.nan, right
    size = np.sqrt(np.maximum(np.diag(square), 0.0))
    if not (size > 0).all():
        return np.nan, right
    scaled = square / np.outer(size, size)
    weights = np.linalg.lstsq(scaled, right / size, rcond=1e-8)[0] / size
    return 0.5 * float(weights @ right), weights


def _deviations(fit: Fit, candidate: Candidate) -> list[Array]:
    """For each record (n_sample, 2, n_start) deviation of the prototypes from the current model."""
    model = fit.simulator.model.adding(candidate.term)
    records = fit.simulator.records
    count = max(candidate.starts.shape[1], 1)
    values = np.repeat(fit.values[:, None], count, axis=1)
    values = np.concatenate([values, candidate.starts.reshape(-1, count)])
    simulator = Simulator.fitting(model, records, values[:, 0], fit.simulator.divisions)
    states = [
        np.concatenate([state, initial_states(model, record)[state.size :]])
        for state, record in zip(fit.states, records, strict=True)
    ]
    with np.errstate(over="ignore", invalid="ignore"):
        return [
            logged - known[:, :, None]
            for logged, known in zip(
                simulator.logged(values, states), fit.equations.logged, strict=True
            )
        ]


def _normal(
    fit: Fit, deviations: Sequence[Array], residuals: Sequence[Array]
) -> tuple[Array, Array]:
    """(n_start,) d'Wr and (n_start, n_start) d_perp'Wd_perp."""
    equations, weighting = fit.equations, fit.weighting
    n = fit.position.size
    count = deviations[0].shape[2]
    right = np.zeros(count)
    square = np.zeros((count, count))
    crossed = np.zeros((n, count))
    for k, (deviation, residual) in enumerate(zip(deviations, residuals, strict=True)):
        bad = np.asarray(~np.isfinite(deviation).all(axis=(0, 1)))
        safe = np.where(bad[None, None, :], 0.0, deviation)
        right += gradient_of(residual, safe, weighting, k)
        both = np.zeros((n + fit.simulator.n_state, count))
        for channel in range(2):
            weight = weighting.sample_weights(k)[:, channel, None]
            white = weighting.whitened(safe[:, channel, :], channel)
            scaled = white * (weight / weighting.deviation[channel] ** 2)
            square += white.T @ scaled
            tangent = weighting.whitened(equations.tangents[k][:, channel, :], channel)
            both += tangent.T @ scaled
        solved = np.linalg.solve(equations.state_matrices[k], both[n:])
        square -= both[n:].T @ solved
        crossed += both[:n] - equations.couplings[k].T @ solved
        right[bad] = np.nan
    free = equations.matrix
    size = np.sqrt(np.diag(free))
    scaled_matrix = free / np.outer(size, size)
    solved = np.linalg.lstsq(scaled_matrix, crossed / size[:, None], rcond=1e-12)[0]
    return right, square - (crossed / size[:, None]).T @ solved


def _sized(candidate: Candidate, first: int, weights: Array) -> Array:
    """Start of a refit: amplitudes scaled as the score says, within reason, shapes kept."""
    parameters = candidate.term.parameters
    columns = candidate.starts[:, first : first + weights.size]
    if columns.size == 0:
        return np.zeros(0)
    sized = columns[:, 0].copy()
    for row, parameter in enumerate(parameters):
        if parameter.search == "linear" and parameter.prior_mean == 0.0:
            factor = np.clip(weights, -30.0, 30.0)
            value = float(columns[row] @ factor)
            reach = 3.0 * parameter.prior_sd * parameter.scale
            low, high = max(parameter.lower, -reach), min(parameter.upper, reach)
            sized[row] = float(np.clip(value, low, high))
            if sized[row] == 0.0 and columns[row].any():
                sized[row] = 0.1 * float(columns[row][np.argmax(np.abs(columns[row]))])
    return sized
