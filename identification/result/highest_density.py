"""Highest-density regions of the draws of two parameters.

A two-dimensional histogram is smoothed with a bandwidth by Scott's rule, cut at the densities that
enclose given fractions of the draws, and traced to closed contours by contourpy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from contourpy import contour_generator
from scipy import ndimage

from identification.arrays import Array

__all__ = ["Density", "density", "enclosing_heights", "outlines"]


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
    generator = contour_generator(_beyond(found.x), _beyond(found.y), np.pad(found.height, 1))
    # contourpy repeats the first point of a closed contour.
    return [np.asarray(loop)[:-1] for loop in generator.lines(level)]


def _beyond(centres: Array) -> Array:
    """Cell centres, extended by one cell on either side."""
    step = centres[1] - centres[0]
    return np.concatenate(([centres[0] - step], centres, [centres[-1] + step]))
