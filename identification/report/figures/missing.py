"""Plots of the missing torque or voltage with the fitted effect."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.report.decimate import extremes
from identification.report.svg import Frame, axes, band, dots, line, span, svg
from identification.result.numbers import scaled_unit, unit_power, unit_text
from identification.result.report_data import MissingTerm, MissingTrace

__all__ = ["missing_over_time", "missing_term_figure"]

Array = NDArray[np.float64]

_MOST_DOTS = 1500
_FEW = 120


def missing_term_figure(term: MissingTerm) -> str:
    """Estimates against their driver as dots, with the fitted effect and its band."""
    size = term.driver_values.size
    shown = np.unique(np.linspace(0, size - 1, min(size, _MOST_DOTS)).astype(np.int_))
    power = unit_power(_largest(term))
    scale = 10.0**-power
    across, up = term.driver_values[shown], scale * term.estimate[shown]
    low, middle, high = scale * term.q05, scale * term.median, scale * term.q95
    frame = Frame(
        (66.0, 10.0, 384.0, 196.0), span(across, term.grid, margin=0.03), _usual(up, low, high)
    )
    unit = scaled_unit(term.unit, power)
    body = axes(
        frame, f"{term.driver} [{unit_text(term.driver_unit)}]", f"{term.quantity} [{unit}]"
    )
    inside = (up >= frame.y_range[0]) & (up <= frame.y_range[1])
    # A few bin means are drawn over the curve; a cloud of samples must not hide it.
    kind = "dots few" if size <= _FEW else "dots measured"
    if term.grid.size:
        body += band(frame, term.grid, low, high)
    if size > _FEW:
        body += dots(frame, across[inside], up[inside], kind)
    if term.grid.size:
        body += line(frame, term.grid, middle, "line after")
    if size <= _FEW:
        body += dots(frame, across[inside], up[inside], kind)
    fitted = f", with the fitted {term.effect}" if term.effect else ""
    return svg(
        460,
        246,
        f"{term.quantity} versus {term.driver}",
        f"{term.quantity} of the {term.equation} equation versus {term.driver}{fitted}.",
        body,
    )


def missing_over_time(trace: MissingTrace) -> str:
    """Missing term over the time of one run with its band, and the fitted effects."""
    power = unit_power(float(np.quantile(np.abs(trace.median), 0.995)))
    lines = (trace.median, trace.q05, trace.q95, trace.fitted)
    median, low, high, fitted = (10.0**-power * values for values in lines)
    has_fit = fitted.size > 0
    shown = extremes([median, low, high, *([fitted] if has_fit else [])], 250)
    time = trace.time[shown]
    across = span(low[shown], high[shown], fitted, [0.0])
    frame = Frame((66.0, 10.0, 844.0, 150.0), span(time, margin=0.0), across)
    body = axes(frame, "time [s]", f"{trace.quantity} [{scaled_unit(trace.unit, power)}]", (10, 4))
    body += band(frame, time, low[shown], high[shown], "bandwhite" if has_fit else "band")
    body += line(frame, np.array(frame.x_range), np.zeros(2), "zero")
    if has_fit:
        body += line(frame, time, median[shown], "line measured")
        body += line(frame, time, fitted[shown], "line after thin")
    else:
        body += line(frame, time, median[shown], "line after thin")
    return svg(
        920,
        200,
        f"{trace.quantity} over time, {trace.run}",
        f"{trace.quantity} estimated over the run {trace.run}, with its 90 % band.",
        body,
    )


def _largest(term: MissingTerm) -> float:
    """99.5 % quantile of the absolute values of the curve, or of the estimates without a curve."""
    values = np.abs(term.median if term.median.size else term.estimate)
    return float(np.quantile(values, 0.995)) if values.size else 0.0


def _usual(values: Array, low: Array, high: Array) -> tuple[float, float]:
    """Range of zero, nearly all estimates and the whole curve; outliers do not shrink the plot."""
    ends = np.quantile(values, (0.005, 0.995)) if values.size else np.zeros(0)
    return span(ends, low, high, [0.0], margin=0.08)
