"""Rank histograms as SVG: one panel per quantity, with the 99 % band of uniform ranks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from benchmarks.calibration.statistics import BINS, band
from identification.reporting.svg import Frame, axes, path, svg, svg_file, text
from identification.reporting.svg import band as area

__all__ = ["rank_histograms"]

_STYLE: Final = (
    "text{font:11px sans-serif;fill:#777}.mid{text-anchor:middle}.end{text-anchor:end}"
    ".frame{fill:none;stroke:#999}.grid{stroke:#9993}.bar{fill:#1e88e5;fill-opacity:.75}"
    ".band{fill:#8885}.mean{stroke:#777;stroke-dasharray:3 3;fill:none}"
)
_WIDTH, _HEIGHT = 186.0, 150.0
_LEFT, _TOP, _BOTTOM = 34.0, 22.0, 20.0


def rank_histograms(title: str, panels: Mapping[str, Sequence[float]], columns: int) -> str:
    """SVG text of a grid of rank histograms.

    Args:
        title: Title of the figure.
        panels: Ranks between 0 and 1 by name of the quantity.
        columns: Panels side by side.
    """
    body = "".join(
        f'<g transform="translate({_WIDTH * (k % columns):g} {_HEIGHT * (k // columns):g})">'
        f"{_panel(name, values)}</g>"
        for k, (name, values) in enumerate(panels.items())
    )
    rows = -(-len(panels) // columns)
    description = (
        "Histogram of the rank of the true value among the posterior draws, in ten bins; "
        "calibrated ranks are uniform, and 99 % of their counts lie in the grey band."
    )
    drawing = svg(_WIDTH * columns + 8.0, _HEIGHT * rows + 4.0, title, description, body)
    return svg_file(drawing, _STYLE)


def _panel(name: str, values: Sequence[float]) -> str:
    counts, edges = np.histogram(values, bins=BINS, range=(0.0, 1.0))
    low, high = band(len(values), 1.0 / BINS)
    top = 1.15 * max(float(counts.max(initial=0)), high, 1.0)
    box = (_LEFT, _TOP, _WIDTH - _LEFT - 6.0, _HEIGHT - _TOP - _BOTTOM)
    frame = Frame(box, (0.0, 1.0), (0.0, top))
    ends = np.array([0.0, 1.0])
    parts = [axes(frame, " ", "", (2, 3)), area(frame, ends, [low] * 2, [high] * 2)]
    for count, left, right in zip(counts, edges[:-1], edges[1:], strict=True):
        across = frame.x([left + 0.008, right - 0.008, right - 0.008, left + 0.008])
        parts.append(path(across, frame.y([0.0, 0.0, count, count]), "bar", closed=True))
    mean = len(values) / BINS
    parts.append(path(frame.x(ends), frame.y([mean, mean]), "mean"))
    parts.append(text(_LEFT, 15.0, f"{name} ({len(values)})", "label"))
    return "".join(parts)
