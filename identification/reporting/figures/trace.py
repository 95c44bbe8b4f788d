"""Trace plot of the sampler: stationarity of one parameter over the steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.reporting.figures.chart import Band, Line, chart
from identification.result.numbers import scaled_unit, unit_power
from identification.result.report_data import PosteriorChain

__all__ = ["trace_figure"]

_POINTS = 240
_WALKERS = 2


def trace_figure(posterior: PosteriorChain, index: int) -> str:
    """One parameter over the steps: the central 90 % and 50 % of the walkers, and two of them.

    Sixty overlaid walkers form a grey block that hides a slow drift; their quantiles show it.
    """
    name, unit = posterior.names[index], posterior.units[index]
    walks = posterior.chain[:, :, index]
    power = unit_power(float(np.max(np.abs(np.quantile(walks, (0.05, 0.95))))))
    walks = walks * 10.0**-power
    steps, (low, lower, middle, upper, high) = _moving_quantiles(walks)
    lines = [
        Line("", "measured", steps, walks[steps, walker], "thin")
        for walker in range(min(_WALKERS, walks.shape[1]))
    ]
    shown = scaled_unit(unit, power)
    return chart(
        f"Trace of {name}",
        f"Quantiles of {walks.shape[1]} walkers over {walks.shape[0]} steps.",
        ("step", ""),
        [*lines, Line(f"{name} [{shown}]" if shown else name, "after", steps, middle, "thin")],
        [Band("after", steps, low, high), Band("after", steps, lower, upper)],
        height=140,
    )


def _moving_quantiles(walks: Array) -> tuple[NDArray[np.int_], Array]:
    """Centres (n_point,) of blocks of steps, and walker quantiles (5, n_point) in each block."""
    width = max(1, walks.shape[0] // _POINTS)
    points = walks.shape[0] // width
    stretches = walks[: points * width].reshape(points, -1)
    steps = np.arange(points) * width + width // 2
    return steps, np.quantile(stretches, (0.05, 0.25, 0.5, 0.75, 0.95), axis=1)
