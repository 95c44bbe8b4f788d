"""Which parts of a basis are what other signals do in proportion.

Of the space that a basis spans and that of a few signals, the directions that are the same in both
are found by their canonical correlations; a basis that merely resembles a signal keeps all of it,
since data tell the two apart.

Source: Bjorck and Golub, Mathematics of Computation 27 (1973), 579-594 (angles between subspaces).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["imitated", "is_formed"]

Array = NDArray[np.float64]

_SAME: Final = 0.98
"""Squared cosine above which two directions are told apart by no more than a fiftieth."""
_SEEN: Final = 1e-8


def imitated(basis: Array, signals: Array) -> Array:
    """How much of each signal is in each function of a basis, along shared directions.

    Args:
        basis: (n_sample, n_function).
        signals: (n_sample, n_signal), no two of them alike.

    Returns:
        (n_function, n_signal) coefficients.
    """
    own, triangle = np.linalg.qr(signals)
    cosines = _orthonormal(basis).T @ own
    _, cosine, directions = np.linalg.svd(cosines, full_matrices=False)
    shared = directions[cosine**2 > _SAME]
    inside = (basis.T @ own) @ shared.T @ shared
    return np.asarray(np.linalg.lstsq(triangle, inside.T, rcond=_SEEN)[0].T)


def is_formed(basis: Array, signal: Array) -> bool:
    """Whether functions of a basis add up to a signal.

    Args:
        basis: (n_sample, n_function).
        signal: (n_sample,).
    """
    inside = _orthonormal(basis).T @ signal
    return bool(inside @ inside > _SAME * (signal @ signal))


def _orthonormal(basis: Array) -> Array:
    """(n_sample, n_direction) of the space that the columns span."""
    left, sizes, _ = np.linalg.svd(basis, full_matrices=False)
    return np.asarray(left[:, sizes > _SEEN * max(float(sizes[0]), 1e-300)])
