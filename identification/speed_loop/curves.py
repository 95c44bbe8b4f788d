"""Closed-loop step responses with posterior bands, for plotting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from identification.arrays import Array
from identification.speed_loop.controller import AbstractController, parse_controllers
from identification.speed_loop.loop import close, motor_draws
from identification.speed_loop.spread import checked_temperatures
from identification.speed_loop.step_response import StepResponse, step_metrics

__all__ = ["StepCurve", "step_curves"]

# A settling loop is plotted for 1.4 settling times, an unstable one until its fastest mode has
# grown by e^3.
_BEYOND_SETTLING: Final = 1.4
_GROWTHS: Final = 3.0
_LARGEST_DRAWN: Final = 1e9


@dataclass(frozen=True)
class StepCurve:
    """Speed after a reference step of 1 rad/s: pointwise median and 90 % band over the draws."""

    temperature_degC: float  # noqa: N815
    """Temperature of winding and magnet [degC]."""
    controller: str
    """Controller as the user gave it, such as ``PI:2,10``."""
    time: Array
    """(n_time,) increasing from zero [s]."""
    median: Array
    """(n_time,) [rad/s]."""
    q05: Array
    """(n_time,) [rad/s]."""
    q95: Array
    """(n_time,) [rad/s]."""


def step_curves(
    draws: Mapping[str, ArrayLike],
    temperatures: Sequence[float],
    controllers: Sequence[str | AbstractController],
    n_time: int = 300,
    most_draws: int = 500,
) -> list[StepCurve]:
    """Exact step responses on a time grid, for plotting; no metric is computed from the grid.

    All temperatures of one controller share the grid, so their curves can be overlaid.

    Args:
        draws: As for `feedback_metrics`.
        temperatures: Temperatures of winding and magnet [degC].
        controllers: Controllers, or texts that `parse_controller` accepts.
        n_time: Number of grid points.
        most_draws: Largest number of draws used, evenly spaced among those given.

    Returns:
        One curve for each controller and, within it, each temperature.

    Raises:
        OptionError: A parameter, temperature or controller is not accepted.
    """
    parsed = parse_controllers(controllers)
    asked = checked_temperatures(temperatures)
    motors = motor_draws(draws, asked)
    count = motors["J"].size
    kept = np.unique(np.linspace(0, count - 1, most_draws).astype(int))
    motors = {name: values[kept] for name, values in motors.items()}
    curves = []
    for controller in parsed:
        response = StepResponse(close(motors, asked, controller))
        time = np.linspace(0.0, _length(response), n_time)
        for temperature, speed in zip(asked, np.split(response.at(time), len(asked)), strict=True):
            # A few unstable draws may overflow within the time that the others need.
            drawn = np.clip(np.nan_to_num(speed), -_LARGEST_DRAWN, _LARGEST_DRAWN)
            q05, median, q95 = np.quantile(drawn, (0.05, 0.5, 0.95), axis=0)
            curves.append(StepCurve(temperature, controller.text, time, median, q05, q95))
    return curves


def _length(response: StepResponse) -> float:
    """Plot length that is long enough for 90 % of the draws [s]."""
    settling = _BEYOND_SETTLING * step_metrics(response).settling_time
    growth = np.abs(response.poles.real).max(axis=1)
    unsettled = _GROWTHS / np.where(growth > 0, growth, np.abs(response.poles).max(axis=1))
    growing = response.poles.real.max(axis=1)
    unsettled = np.where(growing > 0, _GROWTHS / np.where(growing > 0, growing, 1.0), unsettled)
    needed = np.where(np.isnan(settling), unsettled, settling)
    return float(np.quantile(needed, 0.9))
