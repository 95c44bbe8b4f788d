"""Correlation of a residual as stems against its band."""

from __future__ import annotations

import numpy as np

from identification.diagnosis.residual import Correlation
from identification.report.svg import Frame, axes, band, dots, path, svg

__all__ = ["correlation_figure"]

_BOX = (54.0, 8.0, 396.0, 150.0)


def correlation_figure(
    title: str, after: Correlation, before: Correlation | None, x_label: str
) -> str:
    """Stems of one correlation function, with the band in which 99 of 100 should end.

    Args:
        title: What is correlated with what.
        after: Of the final model.
        before: Of the declared model, drawn as dots; None where that is the final one.
        x_label: Label of the lags.

    Returns:
        Text of the drawing.
    """
    frame = Frame(_BOX, (float(after.lags[0]) - 1.0, float(after.lags[-1]) + 1.0), _limits(after))
    if before is not None:
        lower, upper = _limits(before)
        low, high = frame.y_range
        frame = Frame(_BOX, frame.x_range, (min(low, lower), max(high, upper)))
    outside = np.abs(after.values) > after.half_width
    body = axes(frame, x_label, "correlation", (6, 4))
    body += band(frame, after.lags, -after.half_width, after.half_width, "band bandwhite")
    body += path(np.array(_BOX[0] + np.array([0.0, _BOX[2]])), frame.y(np.zeros(2)), "zero")
    if before is not None:
        body += dots(frame, before.lags, before.values, "dots before")
    for mask, kind in ((~outside, "stem"), (outside, "stem loud")):
        body += _stems(frame, after, mask, kind)
    percent = f"{100.0 * after.outside:.0f}"
    described = (
        f"{percent} % of {after.lags.size} lags leave the band; "
        f"{100.0 * (1.0 - after.level):.0f} % would by chance."
    )
    return svg(460, 196, title, described, body)


def _stems(frame: Frame, found: Correlation, mask: np.ndarray, kind: str) -> str:
    x, y = frame.x(found.lags[mask]), frame.y(found.values[mask])
    zero = float(frame.y(0.0))
    marks = "".join(f"M{a:.1f} {zero:.1f}V{b:.1f}" for a, b in zip(x, y, strict=True))
    return f'<path class="{kind}" d="{marks}"/>' if marks else ""


def _limits(found: Correlation) -> tuple[float, float]:
    """Symmetric, and never so tight that the band fills the picture."""
    top = 1.15 * max(
        float(np.max(np.abs(found.values))), 2.5 * float(np.max(found.half_width)), 1e-6
    )
    return (-min(top, 1.08), min(top, 1.08))
