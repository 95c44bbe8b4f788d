"""Which parameters the runs determine at all.

The question is put to the data alone, without the priors: the curvature of the likelihood.  A
parameter is called identified where its standard deviation by the data is small against the
quantity itself or, for temperature coefficients and for shapes that may lie anywhere between two
bounds, against what is known of them beforehand.

Values that a user knows count where the question is what runs and user determine together: a known
inertia tells the friction that runs give as a ratio to it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.fit.solve import Fit
from identification.linear import eigh
from identification.model.declared import DECLARED
from identification.model.parameter import Parameter

__all__ = ["identified"]

Array = NDArray[np.float64]

_RELATIVE: Final = 1.0 / 3.0
"""Three standard deviations away from zero."""

_PRIOR_SHARE: Final = 0.5
"""The data have to say more than half of what the prior says already."""

_ABSENT: Final = 1e-12
"""Eigenvalue of the scaled information, the largest near one, below which nothing is known."""
_ROUNDED: Final = 1e-8
"""Squared share of a parameter in a direction, below which it has no part in it."""


_GENERAL: Final = {parameter.name: parameter.prior_sd for parameter in DECLARED}


def identified(
    fit: Fit, share: float, added: Array | None = None, *, by_runs: bool = False
) -> dict[str, bool]:
    """Whether each parameter of the fit is determined by the data and by known values.

    Args:
        fit: The fit.
        share: Effective share of the samples, see `effective_share`.
        added: (n_parameter,) variances that are added to those by the data, in search
            coordinates, for what the model lacks.
        by_runs: Whether known values are left out of account.
    """
    known = np.array([bool(p.origin) and not by_runs for p in fit.coordinates.parameters])
    deviations = _data_deviations(fit, share, known)
    if added is not None:
        deviations = np.sqrt(deviations**2 + added)
    slopes = fit.coordinates.slopes(fit.position)
    answer = {}
    for k, parameter in enumerate(fit.coordinates.parameters):
        physical = deviations[k] * slopes[k]
        is_size = parameter.lower >= 0.0 and (parameter.vanishes or np.isinf(parameter.upper))
        if parameter.search == "log" or is_size:
            estimate = fit.values[k] * (_moved(fit, k, deviations[k]) if by_runs else 1.0)
            answer[parameter.name] = bool(physical < _RELATIVE * abs(estimate))
        else:
            answer[parameter.name] = bool(deviations[k] < _PRIOR_SHARE * _beforehand(parameter))
    return answer


def _moved(fit: Fit, k: int, deviation: float) -> float:
    """Factor from a value that a known one holds to the one that the runs have without it.

    The optimum is the mean of the two, weighted with their precisions.
    """
    parameter = fit.coordinates.parameters[k]
    if not parameter.origin or parameter.search != "log" or not np.isfinite(deviation):
        return 1.0
    step = float(fit.position[k] - fit.coordinates.prior_mean[k])
    return float(np.exp(np.clip(step * (deviation / fit.coordinates.prior_sd[k]) ** 2, -50, 50)))


def _beforehand(parameter: Parameter) -> float:
    """Standard deviation of what is known in general, in search coordinates."""
    return _GENERAL[parameter.name] if parameter.origin else parameter.prior_sd


def _data_deviations(fit: Fit, share: float, known: NDArray[np.bool_]) -> Array:
    """(n_parameter,) standard deviations in search coordinates, infinite where undetermined."""
    information = share * fit.equations.information
    if known.any():
        information = information + np.diag(np.where(known, fit.coordinates.prior_sd, np.inf) ** -2)
    size = np.sqrt(np.maximum(np.diag(information), 0.0))
    seen = size > 0
    deviations = np.full(size.size, np.inf)
    scaled = information[np.ix_(seen, seen)] / np.outer(size[seen], size[seen])
    values, vectors = eigh(scaled)
    inverse = np.where(values > _ABSENT, 1.0 / np.maximum(values, _ABSENT), 1.0 / _ABSENT**2)
    # In a direction that the data do not show, rounding leaves a little of every parameter.
    shares = np.where((values <= _ABSENT) & (vectors**2 < _ROUNDED), 0.0, vectors**2)
    variance = shares @ inverse
    deviations[seen] = np.sqrt(variance) / size[seen]
    return deviations
