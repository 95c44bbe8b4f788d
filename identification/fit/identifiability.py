"""Practical identifiability of the parameters, by the Fisher information of the runs.

The priors are excluded; only the curvature of the likelihood counts.  A parameter is identified if
its standard deviation is below a third of its estimate.  A temperature coefficient, or a shape
parameter between two bounds, is identified if its standard deviation is below half that of its
prior.  Where no run has a logged temperature, no temperature difference is known, so neither
temperature coefficient of the nominal model is identified unless the user knows one of them.

Runs near 25 degC determine the values at 25 degC: over the few kelvins between, the whole range of
the temperature coefficients of real motors changes a value by less than a thermometer can resolve.

Known values of the user count as information unless `by_runs` is set.  A known inertia, for
example, determines a friction that the runs give only as a ratio to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.fit.solve import Fit
from identification.linear import eigh
from identification.model.declared import DECLARED
from identification.quantities import REFERENCE_TEMPERATURE_DEGC

__all__ = ["Precision", "identified", "precision_of"]

_RELATIVE: Final = 1.0 / 3.0
"""Largest relative standard deviation: the estimate is three standard deviations from zero."""

_PRIOR_SHARE: Final = 0.5
"""Largest standard deviation from the data, over that of the prior."""

_ABSENT: Final = 1e-12
"""Eigenvalue of the scaled information (the largest is near one), below which a direction is
undetermined."""
_ROUNDED: Final = 1e-8
"""Squared component of a parameter in a direction, below which it is rounding error."""


_COEFFICIENTS: Final = ("alpha_Ra", "alpha_Kt")

_NEAR: Final = 5.0
"""Largest difference between the mean temperature of the runs and 25 degC that a value at 25 degC
bridges with the general prior of its coefficient: 1.5 % of the resistance [K]."""

_GENERAL: Final = {parameter.name: parameter.prior_sd for parameter in DECLARED}
"""Standard deviations of the general priors, in search coordinates."""


@dataclass(frozen=True)
class Precision:
    """Precision of one parameter by the data."""

    estimate: float
    """The estimate that the criterion uses [unit]."""
    sd: float
    """Standard deviation by the data; infinite if undetermined [unit]."""
    limit: float
    """Standard deviation below which the parameter is identified [unit]."""
    is_bridged: bool
    """True if the general prior of the temperature coefficients suffices to identify it."""

    @property
    def identified(self) -> bool:
        """True if the data determine the parameter."""
        return bool(self.sd < self.limit)


def identified(
    fit: Fit, fraction: float, added: Array | None = None, *, by_runs: bool = False
) -> dict[str, bool]:
    """True if the data, with the known values, determine each parameter; see `precision_of`."""
    found = precision_of(fit, fraction, added, by_runs=by_runs)
    return {name: precision.identified for name, precision in found.items()}


def precision_of(
    fit: Fit, fraction: float, added: Array | None = None, *, by_runs: bool = False
) -> dict[str, Precision]:
    """Precision of each parameter of the fit by the data and the known values.

    `fraction` is that of `effective_fraction`; `added` (n_parameter,) are variances for omitted
    terms, in search coordinates; with `by_runs` known values are ignored.
    """
    known = np.array([bool(p.origin) and not by_runs for p in fit.coordinates.parameters])
    coefficients = np.array([name in _COEFFICIENTS for name in fit.coordinates.names])
    deviations = _data_deviations(fit, fraction, known)
    bridged = _data_deviations(fit, fraction, known | coefficients)
    if _is_near_reference(fit):
        deviations = np.where(coefficients, deviations, bridged)
    if added is not None:
        deviations, bridged = np.sqrt(deviations**2 + added), np.sqrt(bridged**2 + added)
    if all(record.expected is not None for record in fit.simulator.records):
        deviations[coefficients & ~known.any(where=coefficients)] = np.inf
    slopes = fit.coordinates.slopes(fit.position)
    answer = {}
    for k, parameter in enumerate(fit.coordinates.parameters):
        is_size = parameter.lower >= 0.0 and (parameter.vanishes or np.isinf(parameter.upper))
        estimate = float(fit.values[k])
        if parameter.search == "log" or is_size:
            estimate *= _moved(fit, k, deviations[k]) if by_runs else 1.0
            limit = _RELATIVE * abs(estimate)
        else:
            general = _GENERAL[parameter.name] if parameter.origin else parameter.prior_sd
            limit = _PRIOR_SHARE * general * slopes[k]
        sd, is_bridged = float(deviations[k] * slopes[k]), bool(bridged[k] * slopes[k] < limit)
        answer[parameter.name] = Precision(estimate, sd, float(limit), is_bridged)
    return answer


def _is_near_reference(fit: Fit) -> bool:
    """True if the mean temperature of the runs is within `_NEAR` of 25 degC."""
    mean = float(np.mean(np.concatenate([r.column("temperature") for r in fit.simulator.records])))
    return abs(mean - REFERENCE_TEMPERATURE_DEGC) <= _NEAR


def _moved(fit: Fit, k: int, deviation: float) -> float:
    """Ratio of the estimate from the runs alone to the estimate with a known value.

    The estimate with a known value is the precision-weighted mean of that value and the estimate of
    the runs.
    """
    parameter = fit.coordinates.parameters[k]
    if not parameter.origin or parameter.search != "log" or not np.isfinite(deviation):
        return 1.0
    step = float(fit.position[k] - fit.coordinates.prior_mean[k])
    return float(np.exp(np.clip(step * (deviation / fit.coordinates.prior_sd[k]) ** 2, -50, 50)))


def _data_deviations(fit: Fit, fraction: float, known: NDArray[np.bool_]) -> Array:
    """(n_parameter,) standard deviations in search coordinates, infinite where undetermined."""
    information = fraction * fit.equations.information
    if known.any():
        information = information + np.diag(np.where(known, fit.coordinates.prior_sd, np.inf) ** -2)
    size = np.sqrt(np.maximum(np.diag(information), 0.0))
    seen = size > 0
    deviations = np.full(size.size, np.inf)
    scaled = information[np.ix_(seen, seen)] / np.outer(size[seen], size[seen])
    values, vectors = eigh(scaled)
    inverse = np.where(values > _ABSENT, 1.0 / np.maximum(values, _ABSENT), 1.0 / _ABSENT**2)
    # Rounding leaves a small component of every parameter in an undetermined direction.
    shares = np.where((values <= _ABSENT) & (vectors**2 < _ROUNDED), 0.0, vectors**2)
    variance = shares @ inverse
    deviations[seen] = np.sqrt(variance) / size[seen]
    return deviations
