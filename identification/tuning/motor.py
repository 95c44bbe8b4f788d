"""Identified motor with its uncertainty: model of the closed loop and draws of all parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from identification.arrays import Array, evenly
from identification.errors import InputError, OptionError
from identification.model.composite import MotorModel
from identification.prediction import hottest_of, model_of
from identification.quantities import REFERENCE_TEMPERATURE_DEGC
from identification.speed_loop.closed_loop import acting_terms
from identification.speed_loop.loop import motor_draws, plant
from identification.speed_loop.nonlinear import with_some_inductance

__all__ = ["UncertainMotor", "motor_of"]


@dataclass(frozen=True)
class UncertainMotor:
    """Motor whose parameters are known by draws."""

    model: MotorModel
    """Nominal model with the effects that act in a closed loop."""
    values: Array
    """(n_parameter, n_draw) physical, in the order of `model.parameters`."""
    omitted: tuple[str, ...] = ()
    """Names of the effects of the result that do not act in the loop."""
    peak: float = REFERENCE_TEMPERATURE_DEGC
    """Highest temperature that the motor has had [degC]."""

    @property
    def count(self) -> int:
        """Number of draws."""
        return int(self.values.shape[1])

    @property
    def draws(self) -> dict[str, Array]:
        """(n_draw,) for each parameter."""
        return dict(zip((p.name for p in self.model.parameters), self.values, strict=True))

    def thinned(self, most: int) -> UncertainMotor:
        """The motor with at most `most` draws, evenly spaced."""
        return replace(self, values=self.values[:, evenly(self.count, most)])

    def plants(self, temperature: float) -> tuple[Array, Array]:
        """Gain and denominator of the linear motor for each draw, as `speed_loop.loop.plant`."""
        return plant(self.draws, temperature)


def motor_of(
    draws: Mapping[str, ArrayLike], result: Mapping[str, Any] | None = None
) -> UncertainMotor:
    """Motor of a result with its posterior draws, or of nominal parameters alone.

    A parameter of an effect without draws keeps its estimate; other names are ignored.

    Raises:
        OptionError: A nominal parameter is missing or not accepted.
        InputError: The result lacks a parameter or an effect.
    """
    whole, estimate = MotorModel(()), dict[str, float]()
    if result is not None:
        whole, values = model_of(result)
        estimate = dict(zip((p.name for p in whole.parameters), values, strict=True))
    model = MotorModel(acting_terms(whole))
    omitted = tuple(term.name for term in whole.terms if term not in model.terms)
    runs = [run for run in (result or {}).get("runs") or () if isinstance(run, Mapping)]
    peak = hottest_of(runs, REFERENCE_TEMPERATURE_DEGC)
    nominal = motor_draws({"alpha_Ra": 0.0, "alpha_Kt": 0.0, **draws}, [0.0])
    count = nominal["J"].size
    rows = dict(nominal)
    for parameter in model.parameters[len(nominal) :]:
        value = draws.get(parameter.name, estimate.get(parameter.name))
        if value is None:
            raise InputError(f"no value of {parameter.name}; expected a result of 'motorid fit'")
        rows[parameter.name] = np.broadcast_to(np.asarray(value, dtype=np.float64), (count,))
    if not nominal["Kt25"].all():
        raise OptionError("Kt25 is 0 N m/A; expected a number above 0: no controller moves it")
    rows = with_some_inductance(rows)
    return UncertainMotor(model, np.array([rows[p.name] for p in model.parameters]), omitted, peak)
