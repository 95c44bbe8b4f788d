"""Simulation of training and validation records with a fitted model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.effects.effect import AbstractEffect, AbstractRunEffect, effects_of
from identification.fit.initial import fitted_initial_states
from identification.fit.order_tracking import is_tracked, tracked
from identification.fit.own_states import state_covariances
from identification.fit.solve import Fit
from identification.fit.temperature import with_own_temperatures
from identification.fit.tracked_fit import slow_noise
from identification.model.excitation import Record, squares_of
from identification.model.simulate import Simulator

__all__ = [
    "Simulated",
    "largest_heating",
    "simulate_fitted",
    "simulate_most_alike",
    "simulate_unseen",
    "voltage_noise_power",
    "median_start",
]

_TRACKED: Final = 8
"""Alternations at most between the angles and the initial states, which depend on each other."""
_ENOUGH: Final = 1e-3
"""Gain per sample below which another alternation is not worth its work [log likelihood]: the error
changes by a thousandth."""


@dataclass(frozen=True)
class Simulated:
    """A record and its simulation."""

    record: Record
    logged: Array
    """(n_sample, 2) simulated current and speed [A, rad/s]."""
    initial: Array
    """(n_state,) initial state."""

    @property
    def residual(self) -> Array:
        """(n_sample, 2) measured minus simulated [A, rad/s]."""
        return self.record.measured - self.logged


def simulate_fitted(fit: Fit) -> list[Simulated]:
    """Simulate the training records from their fitted initial states."""
    return [
        Simulated(record, logged, initial)
        for record, logged, initial in zip(
            fit.simulator.records, fit.simulated(), fit.states, strict=True
        )
    ]


def simulate_unseen(
    fit: Fit, records: Sequence[Record], *, whole: bool = False, most: float = 1.0
) -> list[Simulated]:
    """Simulate validation records from their inputs and their first samples alone.

    Initial states are fitted to the heads of the records, or to whole records, of which the
    fraction `most` counts.
    """
    if not records:
        return []
    records = with_own_temperatures(
        fit.simulator.model, fit.values, records, fit.weighting.deviation, whole=whole
    )
    simulator = Simulator.fitting(fit.simulator.model, records, fit.values)
    deviation = fit.weighting.deviation
    states = fitted_initial_states(simulator, fit.values, deviation, whole=whole, most=most)
    if whole:
        simulator, states = _tracked(fit, simulator, states)
    if fit.simulator.substeps is not None:
        simulator = simulator.accurate(fit.values, states, deviation)
    logged = simulator.logged(fit.values[:, None], states)
    return [
        Simulated(record, y[:, :, 0], initial)
        for record, y, initial in zip(simulator.records, logged, states, strict=True)
    ]


def simulate_most_alike(
    fit: Fit, records: Sequence[Record], *, whole: bool = False, most: float = 1.0
) -> list[Simulated]:
    """Simulate validation records, each as one of the runs that it is most like.

    What several runs have in common, such as a disk on the shaft, a further run may have or not;
    only its own samples show which.
    """
    found = simulate_unseen(fit, records, whole=whole, most=most)
    for term in effects_of(fit.simulator.model.terms):
        if term.scope != "some runs" or not isinstance(term, AbstractRunEffect) or not term.others:
            continue
        run = float(term.runs[0])
        there = [record.with_inputs({"run": np.full(record.rows, run)}) for record in records]
        others = simulate_unseen(fit, there, whole=whole, most=most)
        pairs = zip(found, others, strict=True)
        found = [min(pair, key=lambda one: _misfit(one, fit)) for pair in pairs]
    return found


def _misfit(simulated: Simulated, fit: Fit) -> float:
    """Sum of squares of both channels in variances of the noise; infinite if a run diverges."""
    scaled = simulated.residual / fit.weighting.deviation
    total = float(np.sum(simulated.record.weight * scaled * scaled))
    return total if np.isfinite(total) else np.inf


def voltage_noise_power(fit: Fit) -> Array:
    """Mean square noise of current and speed that noise of the voltage causes, (2,) [A^2, ...].

    The noise is that which smoothing leaves in the voltage; zero for a voltage as logged.  What it
    causes is whitened as the residuals of the fit.
    """
    records = fit.simulator.records
    if all(record.voltage_noise is None for record in records):
        return np.zeros(2)
    noisy = tuple(record.with_voltage_noise() for record in records)
    changed = replace(fit.simulator, records=noisy).logged(fit.values[:, None], fit.states)
    pairs = zip(changed, fit.simulated(), strict=True)
    changes = [fit.weighting.both_whitened(after[:, :, 0] - before) for after, before in pairs]
    return squares_of(records, changes) / np.maximum(fit.weighting.counts, 1.0)


def heating_effects(fit: Fit) -> list[str]:
    """Names of the effects that heat the winding by its own losses."""
    return [term.name for term in effects_of(fit.simulator.model.terms) if term.heats]


def largest_heating(fit: Fit) -> float:
    """Largest rise of the winding by its own losses in the training records; 0 without one [K]."""
    own, names = heating_effects(fit), fit.simulator.model.state_names
    rises = [k for k, name in enumerate(names) if name.partition(".")[0] in own]
    if not rises:
        return 0.0
    trajectories = fit.simulator.states(fit.values[:, None], fit.states)
    return float(max(states[:, rises, 0].sum(axis=1).max() for states in trajectories))


def median_start(fit: Fit, term: AbstractEffect, sd: float) -> float:
    """Median initial value, over the records, of the sum of the states of a term.

    Each sum is its estimate plus `sd` standard deviations, in the unit of the states.
    """
    names = fit.simulator.model.state_names
    rows = np.array([name.partition(".")[0] == term.name for name in names], dtype=np.float64)
    spread = np.sqrt(np.maximum(state_covariances(fit) @ rows @ rows, 0.0))
    return float(np.median(np.array(fit.states) @ rows + sd * spread))


def _tracked(
    fit: Fit, simulator: Simulator, states: tuple[Array, ...]
) -> tuple[Simulator, tuple[Array, ...]]:
    """Simulator with tracked angles, and the initial states at them.

    The angles are tracked for white noise of the speed first, then for its noise in the fit.
    """
    if not is_tracked(simulator.model):
        return simulator, states
    values, deviation = fit.values, fit.weighting.deviation
    simulator = simulator.roughly_accurate(values, states, deviation)
    least = _ENOUGH * sum(record.measured.size for record in simulator.records)
    best = np.inf
    for slow in sorted({1.0, slow_noise(fit)}):
        for _ in range(_TRACKED):
            found, begun = tracked(simulator, values, states, deviation, slow)
            begun = fitted_initial_states(found, values, deviation, whole=True, start=begun)
            cost = _cost(found, values, begun, deviation)
            gain = best - cost
            if not gain > 0.0:
                break
            best, simulator, states = cost, found, begun
            if gain < least:
                break
    return simulator, states


def _cost(
    simulator: Simulator, values: Array, states: tuple[Array, ...], deviation: Array
) -> float:
    """Negative log likelihood of records with known noise, up to a constant."""
    logged = simulator.logged(values[:, None], states)
    errors = [r.measured - y[:, :, 0] for r, y in zip(simulator.records, logged, strict=True)]
    return 0.5 * float(np.sum(squares_of(simulator.records, errors) / deviation**2))
