"""The feedback list of a result: each metric with its spread over the posterior draws.

Every draw goes through the loop on its own; only then are means and quantiles taken.  Some draws
may have no value, and some an infinite one, and both are said instead of hidden:

    undefined   a time of an unstable loop, the peak time of a response without overshoot.  Such
                draws are left out and `defined_fraction` says which share remained.  Where less
                than half remained, all numbers are null: the minority would not be typical.
    infinite    a gain margin that no gain uses up, a phase margin of a loop whose gain is
                below 1 everywhere.  Such draws count as larger than all others in the quantiles,
                `infinite_fraction` is their share of the defined ones, and each number that is
                itself infinite is null, as are mean and standard deviation if any draw is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.errors import OptionError
from identification.feedback.controller import parse_controllers
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
"""Unit of each metric; `peak` and `steady_state` follow a reference step of 1 rad/s."""

_QUANTILES: Final = {"q05": 0.05, "median": 0.5, "q95": 0.95}
_LEAST_DEFINED: Final = 0.5


@np.errstate(all="ignore")
def feedback_metrics(
    draws: Mapping[str, ArrayLike], temperatures: Sequence[float], controllers: Sequence[str]
) -> list[dict[str, Any]]:
    """Metrics of the closed speed loop for each controller at each temperature.

    Args:
        draws: Values of the declared parameters by name, (n_draw,) or single numbers; other names
            are left aside.
        temperatures: Temperatures of winding and magnet [degC].
        controllers: Texts that `parse_controller` accepts.

    Returns:
        One entry for each controller and, within it, each temperature.  Besides the metrics it
        holds `stable_probability`, the share of the draws whose loop is stable, and `statement`,
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
    """Temperatures as numbers [degC].

    Args:
        temperatures: At least one, finite.

    Raises:
        OptionError: There is none, or one is not finite.
    """
    asked = [float(temperature) for temperature in temperatures]
    if not asked:
        raise OptionError("no temperature is given; expected at least one, such as 25 (degC)")
    for temperature in asked:
        if not -273.15 < temperature < 400.0:
            raise OptionError(
                f"temperature is {temperature:g} degC; expected one between -273.15 and 400 degC",
                value=temperature,
            )
    return asked


def quantity(values: Array, unit: str) -> dict[str, Any]:
    """Mean, standard deviation and quantiles over draws, as this module's first lines say.

    Args:
        values: (n_draw,), NaN where undefined, infinite where infinite.
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
    """Interpolated quantile, None where it falls among infinite values."""
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
    return f"{unstable}; times, peak and bandwidth are those of the stable draws"
