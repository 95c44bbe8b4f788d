"""Measured and simulated signals of one run over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.report.svg import Frame, axes, line, span, svg

__all__ = ["prediction_figure"]

Array = NDArray[np.float64]


def prediction_figure(
    name: str, time: Array, speed: tuple[Array, Array], current: tuple[Array, Array]
) -> str:
    """Speed above, current below: the measured signal in grey, the simulated one over it.

    Args:
        name: Name of the run.
        time: (n_sample,) increasing [s].
        speed: (n_sample,) each, measured and simulated [rad/s]; NaN where unknown.
        current: (n_sample,) each, measured and simulated [A]; NaN where unknown.

    Returns:
        SVG text.
    """
    body = ""
    for top, label, channels in (
        (10.0, "speed [rad/s]", speed),
        (178.0, "current [A]", current),
    ):
        frame = Frame((66.0, top, 844.0, 150.0), span(time, margin=0.0), span(*channels))
        body += axes(frame, "time [s]" if top > 10.0 else "", label, (10, 4))
        body += line(frame, time, channels[0], "line measured")
        body += line(frame, time, channels[1], "line after thin")
    length = float(time[-1] - time[0])
    described = f"Measured and simulated speed and current over {length:.4g} s."
    return svg(920, 372, f"{name}: speed and current", described, body)
