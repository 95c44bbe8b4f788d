"""Thumbnail of a run: measured and simulated speed and current."""

from __future__ import annotations

import numpy as np

from identification.report.decimate import Array, extremes
from identification.report.svg import Frame, line, span, svg, text
from identification.result.report_data import RunTraces

__all__ = ["run_thumbnail"]

_BUCKETS = 130


def run_thumbnail(run: RunTraces) -> str:
    """Speed above, current below: the measured channel in grey, the simulated one over it."""
    shown = extremes(
        [run.measured_speed, run.after_speed, run.measured_current, run.after_current], _BUCKETS
    )
    body = ""
    for top, label, measured, simulated in (
        (2.0, "speed", run.measured_speed, run.after_speed),
        (70.0, "current", run.measured_current, run.after_current),
    ):
        body += _panel(top, label, run.time[shown], (measured[shown], simulated[shown]))
    return svg(
        280,
        132,
        f"{run.name}: speed and current",
        f"Measured and simulated speed and current over {run.time[-1] - run.time[0]:.4g} s.",
        body,
    )


def _panel(top: float, label: str, time: Array, channels: tuple[Array, Array]) -> str:
    frame = Frame((2.0, top, 276.0, 60.0), span(time, margin=0.0), span(*channels, margin=0.06))
    measured, simulated = channels
    zero = ""
    if frame.y_range[0] < 0.0 < frame.y_range[1]:
        zero = line(frame, np.array(frame.x_range), np.zeros(2), "zero")
    return (
        f'<rect class="frame" x="2" y="{top}" width="276" height="60"/>{zero}'
        + line(frame, time, measured, "line measured")
        + line(frame, time, simulated, "line after thin")
        + text(7, top + 12, label, "tick")
    )
