"""Search coordinates for a motor of unknown size.

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
from identification.model.parameter import Coordinates, Parameter

__all__ = ["linear_where_uncertain", "scaled_coordinates"]

_LOG_WIDTH: Final = 5.0
_LINEAR_WIDTH: Final = 30.0
_CERTAIN: Final = 5.0
_LEAST: Final = 1e-4
_MAY_VANISH: Final = ("b", "L")


def scaled_coordinates(parameters: Sequence[Parameter], values: Array) -> Coordinates:
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


def linear_where_uncertain(
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
