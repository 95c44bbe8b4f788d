"""Highest-density regions of the draws of two parameters.

A two-dimensional histogram is smoothed with a bandwidth by Scott's rule, cut at the densities that
enclose given fractions of the draws, and traced to closed contours by marching squares.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from identification.arrays import Array

__all__ = ["Density", "density", "enclosing_heights", "outlines"]

_Edge = tuple[int, int, bool]


@dataclass(frozen=True, eq=False)
class Density:
    """Density of draws on a grid."""

    x: Array
    """(n_x,) centres of the cells."""
    y: Array
    """(n_y,) centres of the cells."""
    height: Array
    """(n_y, n_x) fraction of the draws in each cell [-]."""


def density(
    x: Array, y: Array, limits: tuple[tuple[float, float], tuple[float, float]], cells: int = 36
) -> Density:
    """Smoothed histogram of draws (n_draw,) over ranges of x and y, with cells along each axis.

    The standard deviation of the smoothing kernel is n^(-1/6) (Scott's rule in two dimensions)
    times the conditional standard deviation of one parameter given the other, so that a narrow
    ridge is not smeared into a lobe.
    """
    counts, y_edges, x_edges = np.histogram2d(y, x, bins=cells, range=(limits[1], limits[0]))
    together = float(np.corrcoef(x, y)[0, 1]) if min(x.std(), y.std()) > 0.0 else 0.0
    reach = np.sqrt(1.0 - together**2) * x.size ** (-1.0 / 6.0)
    widths = []
    for values, edges in ((y, y_edges), (x, x_edges)):
        cell = edges[1] - edges[0]
        widths.append(max(float(values.std() * reach / cell), 0.6))
    smooth = ndimage.gaussian_filter(counts, widths, mode="constant")
    total = smooth.sum()
    return Density(
        x=0.5 * (x_edges[1:] + x_edges[:-1]),
        y=0.5 * (y_edges[1:] + y_edges[:-1]),
        height=smooth / total if total > 0.0 else smooth,
    )


def enclosing_heights(height: Array, shares: Sequence[float]) -> list[float]:
    """Densities whose level sets are the smallest that enclose each of `shares` of the mass [-]."""
    order = np.sort(height.ravel())[::-1]
    mass = np.cumsum(order)
    return [
        float(order[min(np.searchsorted(mass, share * mass[-1]), order.size - 1)])
        for share in shares
    ]


def outlines(found: Density, level: float) -> list[Array]:
    """Closed contours, (n_point, 2) each, of the region above a level of density.

    The density counts as zero beyond the grid, so that every contour closes.
    """
    padded = np.pad(found.height, 1)
    x, y = _beyond(found.x), _beyond(found.y)
    follow = _segments(padded, level)
    loops: list[Array] = []
    while follow:
        start, edge = follow.popitem()
        loop = [start]
        while edge != start:
            loop.append(edge)
            edge = follow.pop(edge)
        loops.append(_places(padded, level, loop, (x, y)))
    return loops


def _beyond(centres: Array) -> Array:
    """Cell centres, extended by one cell on either side."""
    step = centres[1] - centres[0]
    return np.concatenate(([centres[0] - step], centres, [centres[-1] + step]))


_BOTTOM, _RIGHT, _TOP, _LEFT = range(4)


def _crossings(pattern: int) -> Iterator[tuple[int, int]]:
    """Sides of a cell where a contour enters and leaves, the high corners on its left.

    Args:
        pattern: Corners above the level: bit 0 lower left, 1 lower right, 2 upper right, 3 upper
            left; side k lies between the corners k and k + 1.
    """
    high = [bool(pattern >> corner & 1) for corner in range(4)]
    for enter in range(4):
        if high[enter] and not high[(enter + 1) % 4]:
            yield enter, next(side % 4 for side in range(enter - 1, -4, -1) if not high[side])


def _segments(height: Array, level: float) -> dict[_Edge, _Edge]:
    """Segments of the contours from edge to edge; each edge starts at most one segment.

    Edges have integer keys, so that segments join exactly, even if a corner equals the level.
    """
    above = (height > level).astype(np.int_)
    pattern = above[:-1, :-1] + 2 * above[:-1, 1:] + 4 * above[1:, 1:] + 8 * above[1:, :-1]
    follow: dict[_Edge, _Edge] = {}
    for row, column in zip(*np.nonzero((pattern > 0) & (pattern < 15)), strict=True):
        for enter, leave in _crossings(int(pattern[row, column])):
            follow[_edge(int(row), int(column), enter)] = _edge(int(row), int(column), leave)
    return follow


def _edge(row: int, column: int, side: int) -> _Edge:
    """Key of one side of a cell: its first corner and whether it lies along x."""
    return (row + (side == _TOP), column + (side == _RIGHT), side in (_BOTTOM, _TOP))


def _places(
    height: Array, level: float, loop: Sequence[_Edge], centres: tuple[Array, Array]
) -> Array:
    """Points where the level crosses each edge, by linear interpolation: (n_edge, 2) x and y."""
    row, column, along_x = (np.array(part) for part in zip(*loop, strict=True))
    low, high = height[row, column], height[row + ~along_x, column + along_x]
    share = (level - low) / (high - low)
    x, y = centres
    across = np.interp(column + along_x * share, np.arange(x.size), x)
    return np.column_stack([across, np.interp(row + ~along_x * share, np.arange(y.size), y)])
