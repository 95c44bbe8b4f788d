"""Fits of models with an unlogged angle: corrections of the angle alternate with fits.

Angles and parameters depend on each other.  At wrong angles, a fit to the optimum moves the
parameters to what the wrong phases require, so that only a few steps are worth taking before the
angles are corrected again (`order_tracking.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.fit.autoregression import autoregression, spectrum
from identification.fit.order_tracking import is_tracked, path_penalty, tracked
from identification.fit.solve import Fit, TerminationLimits, continued, renewed, solve
from identification.model.parameter import Coordinates
from identification.model.simulate import Simulator
from identification.model.weighting import Weighting

__all__ = ["retracked", "slow_noise", "solve_tracked", "tracking_penalty"]

_ENOUGH: Final = 1e-4
"""Gain per sample below which another correction of the angles is not worth its fit [log
likelihood]: the residual changes by a ten-thousandth."""
_ROUGHLY: Final = 1e-3
"""The same for corrections between short fits, which a fit to the optimum follows."""
_SHORT: Final = 3
"""Steps of a fit between two corrections: at wrong angles, further steps only move the parameters
to what the wrong phases require."""
_CORRECTIONS: Final = 12
"""Alternations of correction and fit at most."""
_PASSES: Final = 3
"""Fits to the optimum at most."""
_FREQUENCIES: Final = 1024
"""Frequencies over which the power of the noise is averaged."""


def slow_noise(fit: Fit) -> float:
    """Slow noise of the speed over its noise, at least 1 [-].

    It is the noise of white noise with the same power at frequency zero, and decides how fast an
    integrated angle drifts.  The residual of a fit shows it once the angles are tracked for white
    noise.
    """
    speeds = [
        residual[:, 1] * np.sqrt(fit.weighting.sample_weights(k)[:, 1])
        for k, residual in enumerate(fit.residuals())
    ]
    power = float(spectrum(autoregression(speeds), _FREQUENCIES)[0])
    return float(np.sqrt(max(power, 1.0)))


def tracking_penalty(fit: Fit, fraction: float) -> float:
    """Reduction of the log evidence by the tracked angles [log likelihood].

    The likelihood is multiplied by the effective sample fraction [-].
    """
    if not is_tracked(fit.simulator.model):
        return 0.0
    noise = fit.weighting.deviation
    return path_penalty(fit.simulator, fit.values, fit.states, noise, slow_noise(fit), fraction)


def retracked(fit: Fit, limits: TerminationLimits | None = None) -> Fit:
    """The fit with the angles tracked at its optimum, or the fit itself if that is no better.

    Angles and parameters depend on each other: corrections alternate with short fits until one
    gains hardly anything.  Then the fit goes to the optimum, and is corrected again: for white
    noise of the speed first, then for the noise that the residual shows.
    """
    if not is_tracked(fit.simulator.model):
        return fit
    fit = _retracked(fit, 1.0, limits)
    slow = slow_noise(fit)
    return _retracked(fit, slow, limits) if slow > 1.0 else fit


def _retracked(fit: Fit, slow: float, limits: TerminationLimits | None) -> Fit:
    """The fit with the angles tracked for a slow noise of the speed over its noise [-]."""
    short, enough = _shortened(limits), _ROUGHLY
    for _ in range(_PASSES):
        better = _alternated(fit, short, enough, slow)
        if better is fit:
            break
        fit, enough = renewed(continued(better, limits), limits), _ENOUGH
    return fit


def _alternated(fit: Fit, limits: TerminationLimits, enough: float, slow: float) -> Fit:
    """The fit after corrections of the angles, each followed by a refit that gains enough."""
    least = enough * float(fit.weighting.counts.sum())
    for _ in range(_CORRECTIONS):
        noise = fit.weighting.deviation
        simulator, states = tracked(fit.simulator, fit.values, fit.states, noise, slow)
        if simulator is fit.simulator:
            break
        weighting = replace(fit.weighting, records=simulator.records)
        other = solve(simulator, fit.coordinates, fit.position, states, weighting, limits)
        gain = fit.cost - other.cost
        if gain > 0.0:
            fit = other
        if not gain > least:
            break
    return fit


def solve_tracked(
    simulator: Simulator,
    coordinates: Coordinates,
    position: Array,
    states: Sequence[Array],
    weighting: Weighting,
    limits: TerminationLimits | None = None,
) -> Fit:
    """Fit as `solve` does, whose angles are tracked from its first steps on.

    The arguments are those of `solve`; a model without a tracked angle is only fitted.
    """
    if not is_tracked(simulator.model):
        return solve(simulator, coordinates, position, states, weighting, limits)
    first = solve(simulator, coordinates, position, states, weighting, _shortened(limits))
    found = retracked(first, limits)
    return renewed(continued(found, limits), limits) if found is first else found


def _shortened(limits: TerminationLimits | None) -> TerminationLimits:
    """The limits with the few steps that are worth taking before the angles are corrected."""
    limits = limits or TerminationLimits()
    return replace(limits, steps=min(_SHORT, limits.steps))
