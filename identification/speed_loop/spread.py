"""Feedback list of a result: the metrics of each controller at each temperature."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from identification.errors import OptionError
from identification.speed_loop.controller import AbstractController, parse_controllers
from identification.speed_loop.loop import Loop, close, motor_draws
from identification.speed_loop.margins import bandwidth, stability_margins
from identification.speed_loop.metrics import LEAST_DEFINED, quantities
from identification.speed_loop.step_response import StepResponse, step_metrics

__all__ = ["checked_temperatures", "feedback_metrics"]


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
    return [
        {"temperature_degC": temperature, "controller": controller.text} | entry
        for controller in parsed
        for temperature, entry in zip(
            checked, _entries(close(motors, checked, controller), len(checked)), strict=True
        )
    ]


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
        yield {
            "stable_probability": stable,
            "statement": _statement(stable, n_draw),
        } | quantities(step, (margins.gain_db, margins.phase_deg, frequency), rows)


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
