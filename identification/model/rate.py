"""Stiffness of a model: the spectral radius of h df/dx, which sets the integration plan."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identification.model.composite import INPUTS, MotorModel
from identification.model.excitation import Record

__all__ = ["rate_of"]

Array = NDArray[np.float64]

_STRUCTURES: Final = 128


def rate_of(
    model: MotorModel, records: Sequence[Record], values: Array, states: Sequence[Array]
) -> float:
    """Largest spectral radius of h df/dx over the given states of all records [-].

    Args:
        model: The model.
        records: Records that drive the model; h is the longest sample interval of each.
        values: (n_parameter,) physical.
        states: For each record (n_point, n_state), evenly spread over its samples.
    """
    largest = 0.0
    for record, points in zip(records, states, strict=True):
        rows = np.linspace(0, record.rows - 1, points.shape[0]).astype(int)
        each = _rate_jacobian(model, points.shape[0])
        columns = np.repeat(values[:, None], points.shape[0], axis=1)
        found = np.asarray(each(points.T, record.inputs[rows].T, columns))
        n = points.shape[1]
        stack = found.reshape(n, points.shape[0], n).transpose(1, 0, 2)
        stack = stack[np.isfinite(stack).all(axis=(1, 2))]
        if stack.size:
            radius = np.abs(np.linalg.eigvals(stack)).max()
            largest = max(largest, float(radius) * record.interval)
    return largest


@lru_cache(_STRUCTURES)
def _rate_jacobian(model: MotorModel, points: int) -> ca.Function:
    x = ca.SX.sym("x", len(model.state_names))
    u, p = ca.SX.sym("u", len(INPUTS)), ca.SX.sym("p", len(model.parameters))
    return ca.Function("jacobian", [x, u, p], [ca.jacobian(model.rates(x, u, p), x)]).map(points)
