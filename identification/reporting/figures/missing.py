"""Plots of the missing torque or voltage with the fitted effect."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.reporting.columns import extremes
from identification.reporting.figures.chart import Band, Line, chart
from identification.result.numbers import scaled_unit, unit_power, unit_text
from identification.result.report_data import MissingTerm, MissingTrace

__all__ = ["missing_over_time", "missing_term_figure"]

_MOST_DOTS = 1500
_FEW = 120


def missing_term_figure(term: MissingTerm) -> str:
    """Estimates against their driver as dots, with the fitted effect and its band."""
    size = term.driver_values.size
    shown = np.unique(np.linspace(0, size - 1, min(size, _MOST_DOTS)).astype(np.int_))
    shown = shown[np.argsort(term.driver_values[shown], kind="stable")]
    power = unit_power(_largest(term))
    scale = 10.0**-power
    estimate = scale * term.estimate[shown]
    low, middle, high = scale * term.q05, scale * term.median, scale * term.q95
    # A few bin means are drawn over the curve; a cloud of samples must not hide it.
    is_few = size <= _FEW
    dots = Line("estimate", "voltage" if is_few else "measured", term.driver_values[shown],
                estimate, "few" if is_few else "dots")  # fmt: skip
    fitted = [Line("fitted", "after", term.grid, middle)] if term.grid.size else []
    effect = f", with the fitted {term.effect}" if term.effect else ""
    return chart(
        f"{term.quantity} versus {term.driver}",
        f"{term.quantity} of the {term.equation} equation versus {term.driver}{effect}.",
        (f"{term.driver} [{unit_text(term.driver_unit)}]",
         f"{term.quantity} [{scaled_unit(term.unit, power)}]"),
        [*fitted, dots] if is_few else [dots, *fitted],
        [Band("after", term.grid, low, high)] if term.grid.size else [],
        y_range=_usual(estimate, low, high),
    )  # fmt: skip


def missing_over_time(trace: MissingTrace) -> str:
    """Missing term over the time of one run with its band, and the fitted effects."""
    power = unit_power(float(np.quantile(np.abs(trace.median), 0.995)))
    lines = (trace.median, trace.q05, trace.q95, trace.fitted)
    median, low, high, fitted = (10.0**-power * values for values in lines)
    has_fit = fitted.size > 0
    shown = extremes([median, low, high, *([fitted] if has_fit else [])], 250)
    time = trace.time[shown]
    drawn = [Line("estimate", "voltage" if has_fit else "after", time, median[shown], "thin")]
    if has_fit:
        drawn.append(Line("fitted", "after", time, fitted[shown]))
    band = Band("measured" if has_fit else "after", time, low[shown], high[shown])
    return chart(
        f"{trace.quantity} over time, {trace.run}",
        f"{trace.quantity} estimated over the run {trace.run}, with its 90 % band.",
        ("time [s]", f"{trace.quantity} [{scaled_unit(trace.unit, power)}]"),
        drawn, [band], height=210,
    )  # fmt: skip


def _largest(term: MissingTerm) -> float:
    """99.5 % quantile of the absolute values of the curve, or of the estimates without a curve."""
    values = np.abs(term.median if term.median.size else term.estimate)
    return float(np.quantile(values, 0.995)) if values.size else 0.0


def _usual(values: Array, low: Array, high: Array) -> tuple[float, float]:
    """Range of zero, nearly all estimates and the whole curve; outliers do not shrink the plot."""
    ends = np.quantile(values, (0.005, 0.995)) if values.size else np.zeros(0)
    seen = np.concatenate([ends, low, high, [0.0]])
    seen = seen[np.isfinite(seen)]
    room = 0.08 * float(np.ptp(seen)) or 0.5
    return float(seen.min()) - room, float(seen.max()) + room
