"""Multi-start output-error fit of the nominal model, from the runs alone.

Filtered regression gives several starting vectors.  One batched simulation ranks them.
Gauss-Newton starts from the best one.  The next one is tried if the fit does not converge or leaves
the resistance uncertain.

Inertias range over seven decades from a watch motor to a traction motor, so the scales and the
prior centres come from the starting values.  The priors only keep undetermined parameters finite:
five standard deviations of a logarithm of width five span twenty decades.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.errors import ComputationError
from identification.fit.solve import Fit, TerminationLimits, continued, optimised, renewed
from identification.fit.start import starting_values
from identification.fit.temperature import unlogged_of
from identification.model.composite import Hold, MotorModel
from identification.model.excitation import Record, sample_interval
from identification.model.parameter import Coordinates, Parameter
from identification.model.simulate import Simulator, initial_states
from identification.model.weighting import Weighting

__all__ = ["fit_declared", "settled"]

_STARTS: Final = 3
_SHARP: Final = 0.03
"""Largest relative standard deviation of a well-determined resistance."""
_LEG: Final = 5
_LEGS: Final = 11
_LEAST_INDUCTANCE: Final = 2e-3
_NEAR_BOUND: Final = 1.01
_REBOUNDS: Final = 5
"""Renewals of the lower bound of L at most; each resistance is closer to the optimum."""
_LOG_WIDTH: Final = 5.0
_LINEAR_WIDTH: Final = 30.0
_CERTAIN: Final = 5.0
_LEAST: Final = 1e-4
_MAY_VANISH: Final = ("b", "L")


def fit_declared(records: Sequence[Record], hold: Hold) -> Fit:
    """Fit the nominal model to records, with zero-order (``zoh``) or first-order (``foh``) hold.

    Raises:
        ComputationError: No starting vector gives a finite simulation.
    """
    model = MotorModel(hold=hold, unlogged=unlogged_of(records))
    starts = starting_values(records)
    expected = [np.full(starts.shape[1], own.prior_mean) for own in model.unlogged.parameters]
    ranked = _ranked(model, records, np.vstack([starts, *expected]))
    best: Fit | None = None
    for values in ranked[:_STARTS]:
        if best is not None and best.converged and _is_sharp(best):
            break
        simulator = Simulator.fitting(model, records, values)
        coordinates = _bounded(simulator, records, values)
        fit = _rebounded(_followed(simulator, coordinates, coordinates.of(values)))
        if best is None or fit.cost < best.cost:
            best = fit
    if best is None or not np.isfinite(best.cost):
        raise ComputationError(
            "the declared model cannot be simulated over these runs from any starting value; "
            "expected finite currents and speeds: check units and the sign of each channel"
        )
    return settled(best)


def _rebounded(fit: Fit) -> Fit:
    """Continue a fit whose L is at a lower bound from a far larger starting resistance."""
    row = fit.coordinates.names.index("L")
    for _ in range(_REBOUNDS):
        parameters = list(fit.coordinates.parameters)
        least = _least_inductance(fit.simulator.records, fit.values)
        at = parameters[row].lower
        if fit.values[row] > _NEAR_BOUND * at or at < _NEAR_BOUND * least:
            break
        parameters[row] = replace(parameters[row], lower=least)
        coordinates = Coordinates(parameters)
        fit = _followed(fit.simulator, coordinates, coordinates.of(fit.values))
    return fit


def _least_inductance(records: Sequence[Record], values: Array) -> float:
    """L with an electrical time constant too far below the sample interval to differ from zero."""
    return _LEAST_INDUCTANCE * float(values[0]) * sample_interval(records)


def _is_sharp(fit: Fit) -> bool:
    """True if the resistance is well determined, so that a distant second optimum is unlikely.

    A loop that holds one speed excites the winding little.  A resistance without inductance then
    fits nearly as well as the correct one.
    """
    index = fit.coordinates.names.index("Ra25")
    return bool(fit.deviations[index] < _SHARP * abs(fit.values[index]))


def _followed(simulator: Simulator, coordinates: Coordinates, position: Array) -> Fit:
    """Fit in legs of five steps, with a step plan renewed for each leg.

    Far from the start the inductance may be so small that the Taylor series of the plan fails.  The
    error of the series then acts as a barrier, along which the fit creeps until its step limit.
    """
    limits = TerminationLimits(steps=_LEG)
    fit = optimised(simulator, coordinates, position, limits=limits)
    for _ in range(_LEGS):
        if fit.converged:
            break
        fit = continued(replace(fit, simulator=fit.simulator.suited_to(fit.values)), limits)
    return renewed(fit)


def settled(fit: Fit) -> Fit:
    """Refit with linear coordinates for b and L if the data do not exclude zero."""
    coordinates = _linear_where_uncertain(fit.coordinates, fit.values, fit.deviations)
    if coordinates.parameters == fit.coordinates.parameters:
        return fit
    return continued(replace(fit, coordinates=coordinates, position=coordinates.of(fit.values)))


def _ranked(model: MotorModel, records: Sequence[Record], candidates: Array) -> list[Array]:
    """Starting vectors by simulation error, best first; diverging ones are dropped."""
    simulator = Simulator.fitting(model, records, candidates)
    states = [initial_states(model, record) for record in records]
    weighting = Weighting.white(records)
    cost = weighting.sized(simulator.misfit(candidates, states, weighting))[1]
    order = np.argsort(np.where(np.isfinite(cost), cost, np.inf))
    return [candidates[:, k] for k in order if np.isfinite(cost[k])]


def _bounded(simulator: Simulator, records: Sequence[Record], values: Array) -> Coordinates:
    """Coordinates with a lower bound on L, below which the sampling cannot resolve it."""
    parameters = list(simulator.model.parameters)
    for k, parameter in enumerate(parameters):
        if parameter.name == "L":
            parameters[k] = replace(parameter, lower=_least_inductance(records, values))
    return _scaled_coordinates(parameters, values)


def _scaled_coordinates(parameters: Sequence[Parameter], values: Array) -> Coordinates:
    """Search coordinates of a model's parameters, scaled by starting values (n_parameter,).

    Runs determine ratios and products best (b/J, Kt^2/Ra).  If single factors are less certain, the
    cost has a valley that is straight in logarithms and curved in the quantities themselves.  All
    positive quantities are therefore searched in logarithms.  The values need the right order of
    magnitude.
    """
    scaled = []
    for parameter, value in zip(parameters, values, strict=True):
        if parameter.search == "log" and np.isinf(parameter.prior_sd):
            parameter = replace(parameter, prior_mean=float(value), prior_sd=_LOG_WIDTH)
        elif parameter.name in _MAY_VANISH:
            parameter = replace(
                parameter,
                search="log",
                lower=max(parameter.lower, _LEAST * float(value)),
                prior_mean=float(value),
                prior_sd=_LOG_WIDTH,
            )
        scaled.append(parameter)
    return Coordinates(scaled)


def _linear_where_uncertain(
    coordinates: Coordinates, values: Array, deviations: Array
) -> Coordinates:
    """Search coordinates with b and L linear if the data do not exclude zero.

    Near zero a logarithm diverges without any change of the likelihood.  A linear coordinate with a
    bound at zero has a truncated normal posterior.  The values at the optimum of a fit are
    (n_parameter,) physical, as are their standard deviations.
    """
    ra, kt = float(values[0]), float(values[2])
    changed = []
    for parameter, value, deviation in zip(coordinates.parameters, values, deviations, strict=True):
        if parameter.name in _MAY_VANISH and not value > _CERTAIN * deviation:
            scale = parameter.prior_mean + (kt**2 / ra if parameter.name == "b" else 0.0)
            lower = 0.0 if parameter.name == "b" else parameter.lower
            parameter = replace(
                parameter,
                search="linear",
                lower=lower,
                scale=scale,
                prior_mean=0.0,
                prior_sd=_LINEAR_WIDTH,
            )
        changed.append(parameter)
    return Coordinates(changed)
