"""Values of CasADi functions at many points."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from identification.arrays import Array

__all__ = ["values_at"]


def values_at(function: ca.Function, *points: Array) -> Array:
    """Values (n_point, n_out) of a function with one dense output at points (n_point, n_in).

    Uses buffers, since the conversion of arrays to CasADi matrices would dominate the run time.
    """
    given = [np.ascontiguousarray(each, dtype=np.float64) for each in points]
    found = np.empty((given[0].shape[0], function.numel_out(0)))
    buffer, evaluate = _mapped(function, found.shape[0]).buffer()
    # A memoryview has a size of its own; the stubs lack this overload.
    for k, each in enumerate(given):
        buffer.set_arg(k, each.data)  # type: ignore[call-arg]
    buffer.set_res(0, found.data)  # type: ignore[call-arg]
    evaluate()
    return found


@lru_cache(64)
def _mapped(function: ca.Function, count: int) -> ca.Function:
    """The function at `count` points at once; its construction takes longer than a call."""
    return function.map(count)
