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

__all__ = ["logarithmic_where_certain", "scaled_coordinates"]

Array = NDArray[np.float64]

_LOG_WIDTH: Final = 5.0
_LINEAR_WIDTH: Final = 30.0
_CERTAIN: Final = 5.0


def scaled_coordinates(parameters: Sequence[Parameter], values: Array) -> Coordinates:
    """Coordinates of a model's parameters around known values.

    Args:
        parameters: Parameters of the model, the declared ones first.
        values: (n_parameter,) starting values of the right order of magnitude.
    """
    ra, kt = float(values[0]), float(values[2])
    scaled = []
    for parameter, value in zip(parameters, values, strict=True):
        if parameter.search == "log":
            scaled.append(replace(parameter, prior_mean=float(value), prior_sd=_LOG_WIDTH))
        elif parameter.name == "b":
            scale = abs(float(value)) + kt**2 / ra
            scaled.append(replace(parameter, scale=scale, prior_sd=_LINEAR_WIDTH))
        elif parameter.name == "L":
            scaled.append(replace(parameter, scale=float(value), prior_sd=_LINEAR_WIDTH))
        else:
            scaled.append(parameter)
    return Coordinates(scaled)


def logarithmic_where_certain(
    coordinates: Coordinates, values: Array, deviations: Array
) -> Coordinates:
    """The same coordinates with positive quantities that are certain not to be zero in logarithms.

    What runs determine best are ratios and products (b/J, Kt^2/Ra); where single factors are
    known less well than those, the posterior is a ridge that is straight in logarithms and bent
    in the quantities themselves.

    Args:
        coordinates: Coordinates of a fit.
        values: (n_parameter,) physical values at the optimum.
        deviations: (n_parameter,) their standard deviations [unit].
    """
    changed = []
    for parameter, value, deviation in zip(
        coordinates.parameters, values, deviations, strict=True
    ):
        positive = parameter.search == "linear" and parameter.lower >= 0.0
        if positive and value > _CERTAIN * deviation:
            parameter = replace(
                parameter, search="log", prior_mean=float(value), prior_sd=_LOG_WIDTH
            )
        changed.append(parameter)
    return Coordinates(changed)
