"""Levenberg-Marquardt within bounds for the output-error cost.

The likelihood has independent normal errors with one unknown standard deviation per channel.  With
these at their optimum, the cost is the sum of N/2 log(SSE) over the channels.  Its Gauss-Newton
step is that of least squares weighted by the current deviations.  An initial state affects its own
record only and is eliminated from the normal equations (Schur complement), so that a hundred runs
cost no more than their simulation.

Damping: the steps for a ladder of damping parameters are simulated as parallel lanes, and the best
one is taken.  After a strongly damped step the ladder is finer, from 0.01 to 100, the range that
helps in a sharply curved valley.

If the best step gains far less than the quadratic model predicts, or far more, the steps are
corrected (`trial_steps.py`), which replaces hundreds of short steps by a few.

Step plan and substeps of the simulator stay fixed during an optimisation.  At its end the step plan
is renewed if it does not suit the optimum, and the optimisation continues.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.fit.normal_equations import NormalEquations, normal_equations
from identification.fit.trial_steps import NEGLIGIBLE, cost_of, trial_steps
from identification.model.parameter import Coordinates
from identification.model.simulate import Simulator, initial_states
from identification.model.weighting import Weighting
from identification.work import Budget

__all__ = ["Fit", "TerminationLimits", "continued", "optimised", "renewed", "solve"]

_LADDER: Final = np.array([0.0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-1, 1e2])
_STEEP: Final = np.array([1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0])
"""Damping ladder after a step whose damping exceeded the least of these."""

_DECISIVE: Final = 0.01
"""Fraction of the difference to a better model that cannot change the comparison."""

_STALLED: Final = 0.03
"""Gain of a step below which a fit with a predicted gain of less than 1 is stalled [log
likelihood]: twenty more such steps would gain what chance does.  Kinks of friction do that."""
_SMALL: Final = 2
"""Steps in a row, each with a negligible gain, after which a fit ends."""

_OPTIMISM: Final = (50.0, 20.0, 10.0, 5.0)
"""Largest gain until the optimum, over the predicted gain of one step, for the first steps and all
later ones: far from the optimum, the prediction is poor."""
_RENEWALS: Final = 3
"""Renewals of the step plan at most."""


@dataclass(frozen=True)
class TerminationLimits:
    """Termination limits of a fit."""

    steps: int = 60
    """Largest number of steps."""
    abandon_cost: float = np.inf
    """Cost at which the refit is abandoned: the fit stops if it is not predicted to reach this
    cost."""
    budget: Budget | None = None
    """Operations that the fit may take; None for no limit."""
    reference: float = np.inf
    """Cost of a better model, with which the fit is compared.  The fit has converged when the
    predicted gain of a step is below a hundredth of the difference, and it ends if two steps in a
    row gain less than that."""
    sufficient: float = -np.inf
    """Cost below which the fit ends with the first step that gains less than 1 in log likelihood,
    because only this comparison matters."""

    @property
    def over(self) -> bool:
        """True if the budget is spent."""
        return self.budget is not None and self.budget.spent

    def enough(self, cost: float) -> float:
        """Predicted gain in log likelihood below which the fit has converged."""
        return max(NEGLIGIBLE, _DECISIVE * (cost - self.reference))


@dataclass(frozen=True)
class Fit:
    """Result of a fit."""

    simulator: Simulator
    coordinates: Coordinates
    position: Array
    """(n_parameter,) search coordinates at the optimum."""
    states: tuple[Array, ...]
    """For each record (n_state,) initial state."""
    weighting: Weighting
    cost: float
    """Negative log posterior, up to a constant."""
    equations: NormalEquations
    converged: bool
    """True if the predicted gain of another step is negligible."""

    @property
    def values(self) -> Array:
        """(n_parameter,) physical values."""
        return self.coordinates.values(self.position)

    @property
    def by_name(self) -> dict[str, float]:
        """`values` by the names of the parameters."""
        return dict(zip(self.coordinates.names, map(float, self.values), strict=True))

    def moved_to(self, values: Mapping[str, float]) -> Fit:
        """The fit with other physical values of some parameters; other names are ignored."""
        there = self.by_name | dict(values)
        position = self.coordinates.of(np.array([there[name] for name in self.coordinates.names]))
        return replace(self, position=position)

    @property
    def deviations(self) -> Array:
        """(n_parameter,) standard deviations of `values` from the covariance of the fit."""
        slopes = self.coordinates.slopes(self.position)
        return np.asarray(np.sqrt(np.diag(self.equations.covariance())) * slopes)

    def is_behind(self, limits: TerminationLimits) -> bool:
        """True if the fit is not predicted to reach `TerminationLimits.abandon_cost`."""
        return not self.may_reach(limits.abandon_cost, _OPTIMISM[-1])

    def may_reach(self, cost: float, optimism: float = _OPTIMISM[0]) -> bool:
        """True if further steps may reach a cost.

        Their gain is at most `optimism` times the predicted gain of one step; the default is for a
        fit that has made no step yet.
        """
        predicted = self.equations.decrement_within(self.position, self.coordinates)
        return self.cost - optimism * predicted <= cost

    def is_off(self, deviations: float) -> bool:
        """True if the optimum is predicted to be further away than this many standard deviations.

        The decrease is half the square of the distance.  A fit that is only compared with a better
        model may end that far away.  False if no step can be computed.
        """
        predicted = self.equations.decrement_within(self.position, self.coordinates)
        return bool(np.isfinite(predicted)) and predicted > 0.5 * deviations**2

    def light(self) -> Fit:
        """Copy without cached sensitivities, which use most of the memory."""
        # A simulator caches the rows that its loops read; a copy starts with an empty cache.
        simulator = replace(self.simulator)
        derivatives = replace(self.equations.derivatives, simulator=simulator, kept=None)
        equations = replace(self.equations, derivatives=derivatives)
        return replace(self, simulator=simulator, equations=equations)

    def full(self) -> Fit:
        """Copy with cached sensitivities."""
        derivatives = self.equations.derivatives.keeping()
        return replace(self, equations=replace(self.equations, derivatives=derivatives))

    def simulated(self) -> list[Array]:
        """For each record (n_sample, 2) simulated sensor readings [A, rad/s]."""
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
    limits: TerminationLimits | None = None,
) -> Fit:
    """Fit parameters and initial states, with a step plan that suits the optimum.

    The start is a position (n_parameter,) in search coordinates, which have bounds and priors, and
    an initial state of each record, by default from its first samples.  The noise is white with
    unknown deviations by default.  The limits are those of each optimisation.  If `converged` is
    False, the fit stopped before the optimum; the cost is infinite if the model cannot be simulated
    from the start.
    """
    fit = optimised(simulator, coordinates, position, states, weighting, limits)
    return renewed(fit, limits)


def continued(fit: Fit, limits: TerminationLimits | None = None) -> Fit:
    """Continue a fit from its present point, with its present step plan and substeps."""
    return optimised(
        fit.simulator, fit.coordinates, fit.position, fit.states, fit.weighting, limits
    )


def renewed(fit: Fit, limits: TerminationLimits | None = None) -> Fit:
    """Continue a fit until its step plan suits the optimum; unchanged if the plan already does."""
    for _ in range(_RENEWALS):
        simulator = fit.simulator.suited_to(fit.values)
        if simulator is fit.simulator or (limits is not None and limits.over):
            break
        fit = continued(replace(fit, simulator=simulator), limits)
    return fit


def optimised(
    simulator: Simulator,
    coordinates: Coordinates,
    position: Array,
    states: Sequence[Array] | None = None,
    weighting: Weighting | None = None,
    limits: TerminationLimits | None = None,
) -> Fit:
    """Optimum with the step plan and the substeps of the simulator.

    The arguments are those of `solve`.
    """
    records = simulator.records
    weighting = weighting or Weighting.white(records)
    at = np.clip(position, coordinates.lower, coordinates.upper)
    x0 = [initial_states(simulator.model, r) for r in records] if states is None else list(states)
    costs, weighting = cost_of(simulator, coordinates, at[:, None], x0, weighting)
    cost = float(costs[0])
    converged, small = False, 0
    equations = normal_equations(simulator, coordinates, at, x0, weighting)
    if not equations.is_finite:
        cost = np.inf
    limits = limits or TerminationLimits()
    ladder = _LADDER
    for number in range(limits.steps):
        if limits.over or not equations.is_finite:
            break
        decrement = equations.decrement_within(at, coordinates)
        if decrement + equations.state_decrement < limits.enough(cost):
            break
        if cost - _OPTIMISM[min(number, 3)] * decrement > limits.abandon_cost:
            break
        trial, costs, sized = trial_steps(
            equations, coordinates, (at, x0), (cost, decrement), weighting, ladder
        )
        best = int(np.argmin(costs))
        if not costs[best] < cost:
            # No step lowers the cost: this is the optimum, up to rounding of the cost.
            converged = decrement < 1.0
            break
        moved, moved_x0 = trial[0][:, best], [x[:, best] for x in trial[1]]
        following = normal_equations(simulator, coordinates, moved, moved_x0, sized)
        if not following.is_finite:
            # The cost is finite but its derivatives are not: no further step can be computed.
            break
        before, cost = cost, float(costs[best])
        is_stalled = decrement < 1.0 and before - cost < _STALLED
        small = small + 1 if is_stalled or before - cost < limits.enough(cost) else 0
        at, x0, weighting, equations = moved, moved_x0, sized, following
        ladder = _STEEP if ladder[best] > _STEEP[0] else _LADDER
        if cost < limits.sufficient and before - cost < 1.0:
            break
        if small == _SMALL and (decrement < 1.0 or np.isfinite(limits.reference)):
            converged = decrement < 1.0
            break
    converged |= _left(equations, at, coordinates) < limits.enough(cost)
    return Fit(simulator, coordinates, at, tuple(x0), weighting, cost, equations, converged)


def _left(equations: NormalEquations, position: Array, coordinates: Coordinates) -> float:
    """Predicted decrease of the cost by a step of the parameters and of the initial states.

    At parameters that suit from the start, the initial states alone may not.
    """
    return equations.decrement_within(position, coordinates) + equations.state_decrement
