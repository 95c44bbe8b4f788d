"""Comparison of models on the samples that all of them predict.

A delay, an average or a digital filter depends on samples before the record, which no model
predicts.  The first samples of every record then have no weight, and the others have their sum
(`Record.within`).  That is right on average for white noise, but the log likelihood of the omitted
samples scatters: in a channel, by sqrt(n / 2) for n of them.  The delay of one channel by up to
eight samples, in five training runs and two validation runs, is thus compared with a filter at a
random difference with a standard deviation of 5, although a difference of 3 is strong evidence.
In coloured noise the difference has a sign as well, because no past whitens the first sample.

Models are therefore compared without the edges of any of them.  Their parameters stay those of
their own fits.

Source: Burnham and Anderson, Model Selection and Multimodel Inference, 2nd edition (2002), section
2.11 (only models of the same data can be compared).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array, Index
from identification.fit.solve import Fit
from identification.model.composite import Edges

__all__ = ["chance_of_fading", "common_edges", "fit_within"]

_BY_CHANCE: Final = 0.5
"""Expected gain of the log likelihood by an initial value that has no effect."""


def common_edges(fits: Iterable[Fit]) -> Edges:
    """Samples at both ends of a record that any of the models omits, for each channel."""
    every = np.array([((0, 0), (0, 0)), *(fit.simulator.model.edges for fit in fits)])
    (first, last), (other_first, other_last) = every.max(axis=0).tolist()
    return (first, last), (other_first, other_last)


def fit_within(fit: Fit, edges: Edges) -> Fit:
    """The fit with cost and deviations of the samples within the edges, at the same parameters."""
    records = tuple(record.within(edges) for record in fit.weighting.records)
    pairs = zip(records, fit.equations.logged, strict=True)
    residuals = [record.measured - logged for record, logged in pairs]
    before = replace(fit.weighting, records=records)
    after, _ = before.sized(before.sums_of_squares(residuals))
    rise = float(after.counts @ np.log(after.deviation / fit.weighting.deviation))
    return replace(fit, weighting=after, cost=fit.cost + rise)


def chance_of_fading(fit: Fit, edges: Edges | None = None) -> float:
    """Gain of the log likelihood by chance of initial values whose influence fades.

    Each gains 1/2 over all samples.  Within the edges it gains as much of this as they leave of its
    information: the square of its whitened influence on the simulation.
    """
    model = fit.simulator.model
    fades = [state.fades for term in model.terms for state in term.states]
    if edges is None or edges == model.edges or not any(fades):
        return _BY_CHANCE * len(fit.states) * sum(fades)
    rows = np.flatnonzero([False, False, *fades])
    steps = [1.0 / np.sqrt(np.diag(matrix)[rows]) for matrix in fit.equations.state_matrices]
    moved = [_moved(state, rows, step) for state, step in zip(fit.states, steps, strict=True)]
    logged = fit.simulator.logged(np.repeat(fit.values[:, None], 1 + rows.size, axis=1), moved)
    shares = 0.0
    for record, lanes in zip(fit.weighting.records, logged, strict=True):
        change = fit.weighting.both_whitened(lanes[:, :, 1:] - lanes[:, :, :1])
        square = (change / fit.weighting.deviation[:, None]) ** 2
        whole = np.einsum("nc,ncl->l", record.within(model.edges).weight, square)
        left = np.einsum("nc,ncl->l", record.within(edges).weight, square)
        shares += float(np.sum(np.minimum(left / np.maximum(whole, 1e-300), 1.0)))
    return _BY_CHANCE * shares


def _moved(state: Array, rows: Index, steps: Array) -> Array:
    """(n_state, 1 + n_row) the state, and the state with a step in each of some rows."""
    moved = np.repeat(state[:, None], 1 + rows.size, axis=1)
    moved[rows, 1 + np.arange(rows.size)] += steps
    return moved
