"""Steps that an iteration of the optimiser tries, as parallel lanes of one simulation.

The lanes are the Levenberg-Marquardt steps of a ladder of damping parameters.  If the best gains
far less than the quadratic model predicts, the valley is curved, and the steps are corrected to
second order (geodesic acceleration).  If an undamped step gains far more, the Gauss-Newton matrix
overstates the curvature, because the residual is large, and the step is lengthened.  A damped step
is not: far from the optimum, a long one may end in another valley.

Source: Transtrum and Sethna, arXiv preprint 1201.5885 (2012) (geodesic acceleration).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.fit.normal_equations import NormalEquations
from identification.fit.own_states import own_cost
from identification.model.parameter import Coordinates
from identification.model.simulate import Simulator
from identification.model.weighting import Weighting

__all__ = ["NEGLIGIBLE", "cost_of", "trial_steps"]

NEGLIGIBLE: Final = 1e-3
"""Gain in log likelihood that is 0.045 standard deviations."""
_STRAIGHT: Final = 0.3
"""Achieved over predicted gain below which the valley is curved [-]."""
_PROBE: Final = 0.1
"""Fraction of a step at which its second derivative is measured [-]."""
_SHORTER: Final = np.array([0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 0.001])
"""Fractions of the undamped step that are tried if no damping lowers the cost."""
_LONGER: Final = np.array([2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0])
"""Multiples of an undamped step that are tried if it gains more than predicted."""
_UNDERSTATED: Final = 1.5
"""Achieved gain over predicted gain above which the step is too short: at an overstated curvature
the ratio is 1 to 2, and 2 if there is none."""


def trial_steps(
    equations: NormalEquations,
    coordinates: Coordinates,
    start: tuple[Array, list[Array]],
    expected: tuple[float, float],
    weighting: Weighting,
    ladder: Array,
) -> tuple[tuple[Array, list[Array]], Array, Weighting]:
    """Points to which a step may lead, their costs, and the noise model scaled to the best.

    If a curved valley makes the steps gain little, they are corrected to second order.  If no step
    lowers the cost, the undamped step is shortened.  The damping does not limit initial states, and
    that of a speed which friction stops at once has hardly a derivative, so that its step leaves
    the range in which friction is linear.

    The start has search coordinates (n_parameter,) and for each record an initial state (n_state,);
    `expected` is its cost, and the predicted decrease by a full step; the ladder is (n_lane,).
    """
    simulator, (at, x0), (cost, decrement) = equations.derivatives.simulator, start, expected
    steps, moves = equations.steps(ladder, at, coordinates)
    trial = at[:, None] + steps, [x[:, None] + move for x, move in zip(x0, moves, strict=True)]
    costs, sized = cost_of(simulator, coordinates, trial[0], trial[1], weighting)
    if cost - costs.min() < _STRAIGHT * decrement - NEGLIGIBLE:
        bent = _bent(equations, coordinates, start, trial, weighting, ladder)
        bent_costs, bent_sized = cost_of(simulator, coordinates, bent[0], bent[1], weighting)
        if bent_costs.min() < costs.min():
            trial, costs, sized = bent, bent_costs, bent_sized
    best = int(np.argmin(costs))
    if ladder[best] == 0.0 and cost - costs[best] > _UNDERSTATED * decrement + NEGLIGIBLE:
        # The lanes remain those of the ladder; the best one is replaced.
        far, far_costs, far_sized = _lengthened(equations, coordinates, at, trial, best, weighting)
        if far_costs.min() < costs.min():
            costs[best], sized = far_costs.min(), far_sized
            for end, ends in zip([trial[0], *trial[1]], [far[0], *far[1]], strict=True):
                end[:, best] = ends[:, int(np.argmin(far_costs))]
    if not costs.min() < cost and decrement > 1.0:
        trial = (
            at[:, None] + np.outer(steps[:, 0], _SHORTER),
            [x[:, None] + np.outer(m[:, 0], _SHORTER) for x, m in zip(x0, moves, strict=True)],
        )
        costs, sized = cost_of(simulator, coordinates, trial[0], trial[1], weighting)
    return trial, costs, sized


def _lengthened(
    equations: NormalEquations,
    coordinates: Coordinates,
    at: Array,
    trial: tuple[Array, list[Array]],
    best: int,
    weighting: Weighting,
) -> tuple[tuple[Array, list[Array]], Array, Weighting]:
    """Multiples of the best step within the bounds, their costs, and the noise model.

    The initial states follow the parameters.
    """
    simulator, end = equations.derivatives.simulator, trial[0][:, best, None]
    lower, upper = coordinates.lower[:, None], coordinates.upper[:, None]
    position = np.clip(at[:, None] + (end - at[:, None]) * _LONGER, lower, upper)
    states = [
        x[:, best, None] + equations.state_response(k) @ (position - end)
        for k, x in enumerate(trial[1])
    ]
    costs, sized = cost_of(simulator, coordinates, position, states, weighting)
    return (position, states), costs, sized


def _bent(
    equations: NormalEquations,
    coordinates: Coordinates,
    start: tuple[Array, Sequence[Array]],
    trial: tuple[Array, list[Array]],
    weighting: Weighting,
    ladder: Array,
) -> tuple[Array, list[Array]]:
    """The steps of a ladder with geodesic acceleration.

    The second derivative along each step comes from one more simulation at a tenth of the step.
    """
    at, x0 = start[0][:, None], [x[:, None] for x in start[1]]
    steps = trial[0] - at
    moves = [end - x for end, x in zip(trial[1], x0, strict=True)]
    probe = equations.derivatives.simulator.logged(
        coordinates.values(at + _PROBE * steps),
        [x + _PROBE * move for x, move in zip(x0, moves, strict=True)],
    )
    directions = [np.concatenate([steps, move]) for move in moves]
    curved, finite = equations.curved(directions, probe, _PROBE, weighting)
    bends, state_bends = equations.bends(ladder, start[0], coordinates, curved)
    lower, upper = coordinates.lower[:, None], coordinates.upper[:, None]
    position = np.where(finite, np.clip(trial[0] + bends, lower, upper), trial[0])
    states = [
        np.where(finite, end + bend, end) for end, bend in zip(trial[1], state_bends, strict=True)
    ]
    return position, states


def cost_of(
    simulator: Simulator,
    coordinates: Coordinates,
    position: Array,
    states: Sequence[Array],
    weighting: Weighting,
) -> tuple[Array, Weighting]:
    """Cost of each lane of `position`, and the noise model scaled to the best lane."""
    sums = simulator.misfit(coordinates.values(position), states, weighting)
    prior = coordinates.log_prior(position)
    cost = weighting.sized(sums)[1] - prior + own_cost(simulator, states)
    cost = np.where(np.isfinite(cost), cost, np.inf)
    return cost, weighting.sized(sums[:, int(np.argmin(cost))])[0]
