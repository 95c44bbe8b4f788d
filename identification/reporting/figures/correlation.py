"""Residual correlation functions of nominal and final model with their confidence band."""

from __future__ import annotations

import numpy as np

from identification.reporting.figures.chart import Band, Line, chart
from identification.result.residuals import Correlation

__all__ = ["correlation_figure"]


def correlation_figure(title: str, after: Correlation, before: Correlation | None = None) -> str:
    """Correlation over the lag with its 99 % band; both models share one scale."""
    outside = np.abs(after.values) > after.half_width
    shown = [("outside the band", "loud", outside), ("final model", "after", ~outside)]
    lines = [
        Line(label, kind, after.lags, np.where(chosen, after.values, np.nan), "stems")
        for label, kind, chosen in shown
        if chosen.any()
    ]
    if before is not None:
        lines.insert(0, Line("nominal model", "before", before.lags, before.values, "stems"))
    band = Band("measured", after.lags, -after.half_width, after.half_width)
    sizes = [after.values, 2.5 * after.half_width, *([] if before is None else [before.values])]
    top = min(1.15 * max(float(np.max(np.abs(size))) for size in sizes), 1.08)
    described = (
        f"{100.0 * after.outside:.1f} % of {after.lags.size} lags lie outside the band; "
        f"{100.0 * (1.0 - after.level):.0f} % expected for white noise."
    )
    labels = ("lag [samples]", "correlation")
    return chart(title, described, labels, lines, [band], y_range=(-top, top), height=200)
