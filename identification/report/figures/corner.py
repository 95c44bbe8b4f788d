"""The posterior of all parameters, each alone and each against each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.report.contours import density, enclosing_heights, outlines
from identification.report.data import PosteriorChain
from identification.report.numbers import unit_text
from identification.report.svg import Frame, path, svg, text, ticks

__all__ = ["MOST_PARAMETERS", "corner_figure"]

Array = NDArray[np.float64]

MOST_PARAMETERS = 14
"""More make panels too small to read."""

_LEFT, _BOTTOM, _GAP = 74.0, 66.0, 6.0
_SHARES = (0.9, 0.5)


def corner_figure(posterior: PosteriorChain) -> str:
    """Histograms on the diagonal, regions of 50 % and 90 % of the draws below it.

    Axes show the value itself scaled to a power of ten that stands beside the name.
    """
    names, units = posterior.names[:MOST_PARAMETERS], posterior.units[:MOST_PARAMETERS]
    draws = posterior.chain.reshape(-1, posterior.chain.shape[2])[:, : len(names)]
    draws = draws[_spread_rows(draws.shape[0], 20_000)]
    powers = [_power(column) for column in draws.T]
    draws = draws * 10.0 ** -np.array(powers, dtype=np.float64)
    limits = [_limits(column) for column in draws.T]
    size = min(118.0, 880.0 / len(names))
    body = []
    for row in range(len(names)):
        for column in range(row + 1):
            box = (
                _LEFT + column * (size + _GAP),
                4.0 + row * (size + _GAP),
                size,
                size,
            )
            body.append(_panel(box, draws, limits, row, column))
    side = len(names) * (size + _GAP)
    labels = [
        _label(name, unit, power) for name, unit, power in zip(names, units, powers, strict=True)
    ]
    for index, (name, unit) in enumerate(labels):
        centre = index * (size + _GAP) + size / 2
        body.append(text(_LEFT + centre, side + 44, name, "label mid strong"))
        body.append(text(_LEFT + centre, side + 58, unit, "tick mid"))
        if index:
            body.append(text(14, 4.0 + centre, name, "label mid strong", turned=True))
            body.append(text(28, 4.0 + centre, unit, "tick mid", turned=True))
    return svg(
        _LEFT + side,
        side + _BOTTOM,
        "Posterior of all parameters",
        f"Corner plot of {', '.join(names)}: marginal histograms and regions that hold 50 % and "
        "90 % of the draws.",
        "".join(body),
    )


def _panel(
    box: tuple[float, float, float, float],
    draws: Array,
    limits: list[tuple[float, float]],
    row: int,
    column: int,
) -> str:
    frame = Frame(box, limits[column], limits[row])
    left, top, width, height = box
    marks = f'<rect class="frame" x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{height:.1f}"/>'  # noqa: E501
    marks += (
        _marginal(box, draws[:, column], limits[column])
        if row == column
        else _regions(frame, draws[:, column], draws[:, row])
    )
    if row == len(limits) - 1:
        for value in ticks(*limits[column], 2):
            at = float(frame.x(value))
            marks += text(at, top + height + 14, _plain(value, limits[column]), "tick mid small")
    if column == 0 and row > 0:
        for value in ticks(*limits[row], 3):
            at = float(frame.y(value))
            marks += text(left - 5, at + 3, _plain(value, limits[row]), "tick end small")
    return marks


def _marginal(
    box: tuple[float, float, float, float], draws: Array, limits: tuple[float, float]
) -> str:
    counts, edges = np.histogram(draws, bins=32, range=limits)
    frame = Frame(box, limits, (0.0, 1.12 * max(float(counts.max()), 1.0)))
    x = np.repeat(edges, 2)
    y = np.concatenate(([0.0], np.repeat(counts, 2), [0.0]))
    low, middle, high = np.quantile(draws, (0.05, 0.5, 0.95))
    inside = np.clip(x, low, high)
    marks = path(frame.x(inside), frame.y(y), "band", closed=True)
    marks += path(frame.x(x), frame.y(y), "line after thin")
    edge = np.array(frame.y_range)
    return marks + path(frame.x(np.full(2, middle)), frame.y(edge), "zero")


def _regions(frame: Frame, x: Array, y: Array) -> str:
    found = density(x, y, (frame.x_range, frame.y_range))
    marks = ""
    for height, kind in zip(
        enclosing_heights(found.height, _SHARES), ("region", "region inner"), strict=True
    ):
        pieces = []
        for outline in outlines(found, height):
            points = zip(frame.x(outline[:, 0]), frame.y(outline[:, 1]), strict=True)
            pieces.append("M" + " ".join(f"{a:.1f} {b:.1f}" for a, b in points) + "Z")
        marks += f'<path class="{kind}" d="{"".join(pieces)}"/>'
    return marks


def _limits(draws: Array) -> tuple[float, float]:
    """Range of nearly all draws; a single stray walker must not shrink the picture."""
    low, high = np.quantile(draws, (0.001, 0.999))
    room = 0.08 * (high - low) or 0.05 * abs(float(high)) or 1.0
    return (float(low - room), float(high + room))


def _power(draws: Array) -> int:
    size = float(np.max(np.abs(np.quantile(draws, (0.05, 0.95)))))
    if size == 0.0 or 0.05 <= size < 1000.0:
        return 0
    return int(np.floor(np.log10(size)))


def _label(name: str, unit: str, power: int) -> tuple[str, str]:
    scale = f"10{str(power).translate(_SUPERSCRIPT)} " if power else ""
    return (name, f"{scale}{unit_text(unit)}".strip())


_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def _plain(value: float, limits: tuple[float, float]) -> str:
    step = (limits[1] - limits[0]) / 4.0
    decimals = int(max(0, np.ceil(-np.log10(step)))) if step > 0.0 else 2
    return f"{value:.{min(decimals, 6)}f}".replace("-", "−")


def _spread_rows(size: int, most: int) -> NDArray[np.int_]:
    return np.unique(np.linspace(0, size - 1, min(size, most)).astype(np.int_))
