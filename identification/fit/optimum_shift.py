"""First-order change of an optimum by a change of the simulation.

If the simulated channels change by d, the optimum moves by -C J'W d, with the sensitivities J, the
weights W and the covariance C of the parameters.  Initial states are eliminated, as in the normal
equations.

Source: Schmidt, in Advances in Control Systems 3 (1966), 293-340 (consider covariance).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.arrays import Array
from identification.fit.derivatives import gradient_of
from identification.fit.solve import Fit
from identification.linear import solution

__all__ = ["optimum_shifts"]


def optimum_shifts(fit: Fit, changes: Sequence[Array]) -> list[Array]:
    """Change (n_parameter, n_change) of the search coordinates by the change in each record alone.

    The changes are those of the simulated channels, (n_sample, 2, n_change) for each record [A,
    rad/s]; the optimum moves by the sum over the records.
    """
    equations, weighting = fit.equations, fit.weighting
    size = fit.position.size
    rights = [np.zeros((size + fit.simulator.n_state, each.shape[2])) for each in changes]
    for block in equations.derivatives.blocks(weighting.order):
        k = block.record
        change = changes[k][block.samples]
        rights[k] += gradient_of(change, block.tangent, weighting, k, block.start, block.lead)
    covariance = equations.covariance()
    return [
        -covariance @ (right[:size] - coupling.T @ solution(matrix, right[size:]))
        for right, coupling, matrix in zip(
            rights, equations.couplings, equations.state_matrices, strict=True
        )
    ]
