"""Gauss-Newton on the simulation error, with free initial states and unknown noise.

The likelihood of independent normal errors with one unknown standard deviation a channel is, with
that deviation at its best value, a sum of N/2 log(SSE) over the channels.  Its Gauss-Newton step
is that of least squares weighted by the current deviations.  Initial states concern their own
record only and are eliminated from the normal equations (Schur complement), so that a hundred
runs cost no more than their simulation.

Damping: the steps for a ladder of Levenberg-Marquardt parameters are simulated side by side, as
lanes of one simulation, and the best is taken.  After a step that needed much damping the rungs
are closer there: between a tenth and a hundred lies all that helps in a sharp corner.

Where even the best gains far less than the quadratic model promised the valley is curved, and the
steps are bent along it (geodesic acceleration), which turns hundreds of short steps into a few.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.fit.normal_equations import NormalEquations, normal_equations
from identification.model.parameter import Coordinates
from identification.model.simulate import Simulator, initial_states
from identification.model.weighting import Weighting
from identification.work import Budget

__all__ = ["Fit", "Patience", "solve"]

Array = NDArray[np.float64]

_LADDER: Final = np.array([0.0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-1, 1e2])
_STEEP: Final = np.array([1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0])
"""Damping where the step before needed more than the least of these."""

_ENOUGH: Final = 1e-3
"""Log likelihood that another step may promise at the optimum; it is 0.045 standard deviations."""

_DECISIVE: Final = 0.002
"""Share of the difference to a better model that decides nothing."""

_STRAIGHT: Final = 0.3
_TRIED: Final = 3
_OPTIMISM: Final = 5.0
"""Gain until the optimum, at most, over what one step promises."""
_PROBE: Final = 0.1


@dataclass(frozen=True)
class Patience:
    """When a fit is given up.

    Args:
        steps: Steps after which to stop in any case.
        hopeless: Cost of a rival; the fit stops where it is not going to come near it.
        budget: Operations that it may take; None for no limit.
        reference: Cost of a better model that it is compared with; the fit has converged where a
            step promises less than a five-hundredth of the difference, which decides nothing.
    """

    steps: int = 60
    hopeless: float = np.inf
    budget: Budget | None = None
    reference: float = np.inf

    @property
    def over(self) -> bool:
        """Whether the budget is spent."""
        return self.budget is not None and self.budget.spent

    def enough(self, cost: float) -> float:
        """Log likelihood that another step may promise where the fit has converged."""
        return max(_ENOUGH, _DECISIVE * (cost - self.reference))


@dataclass(frozen=True)
class Fit:
    """Where the fit ended.

    Args:
        simulator: The model and the records.
        coordinates: Map between physical values and what was searched.
        position: (n_parameter,) search coordinates at the optimum.
        states: For each record (n_state,) initial states.
        weighting: Noise model of the channels.
        cost: Negative log posterior, up to a constant.
        equations: Normal equations at the optimum.
        converged: Whether the last step was far below the uncertainty.
    """

    simulator: Simulator
    coordinates: Coordinates
    position: Array
    states: tuple[Array, ...]
    weighting: Weighting
    cost: float
    equations: NormalEquations
    converged: bool

    @property
    def values(self) -> Array:
        """(n_parameter,) physical values."""
        return self.coordinates.values(self.position)

    def is_behind(self, patience: Patience) -> bool:
        """Whether it is not going to come near the cost of a rival."""
        promised = self.equations.decrement_within(self.position, self.coordinates)
        return self.cost - _OPTIMISM * promised > patience.hopeless

    def light(self) -> Fit:
        """The fit without what is computed again where it is asked for, most of its memory."""
        # A simulator keeps the rows that its loops read; a copy of it has none yet.
        simulator = replace(self.simulator)
        derivatives = replace(self.equations.derivatives, simulator=simulator, kept=None)
        equations = replace(self.equations, derivatives=derivatives)
        return replace(self, simulator=simulator, equations=equations)

    def full(self) -> Fit:
        """The fit with those derivatives."""
        derivatives = self.equations.derivatives.keeping()
        return replace(self, equations=replace(self.equations, derivatives=derivatives))

    def simulated(self) -> list[Array]:
        """For each record (n_sample, 2) what the sensors would log."""
        logged = self.simulator.logged(self.values[:, None], self.states)
        return [y[:, :, 0] for y in logged]

    def residuals(self) -> list[Array]:
        """For each record (n_sample, 2) measured minus simulated [A, rad/s]."""
        return [
            record.measured - y
            for record, y in zip(self.simulator.records, self.simulated(), strict=True)
        ]


def solve(
    simulator: Simulator,
    coordinates: Coordinates,
    position: Array,
    states: Sequence[Array] | None = None,
    weighting: Weighting | None = None,
    patience: Patience | None = None,
) -> Fit:
    """Fit parameters and initial states to the records of `simulator`.

    Args:
        simulator: Model and records.
        coordinates: Map to search coordinates, with bounds and priors.
        position: (n_parameter,) where to start, in search coordinates.
        states: Initial states to start from; taken from the first samples if absent.
        weighting: Noise model; white with unknown size if absent.
        patience: When to give up.

    Returns:
        The optimum; `converged` is False where the step limit was reached.  Its cost is infinite
        where the model cannot be simulated from the start.
    """
    records = simulator.records
    weighting = weighting or Weighting.white(records)
    at = np.clip(position, coordinates.lower, coordinates.upper)
    x0 = [initial_states(simulator.model, r) for r in records] if states is None else list(states)
    costs, weighting = _cost(simulator, coordinates, at[:, None], x0, weighting)
    cost = float(costs[0])
    converged = False
    equations = normal_equations(simulator, coordinates, at, x0, weighting)
    if not equations.is_finite:
        cost = np.inf
    patience = patience or Patience()
    ladder = _LADDER
    for number in range(patience.steps):
        if patience.over or not equations.is_finite:
            break
        decrement = equations.decrement_within(at, coordinates)
        if decrement < patience.enough(cost):
            break
        if number >= _TRIED and cost - _OPTIMISM * decrement > patience.hopeless:
            break
        trial = _ladder(equations, coordinates, at, x0, ladder)
        costs, sized = _cost(simulator, coordinates, trial[0], trial[1], weighting)
        best = int(np.argmin(costs))
        if cost - costs[best] < _STRAIGHT * decrement - _ENOUGH:
            bent = _bent(
                simulator, equations, coordinates, (at, x0), trial, weighting, ladder=ladder
            )
            bent_costs, bent_sized = _cost(simulator, coordinates, bent[0], bent[1], weighting)
            if bent_costs.min() < costs[best]:
                trial, costs, sized = bent, bent_costs, bent_sized
                best = int(np.argmin(costs))
        if not costs[best] < cost:
            # No damping in the ladder helps: at the optimum, up to rounding of the cost.
            converged = decrement < 1.0
            break
        moved, moved_x0 = trial[0][:, best], [x[:, best] for x in trial[1]]
        following = normal_equations(simulator, coordinates, moved, moved_x0, sized)
        if not following.is_finite:
            # Finite still, but on the way to infinity: no place to go on from.
            break
        at, x0, cost, weighting, equations = moved, moved_x0, float(costs[best]), sized, following
        ladder = _STEEP if ladder[best] > _STEEP[0] else _LADDER
    converged |= equations.decrement_within(at, coordinates) < patience.enough(cost)
    return Fit(simulator, coordinates, at, tuple(x0), weighting, cost, equations, converged)


def _bent(
    simulator: Simulator,
    equations: NormalEquations,
    coordinates: Coordinates,
    place: tuple[Array, Sequence[Array]],
    trial: tuple[Array, list[Array]],
    weighting: Weighting,
    *,
    ladder: Array,
) -> tuple[Array, list[Array]]:
    """The steps of a ladder, bent to follow a curved valley.

    The second derivative along each step comes from one more simulation a tenth of the way.
    """
    at, x0 = place
    steps = trial[0] - at[:, None]
    moves = [end - start[:, None] for end, start in zip(trial[1], x0, strict=True)]
    probe = simulator.logged(
        coordinates.values(at[:, None] + _PROBE * steps),
        [start[:, None] + _PROBE * move for start, move in zip(x0, moves, strict=True)],
    )
    directions = [np.concatenate([steps, move]) for move in moves]
    curved, finite = equations.curved(directions, probe, _PROBE, weighting)
    bends = equations.bends(ladder, at, coordinates, curved)
    position, states = trial[0].copy(), [end.copy() for end in trial[1]]
    for lane in np.flatnonzero(finite):
        bend, state_bends = bends[lane]
        position[:, lane] = np.clip(position[:, lane] + bend, coordinates.lower, coordinates.upper)
        for k, state_bend in enumerate(state_bends):
            states[k][:, lane] += state_bend
    return position, states


def _ladder(
    equations: NormalEquations,
    coordinates: Coordinates,
    at: Array,
    x0: Sequence[Array],
    ladder: Array,
) -> tuple[Array, list[Array]]:
    """Steps for every damping: (n_parameter, n_damping), and (n_state, n_damping) a record."""
    ends = [equations.step(damping, at, coordinates) for damping in ladder]
    position = np.column_stack([at + step for step, _ in ends])
    states = [
        np.column_stack([start + moved[k] for _, moved in ends]) for k, start in enumerate(x0)
    ]
    return position, states


def _cost(
    simulator: Simulator,
    coordinates: Coordinates,
    position: Array,
    states: Sequence[Array],
    weighting: Weighting,
) -> tuple[Array, Weighting]:
    """Cost of each lane of `position`, and the noise model sized to the best of them."""
    sums = simulator.misfit(coordinates.values(position), states, weighting)
    prior = coordinates.log_prior(position)
    cost = weighting.sized(sums)[1] - prior
    cost = np.where(np.isfinite(cost), cost, np.inf)
    return cost, weighting.sized(sums[:, int(np.argmin(cost))])[0]
