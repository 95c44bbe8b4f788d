"""Stem plot of a residual correlation function with its confidence band."""

from __future__ import annotations

import numpy as np

from identification.report.svg import Frame, axes, band, path, svg
from identification.result.residuals import Correlation

__all__ = ["correlation_figure"]

_BOX = (54.0, 8.0, 396.0, 150.0)


def correlation_figure(
    title: str, found: Correlation, x_label: str, *, is_before: bool = False
) -> str:
    """Stems of a correlation function with its 99 % confidence band.

    Each plot has its own scale.  On the scale of the nominal model, the correlation of the final
    model would look like a flat line regardless of its content.

    Args:
        title: Title, which names the correlated signals.
        found: The correlation.
        x_label: Label of the lag axis.
        is_before: Whether it belongs to the nominal model, which has another colour.

    Returns:
        SVG text.
    """
    lags = found.lags
    frame = Frame(_BOX, (float(lags[0]) - 1.0, float(lags[-1]) + 1.0), _limits(found))
    body = axes(frame, x_label, "correlation", (6, 4))
    body += band(frame, lags, -found.half_width, found.half_width, "band bandwhite")
    body += path(np.array([_BOX[0], _BOX[0] + _BOX[2]]), frame.y(np.zeros(2)), "zero")
    outside = np.abs(found.values) > found.half_width
    loud = "stem before" if is_before else "stem loud"
    body += _stems(frame, found, ~outside, "stem") + _stems(frame, found, outside, loud)
    described = (
        f"{100.0 * found.outside:.1f} % of {lags.size} lags lie outside the band; "
        f"{100.0 * (1.0 - found.level):.0f} % expected for white noise."
    )
    return svg(460, 196, title, described, body)


def _stems(frame: Frame, found: Correlation, mask: np.ndarray, kind: str) -> str:
    mask = mask & np.isfinite(found.values)
    x, y = frame.x(found.lags[mask]), frame.y(np.clip(found.values[mask], *frame.y_range))
    zero = float(frame.y(0.0))
    marks = "".join(f"M{a:.1f} {zero:.1f}V{b:.1f}" for a, b in zip(x, y, strict=True))
    return f'<path class="{kind}" d="{marks}"/>' if marks else ""


def _limits(found: Correlation) -> tuple[float, float]:
    """Symmetric range, wide enough that the band does not fill the plot."""
    top = 1.15 * max(
        float(np.max(np.abs(found.values))), 2.5 * float(np.max(found.half_width)), 1e-6
    )
    return (-min(top, 1.08), min(top, 1.08))
