"""A parameter of a model: its name, unit, bounds and how it is searched.

Parameters of a motor span ten decades, so nothing is ever searched in SI units.  A *coordinate*
is what the fit and the sampler move: the logarithm of a positive quantity, or a quantity divided
by its natural scale.  Physical values appear only inside the equations and in the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["Coordinates", "Parameter"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """One parameter of a term or of the declared model.

    Args:
        name: Name in the result.
        unit: Unit in the result.
        meaning: One phrase for the report.
        search: ``log`` searches the logarithm (positive quantities that may span decades);
            ``linear`` searches the quantity over `scale`.
        lower: Physical lower bound [unit].
        upper: Physical upper bound [unit].
        scale: Natural size [unit]; for ``linear`` the size of one coordinate step.
        prior_mean: Centre of the normal prior, in the coordinate's terms of `search` (the
            physical value whose coordinate is the centre) [unit].
        prior_sd: Standard deviation of the normal prior of the coordinate; infinity for a prior
            that is flat between the bounds.
        origin: Option by which a user gave the prior; empty where it is general knowledge.
    """

    name: str
    unit: str
    meaning: str
    search: Literal["log", "linear"] = "linear"
    lower: float = -np.inf
    upper: float = np.inf
    scale: float = 1.0
    prior_mean: float = 0.0
    prior_sd: float = np.inf
    origin: str = ""

    @property
    def vanishes(self) -> bool:
        """Whether zero is its neutral value: the size of an effect, an asymmetry."""
        return self.search == "linear" and self.prior_mean == 0.0


class Coordinates:
    """The map between physical values and search coordinates of a list of parameters.

    Args:
        parameters: The parameters, in the order of every vector that goes through this map.
    """

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        self.parameters = tuple(parameters)
        self.names = tuple(parameter.name for parameter in parameters)
        self._log = np.array([parameter.search == "log" for parameter in parameters], dtype=bool)
        self._scale = np.array(
            [1.0 if parameter.search == "log" else parameter.scale for parameter in parameters]
        )
        with np.errstate(divide="ignore"):
            self.lower = self.of(
                np.array(
                    [p.lower if p.search == "linear" else max(p.lower, 0.0) for p in parameters]
                )
            )
            self.upper = self.of(np.array([p.upper for p in parameters]))
        self.prior_mean = self.of(
            np.array(
                [
                    p.prior_mean if p.search == "linear" or p.prior_mean > 0 else 1.0
                    for p in parameters
                ]
            )
        )
        self.prior_sd = np.array([p.prior_sd for p in parameters])

    def of(self, values: Array) -> Array:
        """Coordinates of physical values (n_parameter, ...)."""
        log = self._shaped(self._log, values)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(
                log, np.log(np.where(log, values, 1.0)), values / self._shaped(self._scale, values)
            )

    def values(self, coordinates: Array) -> Array:
        """Physical values of coordinates (n_parameter, ...)."""
        log = self._shaped(self._log, coordinates)
        with np.errstate(over="ignore"):
            return np.where(
                log,
                np.exp(np.where(log, coordinates, 0.0)),
                coordinates * self._shaped(self._scale, coordinates),
            )

    def mirrored(self, coordinates: Array) -> Array:
        """Coordinates (n_parameter, ...) with those out of bounds mirrored at their bound."""
        lower, upper = (self._shaped(x, coordinates) for x in (self.lower, self.upper))
        inner = np.where(coordinates < lower, 2 * lower - coordinates, coordinates)
        inner = np.where(inner > upper, 2 * upper - inner, inner)
        return np.clip(inner, lower, upper)

    def slopes(self, coordinates: Array) -> Array:
        """Derivative of each physical value by its own coordinate (n_parameter,)."""
        return np.where(self._log, np.exp(np.where(self._log, coordinates, 0.0)), self._scale)

    def log_prior(self, coordinates: Array) -> Array:
        """Log prior density of coordinates (n_parameter, ...), minus infinity out of bounds."""
        lower, upper = (self._shaped(x, coordinates) for x in (self.lower, self.upper))
        inside = np.all((coordinates >= lower) & (coordinates <= upper), axis=0)
        deviation = (coordinates - self._shaped(self.prior_mean, coordinates)) / self._shaped(
            self.prior_sd, coordinates
        )
        with np.errstate(over="ignore", invalid="ignore"):
            density = -0.5 * np.sum(deviation**2, axis=0)
        return np.where(inside, density, -np.inf)

    @staticmethod
    def _shaped(vector: NDArray[Any], like: Array) -> NDArray[Any]:
        shaped: NDArray[Any] = vector.reshape(vector.shape + (1,) * (np.ndim(like) - 1))
        return shaped
