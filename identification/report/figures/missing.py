"""What the model lacked: the missing torque or voltage, and the effect that was fitted to it."""

from __future__ import annotations

import numpy as np

from identification.report.data import MissingTerm, MissingTrace
from identification.report.decimate import extremes
from identification.report.numbers import unit_text
from identification.report.svg import Frame, axes, band, dots, line, span, svg

__all__ = ["missing_over_time", "missing_term_figure"]

_MOST_DOTS = 1500


def missing_term_figure(term: MissingTerm) -> str:
    """Estimates against their driver as dots, the fitted effect with its band over them."""
    size = term.driver_values.size
    shown = np.unique(np.linspace(0, size - 1, min(size, _MOST_DOTS)).astype(np.int_))
    across, up = term.driver_values[shown], term.estimate[shown]
    frame = Frame(
        (66.0, 10.0, 384.0, 196.0), span(across, term.grid, margin=0.03), _usual(up, term)
    )
    body = axes(
        frame,
        f"{term.driver} [{unit_text(term.driver_unit)}]",
        f"{term.quantity} [{unit_text(term.unit)}]",
    )
    inside = (up >= frame.y_range[0]) & (up <= frame.y_range[1])
    body += dots(frame, across[inside], up[inside], "dots measured")
    if term.grid.size:
        body += band(frame, term.grid, term.q05, term.q95)
        body += line(frame, term.grid, term.median, "line after")
    fitted = f", with {term.effect} fitted to it" if term.effect else ""
    return svg(
        460,
        246,
        f"{term.quantity} against {term.driver}",
        f"{term.quantity} of the {term.equation} equation against {term.driver}{fitted}.",
        body,
    )


def missing_over_time(trace: MissingTrace) -> str:
    """The missing term over the time of one run, with its band."""
    shown = extremes([trace.median, trace.q05, trace.q95], 250)
    time, low, high = trace.time[shown], trace.q05[shown], trace.q95[shown]
    frame = Frame((66.0, 10.0, 844.0, 150.0), span(time, margin=0.0), span(low, high, [0.0]))
    body = axes(frame, "time [s]", f"{trace.quantity} [{unit_text(trace.unit)}]", (10, 4))
    body += band(frame, time, low, high)
    body += line(frame, np.array(frame.x_range), np.zeros(2), "zero")
    body += line(frame, time, trace.median[shown], "line after thin")
    return svg(
        920,
        200,
        f"{trace.quantity} over time, {trace.run}",
        f"{trace.quantity} estimated over the run {trace.run}, with its 90 % band.",
        body,
    )


def _usual(values: np.ndarray, term: MissingTerm) -> tuple[float, float]:
    """Range of nearly all estimates and of the whole curve; spikes do not shrink the picture."""
    ends = np.quantile(values, (0.005, 0.995)) if values.size else np.zeros(0)
    return span(ends, term.q05, term.q95, margin=0.08)
