"""Types of the numerical arrays, and indices of marked and of evenly spaced values.

Docstrings give the axes and the unit of each array.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "Bool", "Complex", "Index", "evenly", "stretches"]

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Complex = NDArray[np.complex128]
Index = NDArray[np.intp]


def stretches(marked: Bool) -> Index:
    """First and last (exclusive) index of each stretch of true values, (n_stretch, 2)."""
    edges: Index = np.flatnonzero(np.diff(np.concatenate(([False], marked, [False]))))
    return edges.reshape(-1, 2)


def evenly(count: int, most: int) -> Index:
    """At most `most` indices of `count` values, evenly spaced, with the first and the last."""
    return np.unique(np.linspace(0, count - 1, most).astype(np.intp))
