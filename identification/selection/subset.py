"""Representative subset of long records by greedy D-optimal design.

A search refits dozens of models.  Some ten thousand samples contain most of what it learns from a
million: on them, an effect that has to lower the error by 2 % gains hundreds in log likelihood.
The search therefore uses one segment of each record, and only the models that matter are refitted
to all samples.

The segments maximise the determinant of the joint moment matrix of their regressors: current,
speed, their signs and squares, voltage, temperature, and the residual of the nominal model.  A
segment with both directions, standstill and large currents is worth more than one at constant
speed.

Source: Fedorov, Theory of Optimal Experiments, Academic Press (1972), chapter 3 (D-optimality and
greedy exchange).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.fit.campaign import Campaign
from identification.fit.evaluate import simulate_unseen
from identification.fit.initial import fitted_initial_states
from identification.fit.order_tracking import tracked
from identification.fit.solve import Fit, TerminationLimits, solve
from identification.fit.tracked_fit import solve_tracked
from identification.model.excitation import Record
from identification.model.simulate import Simulator
from identification.model.weighting import Weighting
from identification.options import PART_ROWS
from identification.selection.policy import DEFAULT

__all__ = ["fitted_to", "informative_segments", "representative_subset", "subset_of_fit"]

_PLACES: Final = 4
"""Possible start positions per segment length."""
_SWEEPS: Final = 2
"""Passes of the exchange over all records."""


def representative_subset(campaign: Campaign, declared: Fit) -> tuple[Campaign, Fit] | None:
    """Segments of the records of a campaign, and the nominal model fitted to them.

    None if the records are short.
    """
    if sum(record.rows for record in campaign.training) <= DEFAULT.subset_ratio * PART_ROWS:
        return None
    training = _segments(campaign.training, declared.residuals(), PART_ROWS)
    unseen = simulate_unseen(declared, campaign.validation)
    validation = _segments([s.record for s in unseen], [s.residual for s in unseen], PART_ROWS // 2)
    own = declared.simulator
    simulator = Simulator.fitting(own.model, training, declared.values)
    fit = solve(simulator, declared.coordinates, declared.position)
    return replace(campaign, training=tuple(training), validation=tuple(validation)), fit


def subset_of_fit(fit: Fit) -> Fit:
    """A model fitted to segments of its records; the fit itself if the records are short."""
    records = fit.simulator.records
    if sum(record.rows for record in records) <= DEFAULT.subset_ratio * PART_ROWS:
        return fit
    return fitted_to(_segments(records, fit.residuals(), PART_ROWS), fit)


def informative_segments(records: Sequence[Record], rows: int) -> list[Record]:
    """Segments of records to which no model has been fitted, with so many samples in all."""
    residuals = [np.zeros_like(record.measured) for record in records]
    return _segments(records, residuals, rows)


def fitted_to(records: Sequence[Record], fit: Fit, limits: TerminationLimits | None = None) -> Fit:
    """Fit a model to other records, starting at its present optimum."""
    model, values = fit.simulator.model, fit.values
    own = any(state.is_own for term in model.terms for state in term.states)
    simulator = Simulator.fitting(model, records, values)
    deviation = fit.weighting.deviation
    states = fitted_initial_states(simulator, values, deviation, whole=own)
    simulator = simulator.accurate(values, states, deviation)
    simulator, states = tracked(simulator, values, states, deviation)
    weighting = replace(Weighting.white(simulator.records), deviation=deviation)
    return solve_tracked(simulator, fit.coordinates, fit.position, states, weighting, limits)


def _segments(records: Sequence[Record], residuals: Sequence[Array], rows: int) -> list[Record]:
    """One segment of each record, about `rows` samples in total."""
    if not records:
        return []
    total = sum(record.rows for record in records)
    lengths = [
        min(r.rows, max(DEFAULT.segment_samples, int(rows * r.rows / total))) for r in records
    ]
    scale = np.sqrt(np.mean([np.mean(f**2, axis=0) for f in _regressors(records, residuals)], 0))
    moments = [
        _moments(features / np.where(scale > 0, scale, 1.0), max(length // _PLACES, 1))
        for features, length in zip(_regressors(records, residuals), lengths, strict=True)
    ]
    chosen = [0] * len(records)
    size = scale.size
    everything = 1e-3 * sum(m.sum(axis=0) for m in moments) + 1e-9 * np.eye(size)
    taken = [np.zeros((size, size)) for _ in records]
    for _ in range(_SWEEPS):
        for k, sums in enumerate(moments):
            others = everything + sum(taken) - taken[k]
            windows = _windows(sums, min(_PLACES, sums.shape[0]))
            worth = np.linalg.slogdet(others + windows)[1]
            chosen[k] = int(np.argmax(worth))
            taken[k] = windows[chosen[k]]
    return [
        record.segment(first * max(length // _PLACES, 1), length)
        for record, first, length in zip(records, chosen, lengths, strict=True)
    ]


def _regressors(records: Sequence[Record], residuals: Sequence[Array]) -> list[Array]:
    """For each record (n_sample, n_regressor) signals that effects may depend on."""
    found = []
    for record, residual in zip(records, residuals, strict=True):
        current, speed = record.measured.T
        slow = 0.02 * record.span[1]
        warmth = record.column("temperature") - 25.0
        directions = np.tanh(speed / slow), np.tanh(current / (0.05 * record.span[0]))
        squares = speed * np.abs(speed), current * np.abs(current), current * speed
        linear = np.ones(record.rows), current, speed, record.column("voltage")
        heated = warmth * current, warmth * speed
        columns = np.column_stack([*linear, *directions, *squares, *heated, residual])
        found.append(np.where(np.isfinite(columns), columns, 0.0))
    return found


def _moments(features: Array, step: int) -> Array:
    """(n_block, n_regressor, n_regressor) moment matrices of blocks of `step` samples."""
    blocks = max(features.shape[0] // step, 1)
    cut = features[: blocks * step].reshape(blocks, -1, features.shape[1])
    return np.asarray(np.einsum("bni,bnj->bij", cut, cut, optimize=True))


def _windows(moments: Array, width: int) -> Array:
    """Sums over `width` consecutive blocks, for each possible first block."""
    sums = np.concatenate([np.zeros((1, *moments.shape[1:])), np.cumsum(moments, axis=0)])
    return np.asarray(sums[width:] - sums[:-width])
