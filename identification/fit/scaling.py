"""Search coordinates of a motor of unknown size.

A watch motor and a traction motor differ by seven decades of inertia, so the scales and the
centres of the broad priors come from the starting values.  The priors only keep what the data do
not say finite: five standard deviations of a logarithm of width five span twenty decades.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.model.parameter import Coordinates, Parameter

__all__ = ["linear_where_uncertain", "scaled_coordinates"]

Array = NDArray[np.float64]

_LOG_WIDTH: Final = 5.0
_LINEAR_WIDTH: Final = 30.0
_CERTAIN: Final = 5.0
_LEAST: Final = 1e-4
_MAY_VANISH: Final = ("b", "L")


def scaled_coordinates(parameters: Sequence[Parameter], values: Array) -> Coordinates:
    """Coordinates of a model's parameters around known values.

    What runs determine best are ratios and products (b/J, Kt^2/Ra); where single factors are
    known less well than those, the cost is a valley that is straight in logarithms and bent in the
    quantities themselves, so all positive quantities are searched in logarithms.

    Args:
        parameters: Parameters of the model, the declared ones first.
        values: (n_parameter,) starting values of the right order of magnitude.
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


def linear_where_uncertain(
    coordinates: Coordinates, values: Array, deviations: Array
) -> Coordinates:
    """The same coordinates with quantities that may be zero for all the data say made linear.

    Near zero a logarithm runs away without the data noticing; a linear coordinate with a bound at
    zero has a posterior that stays a (cut) normal.

    Args:
        coordinates: Coordinates of a fit.
        values: (n_parameter,) physical values at the optimum.
        deviations: (n_parameter,) their standard deviations [unit].
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
