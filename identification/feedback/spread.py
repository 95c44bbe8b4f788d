"""Feedback list of a result: each metric with its spread over the posterior draws.

Each draw is evaluated in a loop of its own, before means and quantiles are taken.  A metric of a
draw may be undefined or infinite, and both are reported:

    undefined   a time of an unstable loop, or the peak time of a response without overshoot.  Such
                draws are excluded, and `defined_fraction` is the fraction that remains.  If it is
                below one half, all numbers are null: the minority would not be typical.
    infinite    a gain margin if no gain reaches the stability limit, or a phase margin if the loop
                gain is below 1 everywhere.  Such draws rank above all others in the quantiles, and
                `infinite_fraction` is their fraction of the defined draws.  A quantile that is
                infinite is null; mean and standard deviation are null if any draw is infinite.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.errors import OptionError
from identification.feedback.controller import AbstractController, parse_controllers
from identification.feedback.loop import Loop, close, motor_draws
from identification.feedback.margins import bandwidth, stability_margins
from identification.feedback.step_response import StepResponse, step_characteristics

__all__ = ["METRIC_UNITS", "checked_temperatures", "feedback_metrics", "quantity"]

Array = NDArray[np.float64]

METRIC_UNITS: Final = {
    "rise_time_s": "s",
    "settling_time_s": "s",
    "peak": "rad/s",
    "peak_time_s": "s",
    "overshoot_percent": "%",
    "steady_state": "rad/s",
    "gain_margin_db": "dB",
    "phase_margin_deg": "deg",
    "bandwidth_rad_s": "rad/s",
}
"""Unit of each metric; `peak` and `steady_state` are for a reference step of 1 rad/s."""

_QUANTILES: Final = {"q05": 0.05, "median": 0.5, "q95": 0.95}
_LEAST_DEFINED: Final = 0.5


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
    asked = checked_temperatures(temperatures)
    motors = motor_draws(draws, asked)
    return [
        {"temperature_degC": temperature, "controller": controller.text} | entry
        for controller in parsed
        for temperature, entry in zip(
            asked, _entries(close(motors, asked, controller), len(asked)), strict=True
        )
    ]


def checked_temperatures(temperatures: Sequence[float]) -> list[float]:
    """Validate temperatures and convert them to numbers [degC].

    Args:
        temperatures: At least one, each between -273.15 and 400 degC.

    Raises:
        OptionError: There is none, or one is out of this range.
    """
    asked = [float(temperature) for temperature in temperatures]
    if not asked:
        raise OptionError("no temperature given; expected at least one in degC, for example 25")
    for temperature in asked:
        if not -273.15 < temperature < 400.0:
            raise OptionError(
                f"temperature is {temperature:g} degC; expected -273.15 to 400 degC",
                value=temperature,
            )
    return asked


def quantity(values: Array, unit: str) -> dict[str, Any]:
    """Mean, standard deviation and quantiles over draws, as the module's docstring defines them.

    Args:
        values: (n_draw,), NaN if undefined, infinite if infinite.
        unit: Unit of the values.
    """
    defined = values[~np.isnan(values)]
    fraction = defined.size / values.size
    finite = np.isfinite(defined)
    numbers: dict[str, float | None] = dict.fromkeys(("mean", "sd", *_QUANTILES))
    if defined.size and fraction >= _LEAST_DEFINED:
        if finite.all():
            numbers["mean"], numbers["sd"] = float(defined.mean()), float(defined.std())
        ordered = np.sort(defined)
        for name, share in _QUANTILES.items():
            numbers[name] = _quantile(ordered, share)
    return numbers | {
        "unit": unit,
        "defined_fraction": fraction,
        "infinite_fraction": float(1 - finite.mean()) if defined.size else 0.0,
    }


def _quantile(ordered: Array, share: float) -> float | None:
    """Interpolated quantile, None if it falls among infinite values."""
    position = share * (ordered.size - 1)
    low, high = ordered[int(np.floor(position))], ordered[int(np.ceil(position))]
    if not np.isfinite(high):
        return None
    return float(low + (position % 1) * (high - low))


def _entries(loop: Loop, n_temperature: int) -> Iterator[dict[str, Any]]:
    step = step_characteristics(StepResponse(loop))
    margins = stability_margins(loop)
    columns = {
        "rise_time_s": step.rise_time,
        "settling_time_s": step.settling_time,
        "peak": step.peak,
        "peak_time_s": step.peak_time,
        "overshoot_percent": step.overshoot,
        "steady_state": step.steady_state,
        "gain_margin_db": margins.gain_db,
        "phase_margin_deg": margins.phase_deg,
        "bandwidth_rad_s": np.where(step.is_stable, bandwidth(loop), np.nan),
    }
    rows = np.split(np.arange(step.is_stable.size), n_temperature)
    for row in rows:
        stable = float(step.is_stable[row].mean())
        spread = {
            name: quantity(values[row], METRIC_UNITS[name]) for name, values in columns.items()
        }
        yield {"stable_probability": stable, "statement": _statement(stable, row.size), **spread}


def _statement(stable: float, count: int) -> str:
    if stable == 1:
        return "stable" if count == 1 else f"stable in all {count} draws"
    consequence = "times, peak and bandwidth are null"
    if stable == 0:
        where = "" if count == 1 else f" in all {count} draws"
        return f"unstable{where}: the speed does not settle; {consequence}"
    unstable = f"unstable in {100 * (1 - stable):.3g} % of {count} draws"
    if stable < _LEAST_DEFINED:
        return f"{unstable}; {consequence}"
    return f"{unstable}; times, peak and bandwidth refer to the stable draws"
