"""Panels of each run for the interactive plots: which stored columns share one time axis.

A panel shows a speed, a current, a residual, a voltage or a temperature.  The script of the page
decodes the columns and plots them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from identification.reporting.columns import stored_runs
from identification.result.report_data import RunTraces

__all__ = ["run_payloads"]

_Panel = dict[str, Any]


def run_payloads(
    runs: Sequence[RunTraces], noise: Mapping[str, float | None], budget: int
) -> list[dict[str, Any]]:
    """Plot data of the runs, ready for JSON: name, role, stored columns and panels.

    `noise` is that of the result, ``current_A`` and ``speed_rad_s``; `budget` limits the size of
    all columns [bytes].
    """
    return [
        {"name": run.name, "role": run.role, "panels": _panels(run, noise), **stored}
        for run, stored in zip(runs, stored_runs(runs, noise, budget), strict=True)
    ]


def _panels(run: RunTraces, noise: Mapping[str, float | None]) -> list[_Panel]:
    panels = [
        *_channel("Speed", "rad/s", run.before_speed is not None, noise.get("speed_rad_s")),
        *_channel("Current", "A", run.before_current is not None, noise.get("current_A")),
        {"label": "Voltage [V]", "series": [_series("logged", "voltage", "voltage")]},
    ]
    if run.temperature is not None:
        logged = [_series("logged", "voltage", "temperature")]
        panels.append({"label": "Temperature [°C]", "series": logged})
    return panels


def _channel(name: str, unit: str, has_before: bool, noise: float | None) -> list[_Panel]:
    """Panels of a channel and of its residual."""
    key = name.lower()
    shown = [_series("measured", "trace", f"measured_{key}")]
    left = []
    if has_before:
        shown.append(_series("nominal model", "before", f"before_{key}"))
        left.append(_series("nominal model", "before", f"measured_{key}", f"before_{key}"))
    shown.append(_series("simulated", "after", f"after_{key}"))
    left.append(_series("final model", "after", f"measured_{key}", f"after_{key}"))
    return [
        {"label": f"{name} [{unit}]", "series": shown, "tall": True},
        {"label": f"{name} residual [{unit}]", "series": left, "noise": noise},
    ]


def _series(label: str, kind: str, column: str, minus: str = "") -> dict[str, str]:
    """A column, or the difference of two."""
    return {"label": label, "kind": kind, "column": column, "minus": minus}
