"""Collinearity between a basis and other signals, by canonical correlations.

The principal angles between the span of the basis and the span of the signals give the directions
that both contain.  A direction that is only similar does not count, since the data can separate it.

Source: Bjorck and Golub, Mathematics of Computation 27 (1973), 579-594 (angles between subspaces).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.arrays import Array

__all__ = ["imitated", "is_formed"]

_SAME: Final = 0.98
"""Squared cosine above which directions count as collinear: at most 2 % of their power differs."""
_SEEN: Final = 1e-8


def imitated(basis: Array, signals: Array) -> Array:
    """Coefficients (n_function, n_signal) of signals in basis functions along shared directions.

    The basis is (n_sample, n_function), the signals (n_sample, n_signal) are linearly independent.
    """
    own, triangle = np.linalg.qr(signals)
    cosines = _orthonormal(basis).T @ own
    _, cosine, directions = np.linalg.svd(cosines, full_matrices=False)
    shared = directions[cosine**2 > _SAME]
    inside = (basis.T @ own) @ shared.T @ shared
    return np.asarray(np.linalg.lstsq(triangle, inside.T, rcond=_SEEN)[0].T)


def is_formed(basis: Array, signal: Array) -> bool:
    """Whether a signal (n_sample,) lies in the span of a basis (n_sample, n_function), as above."""
    inside = _orthonormal(basis).T @ signal
    return bool(inside @ inside > _SAME * (signal @ signal))


def _orthonormal(basis: Array) -> Array:
    """(n_sample, n_direction) orthonormal basis of the column space."""
    left, sizes, _ = np.linalg.svd(basis, full_matrices=False)
    return np.asarray(left[:, sizes > _SEEN * max(float(sizes[0]), 1e-300)])
