"""Per-record amplitudes of effects, as states with a normal prior.

The first samples of a record determine its initial current and speed.  The runs may not determine
an amplitude that is free in each record: an error of the logged temperature that is equal in all
records, for example, is the same as another Ra25 and Kt25.  Along such a direction only the prior
decides, so the prior belongs to the cost, and its size has to be that of the amplitudes that the
runs do determine.

Source: MacKay, Neural Computation 4 (1992), 415-447, section 4 (evidence for a prior variance, and
the number of well-determined parameters).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.linear import solution
from identification.model.composite import MotorModel
from identification.model.simulate import Simulator

if TYPE_CHECKING:
    from identification.fit.solve import Fit

__all__ = ["amplitude_sizes", "own_cost"]


def own_cost(simulator: Simulator, states: Sequence[Array]) -> Array | float:
    """Negative log prior of the per-record amplitudes, zero without such states [-]."""
    cost: Array | float = 0.0
    for _, rows, size in _own(simulator.model):
        for state in states:
            cost = cost + 0.5 * np.sum((state[rows] / size) ** 2, axis=0)
    return cost


def amplitude_sizes(fit: Fit) -> dict[str, float]:
    """Prior standard deviation of the per-record amplitudes of each term, one step of iteration.

    With g = sum(1 - variance / size^2), the number of amplitudes that the runs determine, the size
    becomes the root of the sum of squares over g, by the name of the term, in the unit of its
    amplitudes.  A fixed point maximises the evidence.  If the runs determine less than one
    amplitude, the present size remains.
    """
    sizes: dict[str, float] = {}
    variances = _variances(fit)
    for name, rows, size in _own(fit.simulator.model):
        squares = sum(float(np.sum(state[rows] ** 2)) for state in fit.states)
        determined = float(np.sum(1.0 - variances[:, rows] / size**2))
        sizes[name] = float(np.sqrt(squares / determined)) if determined >= 1.0 else size
    return sizes


def _own(model: MotorModel) -> list[tuple[str, NDArray[np.int64], float]]:
    """Name, rows in the state, and prior size of the per-record amplitudes of each term."""
    found, at = [], 2
    for term in model.terms:
        own = [at + k for k, state in enumerate(term.states) if state.is_own]
        at += len(term.states)
        if own:
            size = next(state.scale for state in term.states if state.is_own)
            found.append((term.name, np.array(own, dtype=np.int64), float(size)))
    return found


def _variances(fit: Fit) -> Array:
    """Variances of the initial states, (n_record, n_state)."""
    equations = fit.equations
    covariance = equations.covariance()
    found = []
    for k, matrix in enumerate(equations.state_matrices):
        response = equations.state_response(k)
        own = solution(matrix, np.eye(matrix.shape[0]))
        found.append(np.diag(own) + np.einsum("ij,jk,ik->i", response, covariance, response))
    return np.array(found)
