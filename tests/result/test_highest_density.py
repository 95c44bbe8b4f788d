"""Highest-density regions of posterior draws."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.result.highest_density import Density, density, enclosing_heights, outlines

Array = NDArray[np.float64]
LIMITS = ((-4.5, 4.5), (-4.5, 4.5))


def area(outline: Array) -> float:
    """Signed area of a closed outline, positive if counterclockwise."""
    x, y = outline.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def inside(outline: Array, x: Array, y: Array) -> NDArray[np.bool_]:
    """Mask of the points inside an outline, by ray crossings."""
    crossed = np.zeros(x.size, dtype=np.int_)
    for (ax, ay), (bx, by) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        between = (ay > y) != (by > y)
        if ay != by:
            crossed += between & (x < ax + (y - ay) / (by - ay) * (bx - ax))
    return np.asarray(crossed % 2 == 1, dtype=np.bool_)


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize("together", [0.0, 0.9])
def test_a_region_of_normal_draws_holds_its_share(share: float, together: float) -> None:
    """The region contains its probability by definition; smoothing widens it slightly."""
    rng = np.random.default_rng(41)
    x = rng.standard_normal(20_000)
    y = together * x + np.sqrt(1 - together**2) * rng.standard_normal(20_000)

    found = density(x, y, LIMITS)
    regions = outlines(found, enclosing_heights(found.height, [share])[0])

    held = np.any([inside(region, x, y) for region in regions], axis=0)
    assert held.mean() == pytest.approx(share, abs=0.05)


def test_an_outline_has_the_area_of_the_ellipse() -> None:
    """The 90 % region of an isotropic normal distribution is a disc of area 2 pi ln 10."""
    grid = np.linspace(-4.4, 4.4, 89)
    height = np.exp(-0.5 * (grid[:, None] ** 2 + grid[None, :] ** 2))

    (outline,) = outlines(Density(grid, grid, height), 0.1)

    assert area(outline) == pytest.approx(2 * np.pi * np.log(10), rel=0.01)


def test_two_hills_have_two_outlines_and_a_ring_has_a_hole() -> None:
    """Outer outlines run counterclockwise, holes clockwise, so that holes are not filled."""
    grid = np.linspace(-3, 3, 61)
    x, y = grid[None, :], grid[:, None]
    hills = np.exp(-8 * ((x - 1.5) ** 2 + y**2)) + np.exp(-8 * ((x + 1.5) ** 2 + y**2))
    ring = np.exp(-8 * (np.hypot(x, y) - 1.5) ** 2)

    assert [area(one) > 0 for one in outlines(Density(grid, grid, hills), 0.3)] == [True, True]
    assert sorted(area(one) > 0 for one in outlines(Density(grid, grid, ring), 0.3)) == [
        False,
        True,
    ]


def test_outlines_close_at_the_edge_of_the_grid() -> None:
    """The density outside the grid is zero."""
    grid = np.arange(5.0)

    (outline,) = outlines(Density(grid, grid, np.ones((5, 5))), 0.5)

    assert area(outline) == pytest.approx(25.0, rel=0.1)


def test_corners_that_are_level_break_no_outline() -> None:
    """Grid values of a histogram often equal the level; each outline must still close."""
    rng = np.random.default_rng(42)
    height = rng.integers(0, 4, size=(30, 30)).astype(np.float64)

    regions = outlines(Density(np.arange(30.0), np.arange(30.0), height), 2.0)

    assert len(regions) > 5
    assert all(np.all(np.isfinite(region)) for region in regions)


def test_a_constant_parameter_has_a_region() -> None:
    """Constant draws have no variance by which a correlation could be divided."""
    found = density(np.zeros(50), np.linspace(-1, 1, 50), LIMITS)

    assert found.height.sum() == pytest.approx(1.0)
