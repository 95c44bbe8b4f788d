"""Models that a further run has to tell apart or narrow, each with a normal approximation.

They come from the member ``models`` of a result, or from the nameplate of a motor never measured.
A run narrows a `Quantity` of such a model: a parameter, or a feedback metric at a temperature.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from identification.arrays import Array, Bool
from identification.errors import InputError, OptionError
from identification.linear import root
from identification.model.composite import MotorModel
from identification.nameplate import Nameplate
from identification.numerals import decimal_of
from identification.quantities import DECLARED_PARAMETERS
from identification.speed_loop import METRIC_UNITS, feedback_metrics
from identification.surrogates.entry import term_of

__all__ = [
    "DesignModel",
    "Quantity",
    "TYPICAL_ELECTRICAL_S",
    "models_of",
    "nameplate_models",
    "parameter_quantity",
    "quantity_of",
    "time_constants",
]

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
_STEP: Final = 1e-3
"""Largest step of a finite difference, in the coordinates of the fit."""
_INTERVAL: Final = 2.0 * 1.6448536269514722
"""Width of the equal-tailed 90 % interval of a normal distribution, in standard deviations."""


@dataclass(frozen=True)
class DesignModel:
    """A model with a normal approximation of the posterior of its parameters."""

    label: str
    """Effect type in which it differs; empty for the final model."""
    model: MotorModel
    estimate: Array
    """(n_parameter,) physical values."""
    logarithmic: Bool
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
        estimate = self.estimate[:, None]
        values = np.where(log, estimate * factor, estimate + scale * steps)
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


@dataclass(frozen=True)
class Quantity:
    """A quantity and its derivative by the coordinates of the final model."""

    name: str
    """As the user wrote it."""
    unit: str
    value: float
    """Its value at the estimate."""
    gradient: Array
    """(n_parameter,) derivative by the coordinates."""
    logarithmic: bool = False
    """True if its logarithm has the normal distribution, False if it has itself."""

    def width(self, covariance: Array) -> float:
        """Width of the 90 % interval for a covariance of the coordinates [unit]."""
        sd = math.sqrt(max(float(self.gradient @ covariance @ self.gradient), 0.0))
        if self.logarithmic:
            return 2.0 * self.value * math.sinh(min(0.5 * _INTERVAL * sd / self.value, 700.0))
        return _INTERVAL * sd


def quantity_of(text: str, model: DesignModel, controller: str) -> Quantity:
    """The quantity that a user names.

    It is a parameter of the final model, such as ``coulomb_friction.torque``, or a feedback metric
    METRIC@TEMPERATURE with a controller, such as ``rise_time_s@125`` with ``P:1``.

    Raises:
        OptionError: There is no such quantity, or the loop does not define it.
    """
    if text in model.names:
        return parameter_quantity(text, model)
    metric, at, where = text.partition("@")
    try:
        temperature = decimal_of(where) if at else math.nan
    except ValueError:
        temperature = math.nan
    if metric not in METRIC_UNITS or not math.isfinite(temperature):
        raise OptionError(
            f"narrow {text[:60]!r}: expected a parameter of the final model "
            f"({', '.join(model.names)}) or METRIC@TEMPERATURE with a metric of "
            f"{', '.join(METRIC_UNITS)}",
            value=text,
        )
    return _metric(text, metric, temperature, model, controller)


def parameter_quantity(name: str, model: DesignModel) -> Quantity:
    """A parameter of a model as a quantity."""
    k = model.names.index(name)
    gradient = np.zeros(len(model.names))
    gradient[k] = model.slopes[k]
    value, is_log = float(model.estimate[k]), bool(model.logarithmic[k])
    return Quantity(name, model.model.parameters[k].unit, value, gradient, is_log)


def _metric(
    text: str, metric: str, temperature: float, model: DesignModel, controller: str
) -> Quantity:
    sd = np.sqrt(np.diag(model.covariance))
    steps = np.minimum(_STEP, 0.1 * sd)
    moved = model.moved(np.concatenate([np.diag(steps), np.diag(-steps)], axis=1))
    values = np.concatenate([model.estimate[:, None], moved], axis=1)
    found = np.array([_value(one, metric, temperature, model, controller) for one in values.T])
    if not np.isfinite(found).all():
        raise OptionError(
            f"narrow {text!r}: the loop with {controller} at {temperature:g} degC does not define "
            f"{metric}; expected another metric, or a fit with another --controller",
            value=text,
        )
    up, down = np.split(found[1:], 2)
    gradient = np.where(steps > 0.0, (up - down) / np.maximum(2.0 * steps, 1e-300), 0.0)
    return Quantity(text, METRIC_UNITS[metric], float(found[0]), gradient)


def _value(
    values: Array, metric: str, temperature: float, model: DesignModel, controller: str
) -> float:
    motor = {
        name: float(value)
        for name, value in zip(model.names, values, strict=True)
        if name in DECLARED_PARAMETERS
    }
    (entry,) = feedback_metrics(motor, [temperature], [controller])
    quantity: Mapping[str, Any] = entry[metric] or {}
    median = quantity.get("median")
    return math.nan if median is None else float(median)
