"""Measured and simulated signals of one run over time."""

from __future__ import annotations

from typing import Literal

from identification.arrays import Array
from identification.reporting.figures.chart import Line, chart

__all__ = ["prediction_figure"]

_UNITS = {"speed": "rad/s", "current": "A"}


def prediction_figure(
    name: str, channel: Literal["speed", "current"], time: Array, signals: tuple[Array, Array]
) -> str:
    """Measured signal in grey, the simulated one over it.

    Args:
        name: Name of the run.
        channel: The channel.
        time: (n_sample,) increasing [s].
        signals: (n_sample,) each, measured and simulated [rad/s or A]; NaN where unknown.
    """
    measured, simulated = signals
    described = f"Measured and simulated {channel} over {float(time[-1] - time[0]):.4g} s."
    return chart(
        f"{name}: {channel}",
        described,
        ("time [s]", f"{channel} [{_UNITS[channel]}]"),
        [
            Line("measured", "measured", time, measured),
            Line("simulated", "after", time, simulated, "thin"),
        ],
    )
