"""Time series of each run for the interactive plots: panels over one time axis, min-max decimated.

A panel shows a speed, a current, a residual, a voltage or a temperature.  The script of the page
decodes and plots it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.report.decimate import extremes, packed, packed_time, with_corners
from identification.result.report_data import RunTraces
from identification.result.residuals import gaps

__all__ = ["run_payload"]

Array = NDArray[np.float64]

_MOST_BUCKETS = 700
_ALL_BUCKETS = 5600
"""Buckets of all runs together, which limits the size of the page."""


def run_payload(
    run: RunTraces, run_count: int, noise: Mapping[str, float | None]
) -> dict[str, Any]:
    """Plot data of one run.

    Args:
        run: The run.
        run_count: Number of runs in the report.
        noise: Standard deviations of the noise as in the result: ``current_A``, ``speed_rad_s``.

    Returns:
        Name, role and panels, ready for JSON.
    """
    buckets = max(min(_MOST_BUCKETS, _ALL_BUCKETS // run_count), 100)
    panels = [
        *_channel(
            run,
            ("Speed", "rad/s", noise.get("speed_rad_s")),
            (run.measured_speed, run.after_speed, run.before_speed),
            buckets,
        ),
        *_channel(
            run,
            ("Current", "A", noise.get("current_A")),
            (run.measured_current, run.after_current, run.before_current),
            buckets,
        ),
        _panel(
            run.time, ("Voltage", "V"), [("voltage", "measured", run.voltage)], buckets, run.voltage
        ),
    ]
    if run.temperature is not None:
        logged = [("temperature", "measured", run.temperature)]
        panels.append(_panel(run.time, ("Temperature", "°C"), logged, buckets))
    return {"name": run.name, "role": run.role, "panels": panels}


def _channel(
    run: RunTraces,
    label: tuple[str, str, float | None],
    channels: tuple[Array, Array, Array | None],
    buckets: int,
) -> list[dict[str, Any]]:
    """Panels of the channel and of its residual."""
    measured, after, before = channels
    name, unit, noise = label
    shown = [("measured", "measured", measured), ("simulated", "after", after)]
    left = [("residual", "after", measured - after)]
    if before is not None:
        shown.insert(1, ("nominal model", "before", before))
        left.insert(0, ("residual of the nominal model", "before", measured - before))
    return [
        _panel(run.time, (name, unit), shown, buckets, after) | {"tall": True},
        _panel(run.time, (f"{name} residual", unit), left, buckets) | {"noise": noise},
    ]


def _panel(
    time: Array,
    label: tuple[str, str],
    series: Sequence[tuple[str, str, Array]],
    buckets: int,
    smooth: Array | None = None,
) -> dict[str, Any]:
    kept = extremes([values for _, _, values in series], buckets)
    if smooth is not None:
        kept = with_corners(kept, smooth, 2 * buckets)
    # A NaN in the middle of a gap interrupts the plotted line there.
    pauses = np.searchsorted(kept, gaps(time), side="right")
    pauses = np.unique(pauses[(pauses > 0) & (pauses < kept.size)])
    middles = 0.5 * (time[kept[pauses - 1]] + time[kept[pauses]])
    return {
        "label": label[0],
        "unit": label[1],
        "time": packed_time(np.insert(time[kept], pauses, middles)),
        "series": [
            {"label": name, "kind": kind} | packed(np.insert(values[kept], pauses, np.nan))
            for name, kind, values in series
        ],
    }
