"""Models that a further run has to tell apart or narrow, each with a normal approximation.

They come from the member ``models`` of a result, or from the nameplate of a motor never measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.errors import InputError, OptionError
from identification.linear import root
from identification.model.composite import MotorModel
from identification.nameplate import Nameplate
from identification.surrogates.entry import term_of

__all__ = ["TYPICAL_ELECTRICAL_S", "DesignModel", "models_of", "nameplate_models", "time_constants"]

_FARTHEST: Final = 3.0
"""Largest deviation of a draw along each principal axis, in standard deviations."""
_MECHANICAL: Final = (0.01, 0.05, 0.25)
"""Mechanical time constants of motors from a few watts to some kilowatts [s]."""
_MECHANICAL_SPREAD: Final = 0.8
TYPICAL_ELECTRICAL_S: Final = 1e-3
"""Electrical time constant of a motor whose inductance is not known [s]."""
_ELECTRICAL_SPREAD: Final = 1.0
_LOSS: Final = 0.05
"""No-load losses over the stall torque if no no-load current is given [-]."""
_REMEDY: Final = "repeat the fit with this version of motorid"


@dataclass(frozen=True)
class DesignModel:
    """A model with a normal approximation of the posterior of its parameters."""

    label: str
    """Effect type in which it differs; empty for the final model."""
    model: MotorModel
    estimate: Array
    """(n_parameter,) physical values."""
    logarithmic: NDArray[np.bool_]
    """(n_parameter,) whether the coordinate is the logarithm."""
    scale: Array
    """(n_parameter,) one unit of a linear coordinate."""
    covariance: Array
    """(n_parameter, n_parameter) of the coordinates."""
    probability: float = 1.0
    """Posterior probability [-]."""
    fraction: float = 1.0
    """Independent samples per sample [-]."""

    @property
    def names(self) -> tuple[str, ...]:
        """(n_parameter,) names."""
        return tuple(parameter.name for parameter in self.model.parameters)

    @property
    def slopes(self) -> Array:
        """Derivative of each physical value by its coordinate, (n_parameter,)."""
        return np.where(self.logarithmic, self.estimate, self.scale)

    def moved(self, steps: Array) -> Array:
        """Physical values (n_parameter, n_lane) at steps of the coordinates from the estimate."""
        log, scale = self.logarithmic[:, None], self.scale[:, None]
        factor = np.exp(np.clip(np.where(log, steps, 0.0), -50.0, 50.0))
        values = np.where(log, self.estimate[:, None] * factor, self.estimate[:, None])
        values = np.where(log, values, values + scale * steps)
        lower = np.array([parameter.lower for parameter in self.model.parameters])[:, None]
        upper = np.array([parameter.upper for parameter in self.model.parameters])[:, None]
        inside = np.clip(values, lower, upper)
        # An inductance of zero has no state equation.
        least = np.where(np.array(self.names) == "L", 1e-3 * np.abs(self.estimate), -np.inf)
        return np.asarray(np.maximum(inside, least[:, None]))

    def draws(self, count: int, seed: int) -> Array:
        """Physical values (n_parameter, count): the estimate, then draws of the approximation."""
        rng = np.random.default_rng(seed)
        normal = rng.standard_normal((self.estimate.size, count))
        normal = np.clip(normal, -_FARTHEST, _FARTHEST)
        normal[:, 0] = 0.0
        return self.moved(root(self.covariance) @ normal)


def models_of(result: Mapping[str, Any]) -> list[DesignModel]:
    """Final model of a result and the alternatives of its effects.

    Raises:
        InputError: The result has no member ``models``, or one that does not fit its terms.
    """
    entries = result.get("models")
    if not isinstance(entries, list) or not entries:
        raise InputError(
            "the result has no member 'models', from which a run is designed; " + _REMEDY
        )
    try:
        found = [_model(entry) for entry in entries]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"the member 'models' of the result is incomplete ({error}); {_REMEDY}"
        ) from error
    total = sum(model.probability for model in found)
    return [replace(model, probability=model.probability / total) for model in found]


def _model(entry: Mapping[str, Any]) -> DesignModel:
    model = MotorModel(tuple(term_of(term) for term in entry["terms"]), entry["hold"])
    parameters = entry["parameters"]
    found = DesignModel(
        label=entry["name"] or "",
        model=model,
        estimate=np.array([float(parameter["estimate"]) for parameter in parameters]),
        logarithmic=np.array([parameter["search"] == "log" for parameter in parameters]),
        scale=np.array([float(parameter["scale"]) for parameter in parameters]),
        covariance=np.array(entry["covariance"], dtype=np.float64),
        probability=float(entry["odds"]),
        fraction=float(entry["effective_fraction"]),
    )
    if tuple(parameter["name"] for parameter in parameters) != found.names:
        raise ValueError("the parameters do not match the terms")
    if found.covariance.shape != (len(parameters), len(parameters)):
        raise ValueError(f"the covariance has the shape {found.covariance.shape}")
    if not (np.isfinite(found.covariance).all() and np.isfinite(found.estimate).all()):
        raise ValueError("a number is not finite")
    return found


def nameplate_models(plate: Nameplate, stall_current: float) -> list[DesignModel]:
    """Nominal model of a nameplate, once for each typical mechanical time constant.

    Inertia and inductance are not on a nameplate.  Their priors follow from typical time constants:
    10, 50 and 250 ms with a factor of 2.2 for the mechanical one, 1 ms with a factor of 2.7 for the
    electrical one.

    Raises:
        OptionError: The nameplate does not determine both Ra25 and Kt25.
    """
    if plate.resistance is None or plate.constant is None:
        raise OptionError(
            "the nameplate determines only one of Ra25 and Kt25; expected voltage, no_load_speed "
            "and stall_current, or a rated point"
        )
    ra, kt, model = plate.resistance, plate.constant, MotorModel()
    speed = (stall_current * ra) / kt
    friction = plate.friction or _LOSS * kt * stall_current / speed
    spreads = {prior.name: prior.sd / prior.value for prior in plate.priors}
    logs = (spreads["Ra25"], spreads["Kt25"], _MECHANICAL_SPREAD, 1.0, _ELECTRICAL_SPREAD)
    sd = dict(zip(("Ra25", "Kt25", "J", "b", "L"), logs, strict=True))
    centre = {p.name: p.prior_mean for p in model.parameters}
    found = []
    for constant in _MECHANICAL:
        values = centre | {
            "Ra25": ra, "Kt25": kt, "J": constant * kt**2 / ra,
            "b": friction, "L": TYPICAL_ELECTRICAL_S * ra,
        }  # fmt: skip
        found.append(
            DesignModel(
                label=f"mechanical time constant {1e3 * constant:g} ms",
                model=model,
                estimate=np.array([values[p.name] for p in model.parameters]),
                logarithmic=np.array([p.name in sd for p in model.parameters]),
                scale=np.array([1.0 if p.name in sd else p.scale for p in model.parameters]),
                covariance=np.diag([sd.get(p.name, p.prior_sd) ** 2 for p in model.parameters]),
                probability=1.0 / len(_MECHANICAL),
            )
        )
    return found


def time_constants(models: Sequence[DesignModel]) -> tuple[float, float]:
    """Shortest and longest time constant of the nominal equations, limited to 0.1 ms and 10 s."""
    shortest, longest = math.inf, 0.0
    for one in models:
        value = dict(zip(one.names, map(float, one.estimate), strict=True))
        electrical = value["L"] / value["Ra25"]
        mechanical = value["J"] / (value["Kt25"] ** 2 / value["Ra25"] + value["b"])
        shortest = min(shortest, electrical, mechanical)
        longest = max(longest, electrical, mechanical)
    return max(shortest, 1e-4), min(max(longest, 1e-3), 10.0)
