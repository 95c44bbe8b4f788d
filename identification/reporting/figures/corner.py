"""Corner plot of the posterior: marginal histograms and pairwise highest-density regions."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array, evenly
from identification.reporting.svg import Frame, path, svg, text, tick_words
from identification.result.highest_density import density, enclosing_heights, outlines
from identification.result.numbers import scaled_unit, unit_power
from identification.result.report_data import PosteriorChain

__all__ = ["MOST_PARAMETERS", "corner_figure"]

MOST_PARAMETERS = 14
"""Largest number of parameters shown; more panels would be too small to read."""

_LEFT, _TOP, _BOTTOM, _GAP = 52.0, 18.0, 22.0, 8.0
_SHARES = (0.9, 0.5)
_DIGIT = 6.4
"""Width of a digit of a tick label [drawing units]."""
_LETTER = 7.6
"""Width of a bold letter of a parameter name [drawing units]."""


def corner_figure(posterior: PosteriorChain) -> str:
    """Histograms on the diagonal, regions of 50 % and 90 % of the draws below it.

    Name and unit, with the power of ten of the axis, stand above the panel on the diagonal: to its
    right is nothing that they could overlap.
    """
    names, units = posterior.names[:MOST_PARAMETERS], posterior.units[:MOST_PARAMETERS]
    draws = posterior.chain.reshape(-1, posterior.chain.shape[2])[:, : len(names)]
    draws = draws[evenly(len(draws), 20_000)]
    powers = [
        unit_power(float(np.max(np.abs(np.quantile(column, (0.05, 0.95)))))) for column in draws.T
    ]
    draws = draws * 10.0 ** -np.array(powers, dtype=np.float64)
    limits = [_limits(column) for column in draws.T]
    # With 14 parameters, the label of the last one ends at the width of the page, 990 px.
    size = min(118.0, 728.0 / len(names))
    body = []
    for row in range(len(names)):
        for column in range(row + 1):
            box = (_LEFT + column * (size + _GAP), _TOP + row * (size + _GAP), size, size)
            body.append(_panel(box, draws, limits, row, column))
    side = len(names) * (size + _GAP)
    room = 0.0
    for index, (name, unit, power) in enumerate(zip(names, units, powers, strict=True)):
        unit = scaled_unit(unit, power)
        bare = name.removesuffix("_A").removesuffix("_rad_s")
        words = f"{bare} [{unit}]" if unit else bare
        left = index * (size + _GAP) + (0.0 if index == 0 else 4.0)
        body.append(text(_LEFT + left, _TOP + index * (size + _GAP) - 4.0, words, "label strong"))
        room = max(room, left + _LETTER * len(words))
    return svg(
        _LEFT + max(side, room),
        _TOP + side + _BOTTOM,
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
    if row == column:
        marks += _marginal(box, draws[:, column], limits[column])
    else:
        marks += _regions(frame, draws[:, column], draws[:, row])
    if row == len(limits) - 1:
        for at, word in _ticks_across(frame):
            marks += text(at, top + height + 13, word, "tick mid")
    if column == 0 and row > 0:
        for value, word in tick_words(*limits[row], 3)[:4]:
            marks += text(left - 5, float(frame.y(value)) + 3, word, "tick end")
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
    """Range of nearly all draws, so that a single stray walker does not shrink the plot."""
    low, high = np.quantile(draws, (0.001, 0.999))
    room = 0.08 * (high - low) or 0.05 * abs(float(high)) or 1.0
    return (float(low - room), float(high + room))


def _ticks_across(frame: Frame) -> list[tuple[float, str]]:
    """Positions and labels of two ticks that overlap neither each other nor the next panel."""
    left, _, width, _ = frame.box
    single: list[tuple[float, str]] = []
    for about in range(2, 9):
        words = tick_words(*frame.x_range, about)
        reach = 0.5 * _DIGIT * max(len(word) for _, word in words)
        inside = [
            (at, word)
            for at, word in ((float(frame.x(value)), word) for value, word in words)
            if left + reach - _GAP / 2 <= at <= left + width - reach + _GAP / 2
        ]
        if len(inside) > 1 and inside[-1][0] - inside[0][0] > 2.2 * reach:
            return [inside[0], inside[-1]]
        single = single or inside[:1]
    return single
