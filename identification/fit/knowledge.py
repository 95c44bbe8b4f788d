"""Known values as priors of a fit, with a z-test of each against the runs.

The test compares a known value with the estimate of the runs without it.  The precision p of that
estimate, from runs and general priors, is the curvature of the posterior along one parameter, all
others at their optimum (Schur complement), minus the curvature of the known value's own prior.  For
a known value m with standard deviation s and an estimate x,

    z = (x - m) / sqrt(1 / p + s^2)

is standard normal if both are right.  At the limit, one motor in a thousand with seven correct
values has one of them rejected (Bonferroni correction).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import norm

from identification.arrays import Array
from identification.fit.effective_samples import effective_fraction
from identification.fit.solve import Fit, solve
from identification.known import Prior
from identification.linear import solution
from identification.model.parameter import Coordinates, Parameter
from identification.nameplate import NAMEPLATE
from identification.quantities import DECLARED_PARAMETERS

__all__ = ["LIMIT", "Comparison", "Knowledge", "compared"]

_FALSE_ALARMS: Final = 1e-3
LIMIT: Final = float(norm.isf(0.5 * _FALSE_ALARMS / len(DECLARED_PARAMETERS)))
"""Largest |z|; beyond it the runs contradict a known value: 3.8."""

_NEAR: Final = 3.0
"""Ratio of a known value to the estimate of the runs, up to which one start is enough."""

_WORSE: Final = 3.0
_SEEN: Final = 0.01
"""A refit is rejected if its noise exceeds `_WORSE` times the noise of the fit plus this fraction
of the signal's standard deviation."""

_WITHOUT_TEMPERATURE: Final = {
    "Ra25": 0.1,
    "Kt25": 0.06,
    "alpha_Ra": math.inf,
    "alpha_Kt": math.inf,
}
"""Effect of 30 K on a winding and a magnet: a first run taken as 25 degC may have been that far
off."""

_NOTHING: Final = 1e-9
"""Precision of the runs over the curvature, below which it is rounding error."""


@dataclass(frozen=True)
class Comparison:
    """A known value and the estimate of the runs without it."""

    prior: Prior
    estimate: float
    """Estimate of the runs [unit of the parameter]."""
    sd: float
    """Its standard deviation, infinite if undetermined [unit of the parameter]."""
    distance: float
    """Difference over the combined standard deviation, z [-]."""
    unfitted: bool = False
    """True if no fit was found with it and the other known values."""

    @property
    def contradicts(self) -> bool:
        """True if the difference is significant."""
        return abs(self.distance) > LIMIT


@dataclass(frozen=True)
class Knowledge:
    """Prior knowledge of the user about a motor."""

    priors: tuple[Prior, ...] = ()
    """Known values, at most one per parameter."""
    friction: float | None = None
    """Upper bound of the viscous friction [N m s/rad]; None if the nameplate gives none."""
    general: tuple[Parameter, ...] = ()
    """Nominal parameters with the general priors."""

    def beside(self, fit: Fit) -> Knowledge:
        """Copy with the general priors of a fit without known values."""
        return replace(self, general=fit.coordinates.parameters[: len(DECLARED_PARAMETERS)])

    def joined_to(self, fit: Fit) -> tuple[Fit, tuple[Comparison, ...]]:
        """Fit with all known values that its runs do not contradict, and the rejected comparisons.

        Values that contradict the runs only jointly are rejected one by one, largest |z| first.
        Values with which no fit is found are rejected in the same way.
        """
        refused = self.contradictions(fit)
        for _ in self.priors:
            joined = self.used_in(fit, refused)
            names = {one.prior.name for one in refused}
            if joined is not None:
                more = [one for one in self.contradictions(joined) if one.prior.name not in names]
            else:
                more = [replace(one, unfitted=True) for one in self.compared(fit)]
                more = [one for one in more if one.prior.name not in names]
            if not more:
                return joined or fit, refused
            refused = (*refused, more[0])
        return self.used_in(fit, refused) or fit, refused

    def compared(self, fit: Fit) -> list[Comparison]:
        """Comparison of all known values under the model of a fit, largest |z| first."""
        fraction = effective_fraction(fit)
        found = [compared(fit, fraction, prior) for prior in self.priors]
        return sorted(found, key=lambda one: -abs(one.distance))

    def contradictions(self, fit: Fit) -> tuple[Comparison, ...]:
        """Known values that the runs contradict under the model of a fit, largest |z| first."""
        if not self.priors and self.friction is None:
            return ()
        found = [one for one in self.compared(fit) if one.contradicts]
        if self.friction is not None:
            bound = Prior("b", self.friction, 0.3 * self.friction, NAMEPLATE)
            own = compared(fit, effective_fraction(fit), bound)
            found += [own] if own.contradicts and own.estimate > self.friction else []
        return tuple(sorted(found, key=lambda one: -abs(one.distance)))

    def used_in(self, fit: Fit, refused: Sequence[Comparison]) -> Fit | None:
        """Fit with all known values as priors except the rejected ones; None if no fit is found."""
        names = {one.prior.name for one in refused}
        wanted = {p.name: p for p in self.general}
        wanted |= {
            prior.name: _with_prior(wanted[prior.name], prior)
            for prior in self.priors
            if prior.name not in names
        }
        friction = wanted.get("b")
        if self.friction is not None and friction is not None and "b" not in names:
            wanted["b"] = _bounded(friction, self.friction)
        parameters = [wanted.get(p.name, p) for p in fit.coordinates.parameters]
        if tuple(parameters) == fit.coordinates.parameters:
            return fit
        return _refitted(fit, Coordinates(parameters))


def compared(fit: Fit, fraction: float, prior: Prior) -> Comparison:
    """Compare a known value with the estimate of the runs alone, by a fit with or without it."""
    k = fit.coordinates.names.index(prior.name)
    parameter, position = fit.coordinates.parameters[k], float(fit.position[k])
    own = 1.0 / float(fit.coordinates.prior_sd[k]) ** 2
    precision = _precision(fit, fraction, k) - own
    spread = 0.0
    if fit.simulator.model.unlogged.is_relative:
        spread = _WITHOUT_TEMPERATURE.get(prior.name, 0.0)
    precision = 1.0 / (1.0 / precision + spread**2) if precision > 0 else 0.0
    slope = float(fit.coordinates.slopes(fit.position)[k])
    estimate = float(fit.values[k])
    if not precision > _NOTHING * float(fit.equations.matrix[k, k]):
        return Comparison(prior, estimate, math.inf, 0.0)
    # The optimum is the precision-weighted mean of the runs' estimate and the prior's centre.
    moved = own / precision * (position - float(fit.coordinates.prior_mean[k]))
    sd = 1.0 / math.sqrt(precision)
    if parameter.search == "log":
        estimate = math.exp(min(position + moved, 700.0))
        apart = position + moved - math.log(prior.value)
        distance = apart / math.hypot(sd, prior.sd / prior.value)
    else:
        estimate = slope * (position + moved)
        distance = (estimate - prior.value) / math.hypot(slope * sd, prior.sd)
    return Comparison(prior, estimate, slope * sd, distance)


def _precision(fit: Fit, fraction: float, k: int) -> float:
    """Inverse posterior variance of search coordinate `k`, all others free."""
    equations = fit.equations
    matrix = equations.precision(fraction)
    others = np.arange(matrix.shape[0]) != k
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(size, size)
    coupling = scaled[others, k]
    left = 1.0 - float(coupling @ solution(scaled[np.ix_(others, others)], coupling))
    return left * float(matrix[k, k])


def _refitted(fit: Fit, coordinates: Coordinates) -> Fit | None:
    """Better of two refits with other priors: from the optimum and from the known values.

    None if neither reproduces the runs.
    """
    far = fit.values.copy()
    for k, parameter in enumerate(coordinates.parameters):
        if parameter.origin and parameter.search == "log":
            known = parameter.prior_mean
            is_near = known / _NEAR < far[k] < known * _NEAR
            far[k] = far[k] if is_near else known
    found = _refitted_from(fit, coordinates, far)
    # A logarithmic coordinate cannot start from a friction of zero.
    logs = np.array([parameter.search == "log" for parameter in coordinates.parameters])
    near = np.where(logs & (fit.values <= 0.0), far, fit.values)
    if np.any(near != far):
        found = min(found, _refitted_from(fit, coordinates, near), key=lambda one: one.cost)
    measured = np.concatenate([record.measured for record in fit.simulator.records])
    most = _WORSE * fit.weighting.deviation + _SEEN * np.std(measured, axis=0)
    is_near = bool(np.all(found.weighting.deviation <= most))
    return found if np.isfinite(found.cost) and found.equations.is_finite and is_near else None


def _refitted_from(fit: Fit, coordinates: Coordinates, values: Array) -> Fit:
    """Refit with other priors, starting from physical values."""
    simulator, position = fit.simulator.suited_to(values), coordinates.of(values)
    return solve(simulator, coordinates, position, fit.states, fit.weighting)


def _with_prior(parameter: Parameter, prior: Prior) -> Parameter:
    """The parameter with a prior of the user; a positive one is searched in logarithms."""
    sd = prior.sd / parameter.scale
    if prior.is_size:
        lower = min(parameter.lower, 1e-3 * prior.value) if parameter.lower > 0 else 0.0
        parameter = replace(parameter, search="log", lower=lower, scale=1.0)
        sd = prior.sd / prior.value
    return replace(parameter, prior_mean=prior.value, prior_sd=sd, origin=prior.origin)


def _bounded(friction: Parameter, bound: float) -> Parameter:
    """Half-normal prior on a friction that the runs leave open, as wide as the no-load losses."""
    if friction.search == "log" or friction.origin:
        return friction
    return replace(friction, scale=bound, prior_mean=0.0, prior_sd=1.0, origin=NAMEPLATE)
