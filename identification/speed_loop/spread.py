"""Metrics and step responses of each controller at each temperature, over the posterior draws."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from identification.arrays import Array, evenly
from identification.errors import OptionError
from identification.speed_loop.controller import AbstractController, parse_controllers
from identification.speed_loop.loop import Loop, close, motor_draws
from identification.speed_loop.margins import bandwidth, stability_margins
from identification.speed_loop.metrics import LEAST_DEFINED, quantities
from identification.speed_loop.step_response import StepResponse, step_metrics

__all__ = ["StepCurve", "checked_temperatures", "feedback_metrics", "step_curves"]


# A settling loop is plotted for 1.4 settling times, an unstable one until its fastest mode has
# grown by e^3.
_BEYOND_SETTLING: Final = 1.4
_GROWTHS: Final = 3.0
_LARGEST_DRAWN: Final = 1e9


@dataclass(frozen=True)
class StepCurve:
    """Speed after a reference step of 1 rad/s: pointwise median and 90 % band over the draws.

    Arrays are (n_time,), speeds in rad/s.
    """

    temperature_degC: float  # noqa: N815
    """Temperature of winding and magnet [degC]."""
    controller: str
    """Controller as the user gave it, such as ``PI:2,10``."""
    time: Array
    """Increasing from zero [s]."""
    median: Array
    q05: Array
    q95: Array
    simulated: Array | None = None
    """Median with the effects in the loop; None if not simulated."""


@np.errstate(all="ignore")
def feedback_metrics(
    draws: Mapping[str, ArrayLike],
    temperatures: Sequence[float],
    controllers: Sequence[str | AbstractController],
) -> list[dict[str, Any]]:
    """Metrics of the closed speed loop for each controller at each temperature.

    Args:
        draws: Values of the nominal parameters by name, (n_draw,) or single numbers; other names
            are ignored.
        temperatures: Temperatures of winding and magnet [degC].
        controllers: Controllers, or texts that `parse_controller` accepts.

    Returns:
        One entry for each controller and, within it, each temperature.  In addition to the metrics
        it holds `stable_probability`, the fraction of draws whose loop is stable, and `statement`,
        the same in words.

    Raises:
        OptionError: A parameter, temperature or controller is not accepted.

    Source:
        contract.md, "result.json" and "Default feedback loop".
    """
    parsed = parse_controllers(controllers)
    checked = checked_temperatures(temperatures)
    motors = motor_draws(draws, checked)
    found = []
    for controller in parsed:
        entries = _entries(close(motors, checked, controller), len(checked))
        for temperature, entry in zip(checked, entries, strict=True):
            found.append({"temperature_degC": temperature, "controller": controller.text} | entry)
    return found


def step_curves(
    draws: Mapping[str, ArrayLike],
    temperatures: Sequence[float],
    controllers: Sequence[str | AbstractController],
    n_time: int = 300,
    most_draws: int = 500,
) -> list[StepCurve]:
    """Exact step responses on a time grid, for plotting; no metric is computed from the grid.

    The arguments are those of `feedback_metrics`, and there is one curve for each of its entries.
    All temperatures of one controller share the grid of `n_time` points, so their curves can be
    overlaid.  Of many draws, `most_draws` are used, evenly spaced.

    Raises:
        OptionError: A parameter, temperature or controller is not accepted.
    """
    parsed = parse_controllers(controllers)
    asked = checked_temperatures(temperatures)
    motors = motor_draws(draws, asked)
    kept = evenly(motors["J"].size, most_draws)
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


def checked_temperatures(temperatures: Sequence[float]) -> list[float]:
    """Validate temperatures and convert them to numbers [degC].

    Raises:
        OptionError: There is none, or one is out of this range.
    """
    checked = [float(temperature) for temperature in temperatures]
    if not checked:
        raise OptionError("no temperature given; expected at least one in degC, for example 25")
    for temperature in checked:
        if not -273.15 < temperature < 400.0:
            raise OptionError(
                f"temperature is {temperature:g} degC; expected -273.15 to 400 degC",
                value=temperature,
            )
    return checked


def _entries(loop: Loop, n_temperature: int) -> Iterator[dict[str, Any]]:
    response = StepResponse(loop)
    step, margins = step_metrics(response), stability_margins(loop)
    frequency = np.where(response.is_stable, bandwidth(loop), np.nan)
    n_draw = response.is_stable.size // n_temperature
    for first in range(0, response.is_stable.size, n_draw):
        rows = slice(first, first + n_draw)
        stable = float(response.is_stable[rows].mean())
        yield {"stable_probability": stable, "statement": _statement(stable, n_draw)} | quantities(
            step, (margins.gain_db, margins.phase_deg, frequency), rows
        )


def _statement(stable: float, count: int) -> str:
    if stable == 1:
        return "stable" if count == 1 else f"stable in all {count} draws"
    consequence = "times, peak and bandwidth are null"
    if stable == 0:
        where = "" if count == 1 else f" in all {count} draws"
        return f"unstable{where}: the speed does not settle; {consequence}"
    unstable = f"unstable in {100 * (1 - stable):.3g} % of {count} draws"
    if stable < LEAST_DEFINED:
        return f"{unstable}; {consequence}"
    return f"{unstable}; times, peak and bandwidth refer to the stable draws"


def _length(response: StepResponse) -> float:
    """Plot length that is long enough for 90 % of the draws [s]."""
    settling = _BEYOND_SETTLING * step_metrics(response).settling_time
    growing, fastest = response.poles.real.max(axis=1), np.abs(response.poles.real).max(axis=1)
    rate = np.where(fastest > 0, fastest, np.abs(response.poles).max(axis=1))
    unsettled = _GROWTHS / np.where(growing > 0, growing, rate)
    return float(np.quantile(np.where(np.isnan(settling), unsettled, settling), 0.9))
