"""Model parameters: names, units, bounds, priors and search coordinates.

The parameters of a motor span ten decades, so the fit and the sampler do not work in SI units.
They work in *coordinates*: the logarithm of a positive quantity, or a quantity divided by its
natural scale.  Physical values appear only in the equations and in the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array

__all__ = ["Coordinates", "Parameter"]

Number = TypeVar("Number", np.float64, np.bool_)


@dataclass(frozen=True)
class Parameter:
    """One parameter of a term or of the nominal model."""

    name: str
    """Name in the result."""
    unit: str
    """Unit in the result."""
    meaning: str
    """Short description for the report."""
    search: Literal["log", "linear"] = "linear"
    """Type of coordinate: ``log`` for the logarithm (positive quantities that may span decades),
    ``linear`` for the quantity divided by `scale`."""
    lower: float = -np.inf
    """Physical lower bound [unit]."""
    upper: float = np.inf
    """Physical upper bound [unit]."""
    scale: float = 1.0
    """Natural size, equal to one unit of a ``linear`` coordinate [unit]."""
    prior_mean: float = 0.0
    """Physical value at the centre of the normal prior of the coordinate [unit]."""
    prior_sd: float = np.inf
    """Standard deviation of the normal prior of the coordinate; infinite for a prior that is flat
    between the bounds."""
    origin: str = ""
    """Command-line option that set the prior; empty for a prior from general knowledge."""

    @property
    def vanishes(self) -> bool:
        """True if the neutral value is zero, as for the size of an effect or an asymmetry."""
        return self.search == "linear" and self.prior_mean == 0.0


class Coordinates:
    """Map between physical values and search coordinates of parameters, in the given order."""

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        self.parameters = tuple(parameters)
        self.names = tuple(parameter.name for parameter in parameters)
        self._log = np.array([parameter.search == "log" for parameter in parameters], dtype=bool)
        self._scale = np.array(
            [1.0 if parameter.search == "log" else parameter.scale for parameter in parameters]
        )
        lower = [p.lower if p.search == "linear" else max(p.lower, 0.0) for p in parameters]
        centre = [
            p.prior_mean if p.search == "linear" or p.prior_mean > 0 else 1.0 for p in parameters
        ]
        self.lower = self.of(np.array(lower))
        self.upper = self.of(np.array([p.upper for p in parameters]))
        self.prior_mean = self.of(np.array(centre))
        self.prior_sd = np.array([p.prior_sd for p in parameters])

    def of(self, values: Array) -> Array:
        """Coordinates of physical values, both (n_parameter, ...)."""
        log = self._shaped(self._log, values)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(
                log, np.log(np.where(log, values, 1.0)), values / self._shaped(self._scale, values)
            )

    def values(self, coordinates: Array) -> Array:
        """Physical values of coordinates, both (n_parameter, ...)."""
        log = self._shaped(self._log, coordinates)
        with np.errstate(over="ignore"):
            return np.where(
                log,
                np.exp(np.where(log, coordinates, 0.0)),
                coordinates * self._shaped(self._scale, coordinates),
            )

    def mirrored(self, coordinates: Array) -> Array:
        """Coordinates (n_parameter, ...), reflected at a bound where they exceed it."""
        lower, upper = (self._shaped(x, coordinates) for x in (self.lower, self.upper))
        inner = np.where(coordinates < lower, 2 * lower - coordinates, coordinates)
        inner = np.where(inner > upper, 2 * upper - inner, inner)
        return np.clip(inner, lower, upper)

    def moved(self, coordinates: Array, changes: Array) -> Array:
        """Coordinates (n_parameter, ...) after changes that are linear in the physical values.

        A change of a logarithm is one relative to the value, reflected at zero.
        """
        ratio = np.maximum(np.abs(1.0 + changes), np.finfo(np.float64).tiny)
        log = self._shaped(self._log, coordinates)
        return coordinates + np.where(log, np.log(ratio), changes)

    def slopes(self, coordinates: Array) -> Array:
        """Derivative of each physical value with respect to its coordinate, (n_parameter,)."""
        return np.where(self._log, np.exp(np.where(self._log, coordinates, 0.0)), self._scale)

    def log_prior(self, coordinates: Array) -> Array:
        """Unnormalised log prior density of coordinates (n_parameter, ...); -inf out of bounds."""
        lower, upper = (self._shaped(x, coordinates) for x in (self.lower, self.upper))
        inside = np.all((coordinates >= lower) & (coordinates <= upper), axis=0)
        deviation = (coordinates - self._shaped(self.prior_mean, coordinates)) / self._shaped(
            self.prior_sd, coordinates
        )
        with np.errstate(over="ignore", invalid="ignore"):
            density = -0.5 * np.sum(deviation**2, axis=0)
        return np.where(inside, density, -np.inf)

    @staticmethod
    def _shaped(vector: NDArray[Number], like: Array) -> NDArray[Number]:
        return vector.reshape(vector.shape + (1,) * (np.ndim(like) - 1))
