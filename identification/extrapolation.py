"""Remark on a predicted run that leaves the range of the fitted runs.

A model is confirmed where it was fitted.  Beyond, the temperature coefficients, friction and every
curve are extrapolated, and nothing in the prediction shows it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from identification.arrays import Array
from identification.ingest.run import Run
from identification.result.numbers import finite, number_text

__all__ = ["extrapolation"]

_MARGIN: Final = 0.1
"""Fraction of the fitted range by which a run may leave it [-]: noise and single peaks."""
_WARMER: Final = 5.0
"""The same for the temperature [K], where runs of one temperature have no range: copper changes its
resistance by 2 %, what an added effect has to explain at least."""


def extrapolation(result: Mapping[str, Any], run: Run, predicted: pd.DataFrame) -> str:
    """Sentence on the channels in which a run leaves the range of the training runs; else empty.

    Voltage and temperature are those of the run, current and speed those of the prediction.  A
    result whose runs have no ranges, of an earlier version, has no remark.
    """
    reached = {
        "voltage_V": ("V", run.voltage),
        "current_A": ("A", predicted["current_A"].to_numpy()),
        "speed_rad_s": ("rad/s", predicted["speed_rad_s"].to_numpy()),
        "temperature_degC": ("°C", run.temperature),
    }
    beyond = [
        text
        for name, (unit, values) in reached.items()
        if values is not None and (text := _beyond(name, unit, values, _fitted(result, name)))
    ]
    if not beyond:
        return ""
    return (
        f"{run.name} leaves the range of the fitted runs ({'; '.join(beyond)}), where the model is "
        "an extrapolation; fit a run that covers it as well"
    )


def _fitted(result: Mapping[str, Any], name: str) -> list[float]:
    """Extreme values of a channel in the training runs; empty if unknown."""
    found: list[float] = []
    runs = result.get("runs")
    for entry in runs if isinstance(runs, Sequence) else ():
        if isinstance(entry, Mapping) and entry.get("role") == "training":
            ranges = entry.get("ranges")
            pair = ranges.get(name) if isinstance(ranges, Mapping) else None
            numbers = [finite(value) for value in pair] if isinstance(pair, list) else []
            found += [number for number in numbers if number is not None]
    return found


def _beyond(name: str, unit: str, values: Array, fitted: Sequence[float]) -> str:
    """Range of a channel beside the fitted one, if it leaves that; else empty."""
    known = values[np.isfinite(values)]
    if not fitted or not known.size:
        return ""
    low, high = min(fitted), max(fitted)
    margin = max(_MARGIN * (high - low), _WARMER if name == "temperature_degC" else 0.0)
    least, most = float(known.min()), float(known.max())
    if least >= low - margin and most <= high + margin:
        return ""
    pairs = ((least, most), (low, high))
    channel = name.split("_", maxsplit=1)[0]
    reached, known_to = (f"{number_text(a, 3)} to {number_text(b, 3)}" for a, b in pairs)
    return f"{channel} {reached} {unit}, fitted {known_to} {unit}"
