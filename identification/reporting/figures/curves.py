"""Curves: coefficients over temperature, step responses and predicted signals over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from identification.arrays import Array
from identification.reporting.columns import extremes
from identification.reporting.figures.chart import Band, Line, chart
from identification.result.numbers import number_text, unit_prefix, unit_text
from identification.result.report_data import CoefficientCurve, StepResponse

__all__ = [
    "coefficient_figure",
    "compared_steps_figure",
    "prediction_figure",
    "step_figure",
    "temperature_kinds",
]

_CHANNEL_UNITS = {"speed": "rad/s", "current": "A"}
_BUCKETS = 450
"""Buckets of a drawing that spans the page."""


def coefficient_figure(curve: CoefficientCurve, temperatures: Sequence[Array]) -> str:
    """Coefficient over temperature with its band, and a histogram of the logged temperatures."""
    lines = [*_histogram(temperatures, (float(curve.temperature[0]), float(curve.temperature[-1])))]
    if curve.before is not None:
        lines.append(Line("nominal model", "before", curve.temperature, curve.before, "dashed"))
    lines.append(Line("final model", "after", curve.temperature, curve.median))
    ends = (
        f"From {number_text(float(curve.median[0]))} at {curve.temperature[0]:.0f} °C to "
        f"{number_text(float(curve.median[-1]))} {unit_text(curve.unit)} at "
        f"{curve.temperature[-1]:.0f} °C, median with 90 % band."
    )
    return chart(
        f"{curve.name} over temperature", ends,
        ("temperature [°C]", f"{curve.name} [{unit_text(curve.unit)}]"),
        lines, [Band("after", curve.temperature, curve.q05, curve.q95)],
    )  # fmt: skip


def step_figure(steps: Sequence[StepResponse]) -> str:
    """Step responses of one controller at all temperatures, each with its band and its label."""
    coldest_first = sorted(steps, key=lambda step: step.temperature_degC)
    factor, unit = unit_prefix("s", [max(float(step.time[-1]) for step in steps)])
    kinds = temperature_kinds([step.temperature_degC for step in coldest_first])
    lines, bands = [], []
    for step, kind in zip(coldest_first, kinds, strict=True):
        time = factor * step.time
        bands.append(Band(kind, time, step.q05, step.q95))
        lines.append(Line(f"{step.temperature_degC:g} °C", kind, time, step.median))
        if step.simulated is not None:
            label = f"{step.temperature_degC:g} °C with effects"
            lines.append(Line(label, kind, time, step.simulated, "dashed"))
    described = "; ".join(
        f"{step.temperature_degC:g} °C settles at {number_text(float(step.median[-1]))}"
        for step in coldest_first
    )
    labels = (f"time after the step [{unit}]", "speed / reference")
    title = f"Step responses with {steps[0].controller}"
    return chart(title, described + ".", labels, lines, bands)


def compared_steps_figure(first: StepResponse, second: StepResponse) -> str:
    """Step responses of two fits with the same controller at the same temperature.

    The first one has the colour of the nominal model.
    """
    factor, unit = unit_prefix("s", [float(step.time[-1]) for step in (first, second)])
    lines, bands = [], []
    for label, step, kind in (("first", first, "before"), ("second", second, "after")):
        bands.append(Band(kind, factor * step.time, step.q05, step.q95))
        lines.append(Line(label, kind, factor * step.time, step.median))
    described = (
        f"The first fit settles at {number_text(float(first.median[-1]))}, the second at "
        f"{number_text(float(second.median[-1]))}."
    )
    title = f"Step responses with {first.controller} at {first.temperature_degC:g} °C"
    labels = (f"time after the step [{unit}]", "speed / reference")
    return chart(title, described, labels, lines, bands)


def prediction_figure(
    name: str, channel: Literal["speed", "current"], time: Array, signals: tuple[Array, Array]
) -> str:
    """Measured signal in grey, the simulated one over it, of a run.

    Time (n_sample,) [s]; signals (n_sample,) [rad/s or A], NaN where unknown.
    """
    measured, simulated = signals
    described = f"Measured and simulated {channel} over {float(time[-1] - time[0]):.4g} s."
    return chart(
        f"{name}: {channel}",
        described,
        ("time [s]", f"{channel} [{_CHANNEL_UNITS[channel]}]"),
        [
            Line("measured", "measured", time, measured),
            Line("simulated", "after", time, simulated, "thin"),
        ],
    )


def profile_figure(time: Array, voltage: Array) -> str:
    """Designed voltage (n_sample,) [V] over time [s]; of many samples, the extremes."""
    shown = extremes([voltage], _BUCKETS)
    described = f"Voltage of the next run over {float(time[-1] - time[0]):.4g} s."
    line = Line("", "voltage", time[shown], voltage[shown], "thin")
    return chart("Proposed run", described, ("time [s]", "voltage [V]"), [line], height=180)


def temperature_kinds(temperatures: Sequence[float]) -> list[str]:
    """Colour of each temperature, from ``heat0`` (coldest) to ``heat4`` (hottest)."""
    low, high = min(temperatures), max(temperatures)
    width = (high - low) or 1.0
    return [f"heat{round(4.0 * (value - low) / width)}" for value in temperatures]


def _histogram(temperatures: Sequence[Array], limits: tuple[float, float]) -> list[Line]:
    """Histogram of all samples over temperature; empty without samples."""
    finite = [run[np.isfinite(run)] for run in temperatures]
    if not any(run.size for run in finite):
        return []
    counts, edges = np.histogram(np.concatenate(finite), bins=48, range=limits)
    middles = 0.5 * (edges[1:] + edges[:-1])
    return [Line("logged temperatures", "measured", middles, counts / max(counts.max(), 1), "bars")]
