"""Quantity that a run has to narrow: a parameter, or a feedback metric at a temperature."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from identification.arrays import Array
from identification.design.models import DesignModel
from identification.errors import OptionError
from identification.numerals import decimal_of
from identification.quantities import DECLARED_PARAMETERS
from identification.speed_loop import METRIC_UNITS, feedback_metrics

__all__ = ["Quantity", "parameter_quantity", "quantity_of"]

_STEP: Final = 1e-3
"""Largest step of a finite difference, in the coordinates of the fit."""
_INTERVAL: Final = 2.0 * 1.6448536269514722
"""Width of the equal-tailed 90 % interval of a normal distribution, in standard deviations."""


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
    """Whether its logarithm, and not itself, has the normal distribution."""

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
    found = np.array([_value(values[:, k], metric, temperature, model, controller)
                      for k in range(values.shape[1])])  # fmt: skip
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
