"""Metrics of the closed loop, and their distribution over the posterior draws.

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

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from identification.arrays import Array

__all__ = ["BAND", "LEAST_DEFINED", "METRIC_UNITS", "RISE", "StepMetrics", "quantities", "quantity"]

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

RISE: Final = (0.1, 0.9)
"""Levels between which the rise time is taken, relative to the final value [-]."""
BAND: Final = 0.02
"""Half width of the settling band, relative to the final value [-]."""
LEAST_DEFINED: Final = 0.5
"""Fraction of defined draws below which a metric is null [-]."""

_QUANTILES: Final = {"q05": 0.05, "median": 0.5, "q95": 0.95}


@dataclass(frozen=True)
class StepMetrics:
    """Metrics of responses to a reference step of 1 rad/s; each (n_loop,), NaN if undefined."""

    rise_time: Array
    """Time from the first crossing of 10 % to the first of 90 % of the final value [s]."""
    settling_time: Array
    """Last entry into the 2 % band around the final value [s]."""
    peak: Array
    """Largest value, in the direction of the final value; without overshoot the final value itself
    [rad/s]."""
    peak_time: Array
    """Time of the peak; NaN without overshoot [s]."""
    overshoot: Array
    """Excess of the peak over the final value; 0 if it does not exceed rounding or the accuracy of
    the simulation [%]."""
    steady_state: Array
    """Final value [rad/s]."""


def quantities(step: StepMetrics, margins: Iterable[Array], rows: slice) -> dict[str, Any]:
    """Quantity of each metric of `METRIC_UNITS` over the loops `rows` of one temperature.

    The margins are gain [dB], phase [deg] and bandwidth [rad/s], each (n_loop,).
    """
    columns = (*vars(step).values(), *margins)
    return {
        name: quantity(values[rows], unit)
        for (name, unit), values in zip(METRIC_UNITS.items(), columns, strict=True)
    }


def quantity(values: Array, unit: str) -> dict[str, Any]:
    """Mean, standard deviation and quantiles over draws (n_draw,), see the module's docstring."""
    defined = values[~np.isnan(values)]
    fraction = defined.size / values.size
    finite = np.isfinite(defined)
    numbers: dict[str, float | None] = dict.fromkeys(("mean", "sd", *_QUANTILES))
    if defined.size and fraction >= LEAST_DEFINED:
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
