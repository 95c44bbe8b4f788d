"""Roots in brackets by Chandrupatla's method, for many functions at once.

A step interpolates the inverse quadratically if three points near the root are well placed, and
bisects otherwise.

Source: Chandrupatla, Advances in Engineering Software 28 (1997), 145-149.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array

__all__ = ["root"]

Index = NDArray[np.intp]

_EPS, _TINY = float(np.finfo(np.float64).eps), float(np.finfo(np.float64).tiny)
_MOST_STEPS: Final = 2046
"""Bisections from the largest to the smallest normal number."""


def root(
    function: Callable[..., Array], bracket: tuple[Array, Array], args: tuple[Array | Index, ...]
) -> Array:
    """Roots (n_root,) between two ends to machine precision; NaN where the sign does not change.

    The function is called with (n,) abscissae and the same rows of each of `args`.
    """
    found = np.full(bracket[0].size, np.nan)
    if not found.size:
        return found
    rows = np.arange(found.size)
    # A difference may overflow or be zero; the step is then a bisection.
    with np.errstate(all="ignore"):
        (x1, f1), (x2, f2) = ((x, function(x, *args)) for x in bracket)
        x3, f3, share = x2, f2, np.full(x1.size, 0.5)
        for step in range(_MOST_STEPS):
            nearest = np.where(np.abs(f1) < np.abs(f2), x1, x2)
            width, tolerance = np.abs(x2 - x1), 4 * (np.abs(nearest) * _EPS + _TINY)
            is_root = np.minimum(np.abs(f1), np.abs(f2)) <= _TINY
            is_bracket = (np.sign(f1) * np.sign(f2) < 0) & np.isfinite(width)
            found[rows] = np.where(is_root | is_bracket, nearest, np.nan)
            going = np.flatnonzero(is_bracket & ~is_root & (width >= tolerance))
            if not going.size:
                break
            if going.size < rows.size:
                rows, args = rows[going], tuple(each[going] for each in args)
                x1, x2, x3, f1, f2, f3 = (each[going] for each in (x1, x2, x3, f1, f2, f3))
                share = share[going]
            if step:
                least = 0.5 * (tolerance / width)[going]
                share = np.clip(_interpolated((x1, x2, x3), (f1, f2, f3)), least, 1 - least)
            x = x1 + share * (x2 - x1)
            f = function(x, *args)
            same = np.sign(f) == np.sign(f1)
            x1, x2, x3 = x, np.where(same, x2, x1), np.where(same, x1, x2)
            f1, f2, f3 = f, np.where(same, f2, f1), np.where(same, f1, f2)
    return found


def _interpolated(x: tuple[Array, Array, Array], f: tuple[Array, Array, Array]) -> Array:
    """Share of the way from x1 to x2: inverse quadratic interpolation, or one half."""
    (x1, x2, x3), (f1, f2, f3) = x, f
    place, value = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
    along = (x3 - x1) / (x2 - x1)
    quadratic = f1 / (f1 - f2) * f3 / (f3 - f2) - along * f1 / (f3 - f1) * f2 / (f2 - f3)
    is_monotone = (1 - np.sqrt(1 - place) < value) & (value < np.sqrt(place))
    return np.where(is_monotone, quadratic, 0.5)
