"""Where a refit starts.

The score of a prototype says which size of it explains most and how everything that was fitted
before moves along, all to first order.  An effect that is not small may do better with less of it,
or with another shape that promised less.  So every start is simulated, at several shares of its
size, with the rest moved along and held, and the fit goes on from the best.

Where heat is missing from the model, the temperature coefficients have taken its place as well as
they could: a winding that heats itself may leave a resistance that seems to fall with temperature,
from where no heating can raise it.  So there is a way back to the coefficients that materials have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.effects.effect import Candidate
from identification.fit.solve import Fit
from identification.model.composite import MotorModel
from identification.model.parameter import Coordinates
from identification.model.simulate import Simulator, initial_states
from identification.model.weighting import Weighting

__all__ = [
    "Along",
    "Start",
    "begun",
    "has_odd_coefficients",
    "traded",
    "with_usual_coefficients",
]

Array = NDArray[np.float64]
Place = tuple[Array, list[Array]]

_SHARES: Final = np.array([1.0, 0.5, 0.2, 0.08, 0.03, 0.01, 1e-3, 1e-5])
_ROUGH: Final = 0.1
"""Share of the residual by which one interval may be wrong where a refit begins."""


@dataclass(frozen=True)
class Along:
    """How a fit moves along with what is added to it, to first order.

    Args:
        position: (n_parameter, ...) change of its search coordinates.
        states: For each record (n_state, ...) change of its initial states.
    """

    position: Array
    states: tuple[Array, ...]

    def of(self, columns: slice) -> Along:
        """Some of the columns."""
        return Along(self.position[:, columns], tuple(state[:, columns] for state in self.states))

    def by(self, weights: Array) -> Along:
        """The columns weighed together."""
        return Along(self.position @ weights, tuple(state @ weights for state in self.states))


@dataclass(frozen=True)
class Start:
    """Where something that is added starts.

    Args:
        values: (n_added,) physical values of the parameters that are new.
        own: For each record initial values of the states that are new; the usual ones where empty.
        along: How the fit is expected to move along; it is held where None.
    """

    values: Array
    own: tuple[Array, ...] = ()
    along: Along | None = None


def begun(
    fit: Fit,
    model: MotorModel,
    coordinates: Coordinates,
    starts: Sequence[Start],
    weighting: Weighting,
) -> tuple[Simulator, Array, list[Array]]:
    """The simulator of a changed model, and the place from which it is best fitted.

    Args:
        fit: Where the fit of the model before it was changed ended.
        model: The changed model.
        coordinates: Of the changed model.
        starts: Of what is new in it, the most promising first; empty where nothing is.
        weighting: Noise by which places are compared.

    Returns:
        The simulator, (n_parameter,) search coordinates and for each record (n_state,).
    """
    records = fit.simulator.records
    whole = [_place(fit, model, coordinates, start) for start in starts or [Start(np.zeros(0))]]
    position, states = whole[0]
    values = coordinates.values(position)
    simulator = Simulator.fitting(model, records, values, fit.simulator.divisions)
    if not starts:
        return simulator, position, states
    # What blows up on intervals that are too long cannot be compared with what does not.
    simulator = simulator.divided_for(
        values, states, _ROUGH * weighting.deviation, start=fit.simulator.divisions
    )
    places = [
        place
        for start, (position, states) in zip(starts, whole, strict=True)
        for place in _shorter(fit, coordinates, model, start, (position, states))
    ]
    lanes = np.column_stack([position for position, _ in places])
    columns = [np.column_stack([states[k] for _, states in places]) for k in range(len(records))]
    sums = simulator.misfit(coordinates.values(lanes), columns, weighting)
    cost = weighting.sized(sums)[1] - coordinates.log_prior(lanes)
    best = int(np.argmin(np.where(np.isfinite(cost), cost, np.inf)))
    return simulator, *places[best]


def _place(fit: Fit, model: MotorModel, coordinates: Coordinates, start: Start) -> Place:
    """Where the fit ended, with what is new at its start."""
    here = dict(zip(fit.coordinates.names, fit.values, strict=True))
    new = [name for name in coordinates.names if name not in here]
    here |= dict(zip(new, start.values, strict=True))
    states = [_states(fit, model, k) for k in range(len(fit.simulator.records))]
    for state, own in zip(states, start.own, strict=False):
        state[-own.size :] = own
    return coordinates.of(np.array([here[name] for name in coordinates.names])), states


def _shorter(
    fit: Fit, coordinates: Coordinates, model: MotorModel, start: Start, whole: Place
) -> list[Place]:
    """The place and those with less of what is new, everything else held or moved along."""
    position, states = whole
    known = set(fit.coordinates.names)
    is_size = np.array([p.name not in known and p.vanishes for p in coordinates.parameters])
    shares = _SHARES if is_size.any() else _SHARES[:1]
    ways = [_held(position, states)]
    if start.along is not None:
        ways.append(_following(fit, model, coordinates, start.along))
    found = []
    for way in ways:
        for share in shares:
            moved = np.where(is_size, share, 1.0) * position + share * way.position
            ends = [state + share * move for state, move in zip(states, way.states, strict=True)]
            found.append((np.clip(moved, coordinates.lower, coordinates.upper), ends))
    return found


def traded(fit: Fit, candidate: Candidate) -> list[Start]:
    """Starts at which parameters of the fit give back what they had taken of an effect.

    Args:
        fit: The model that is added to.
        candidate: What is added.
    """
    values = dict(zip(fit.coordinates.names, fit.values, strict=True))
    rest = tuple(np.zeros_like(state) for state in fit.states)
    found = []
    for place, factors in candidate.traded:
        after = np.array([values[name] * factors.get(name, 1.0) for name in values])
        found.append(Start(place, along=Along(fit.coordinates.of(after) - fit.position, rest)))
    return found


def has_odd_coefficients(fit: Fit) -> bool:
    """Whether a temperature coefficient is not one that materials have, by its prior."""
    return any(
        parameter.name in ("alpha_Ra", "alpha_Kt")
        and abs(value - parameter.prior_mean) > parameter.prior_sd * parameter.scale
        for parameter, value in zip(fit.coordinates.parameters, fit.values, strict=True)
    )


def with_usual_coefficients(fit: Fit) -> Fit:
    """The place of a fit moved to the temperature coefficients that materials have.

    Resistance and torque constant stay what they are at the mean temperature of the records.
    """
    warmth = np.concatenate([record.column("temperature") for record in fit.simulator.records])
    rise = float(np.mean(warmth)) - 25.0
    values, at = fit.values.copy(), {name: k for k, name in enumerate(fit.coordinates.names)}
    for quantity, coefficient in (("Ra25", "alpha_Ra"), ("Kt25", "alpha_Kt")):
        if coefficient in at:
            usual = fit.coordinates.parameters[at[coefficient]].prior_mean
            factor = (1 + values[at[coefficient]] * rise) / (1 + usual * rise)
            values[at[coefficient]] = usual
            values[at[quantity]] *= factor if factor > 0 else 1.0
    position = np.clip(fit.coordinates.of(values), fit.coordinates.lower, fit.coordinates.upper)
    return replace(fit, position=position)


def _held(position: Array, states: Sequence[Array]) -> Along:
    """Nothing that was fitted moves."""
    return Along(np.zeros_like(position), tuple(np.zeros_like(state) for state in states))


def _following(fit: Fit, model: MotorModel, coordinates: Coordinates, along: Along) -> Along:
    """How a fit moves along, in the parameters and states of the model that was added to."""
    moves = dict(zip(fit.coordinates.names, along.position, strict=True))
    names = fit.simulator.model.state_names
    shifts = [dict(zip(names, state, strict=True)) for state in along.states]
    return Along(
        np.array([moves.get(name, 0.0) for name in coordinates.names]),
        tuple(np.array([own.get(name, 0.0) for name in model.state_names]) for own in shifts),
    )


def _states(fit: Fit, model: MotorModel, k: int) -> Array:
    """Initial state of record `k` of a changed model: what is known of it, else at rest."""
    record = fit.simulator.records[k]
    fresh = dict(zip(model.state_names, initial_states(model, record), strict=True))
    fresh |= {
        name: value
        for name, value in zip(fit.simulator.model.state_names, fit.states[k], strict=True)
        if name in fresh
    }
    return np.array([fresh[name] for name in model.state_names])
