"""View of a predicted run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, Literal

if TYPE_CHECKING:
    from app.analyses.prediction import Prediction
    from identification.arrays import Array

__all__ = ["prediction_view"]

_WIDE: Final = 920.0
"""Width of a figure that spans the page [drawing units]."""


def prediction_view(name: str, prediction: Prediction) -> dict[str, Any]:
    """Figure and table of a prediction."""
    from identification.reporting.figures.curves import prediction_figure
    from identification.reporting.figures.drawn import drawn_chart
    from identification.result.attempts import figure
    from identification.result.numbers import number_text, percent_text

    time = _array(prediction.plot["time"])

    def drawn(channel: Literal["speed", "current"]) -> str:
        measured, simulated = map(_array, prediction.plot[channel])
        return drawn_chart(prediction_figure(name, channel, time, (measured, simulated)), _WIDE)

    rows = []
    for channel, unit in (("current", "A"), ("speed", "rad/s")):
        found: Mapping[str, float | None] = prediction.errors[channel]
        nrmse = found["nrmse"]
        rows.append(
            {
                "channel": channel,
                "rmse": number_text(found["rmse"], 3),
                "unit": unit,
                "fit": percent_text(None if nrmse is None else 1.0 - nrmse, 4),
                "ratio": number_text(found["noise_ratio"], 3),
            }
        )
    figures = [figure(f"predicted {channel}", drawn, channel) for channel in ("speed", "current")]
    return {"figures": figures, "rows": rows}


def _array(values: Sequence[float | None]) -> Array:
    """Values as an array, NaN for null."""
    import numpy as np

    return np.array(values, dtype=np.float64)
