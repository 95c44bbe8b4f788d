"""Starting point of a refit: line search along the step that the score test predicts.

To first order, the score of a prototype gives the amplitude with the largest gain and the
accompanying change of all fitted parameters.  A large effect may fit better at a smaller amplitude,
or with another shape that has a smaller predicted gain.  Every start is therefore simulated at
several fractions of its amplitude, with the fitted parameters held and with the predicted change.
The refit continues from the best.

If the model lacks heating, the temperature coefficients have absorbed it as well as they could.
Example: self-heating of the winding can leave a resistance that seems to fall with temperature, and
a heating term then cannot raise it.  `with_usual_coefficients` therefore returns to the
coefficients of usual materials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.effects.effect import Candidate
from identification.fit.initial import fitted_initial_states
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

Point = tuple[Array, list[Array]]
"""Search coordinates, and for each record the initial state."""

_WORTH: Final = 2
"""Ratio of steps from which a simulator of its own for the chosen point pays; a fit from a
simulator of a larger step is more accurate."""
_SHARES: Final = np.array([1.0, 0.5, 0.2, 0.08, 0.03, 0.01, 1e-3, 1e-5])
"""Fractions of the amplitude at which a start is simulated."""


@dataclass(frozen=True)
class Along:
    """First-order change of a fit that accompanies an added term."""

    position: Array
    """(n_parameter, ...) change of the search coordinates."""
    states: tuple[Array, ...]
    """For each record (n_state, ...) change of the initial states."""

    @classmethod
    def to(cls, fit: Fit, values: Array) -> Along:
        """Change of a fit to other parameter values; the initial states are held."""
        states = tuple(np.zeros_like(state) for state in fit.states)
        return cls(fit.coordinates.of(values) - fit.position, states)

    def of(self, columns: slice) -> Along:
        """Selected columns."""
        return Along(self.position[:, columns], tuple(state[:, columns] for state in self.states))

    def by(self, weights: Array) -> Along:
        """Weighted sum of the columns."""
        return Along(self.position @ weights, tuple(state @ weights for state in self.states))


@dataclass(frozen=True)
class Start:
    """Starting point of an added term."""

    values: Array
    """(n_added,) physical values of the new parameters."""
    own: tuple[Array, ...] = ()
    """For each record initial values of the new states; default values if empty."""
    along: Along | None = None
    """Predicted change of the fit; None holds it."""
    is_moved: bool = False
    """True if the fit is moved along by the whole change, and not held or moved by a part of it."""


def begun(
    fit: Fit,
    model: MotorModel,
    coordinates: Coordinates,
    starts: Sequence[Start],
    weighting: Weighting,
) -> tuple[Simulator, Array, list[Array]]:
    """Simulator of a changed model, and the point from which its fit starts.

    The starts are those of what is new, the largest predicted gain first; empty if nothing is new.
    The noise model compares them.  The point has search coordinates (n_parameter,) and for each
    record an initial state (n_state,).
    """
    records = fit.simulator.records
    whole = [_extended(fit, model, coordinates, start) for start in starts or [Start(np.zeros(0))]]
    position, states = whole[0]
    values = coordinates.values(position)
    simulator = fit.simulator.changed_to(model, values)
    if not starts:
        if model.advance < fit.simulator.model.advance:
            begin = fitted_initial_states(
                simulator, values, weighting.deviation, start=tuple(states)
            )
            return simulator, position, list(begin)
        return simulator, position, states
    # Too few substeps make a stiff start diverge, and it could not be compared with the others.
    simulator = simulator.roughly_accurate(values, states, weighting.deviation)
    points = [
        point
        for start, own in zip(starts, whole, strict=True)
        for point in _shortened(fit, coordinates, model, start, own)
    ]
    lanes = np.column_stack([position for position, _ in points])
    columns = [np.column_stack([states[k] for _, states in points]) for k in range(len(records))]
    sums = simulator.misfit(coordinates.values(lanes), columns, weighting)
    cost = weighting.sized(sums)[1] - coordinates.log_prior(lanes)
    best = int(np.argmin(np.where(np.isfinite(cost), cost, np.inf)))
    position, states = points[best]
    if best > 0:
        # If the whole step diverges, it has the most substeps; the chosen point needs few of them.
        values = coordinates.values(position)
        cheaper = fit.simulator.changed_to(model, values)
        cheaper = cheaper.roughly_accurate(values, states, weighting.deviation)
        if _WORTH * cheaper.steps <= simulator.steps:
            simulator = cheaper
    return simulator, position, states


def _extended(fit: Fit, model: MotorModel, coordinates: Coordinates, start: Start) -> Point:
    """Optimum of the fit, extended by the values of a start."""
    here = fit.by_name
    new = [name for name in coordinates.names if name not in here]
    here |= dict(zip(new, start.values, strict=True))
    states = [_states(fit, model, k) for k in range(len(fit.simulator.records))]
    for state, own in zip(states, start.own, strict=False):
        state[-own.size :] = own
    return coordinates.of(np.array([here[name] for name in coordinates.names])), states


def _shortened(
    fit: Fit, coordinates: Coordinates, model: MotorModel, start: Start, whole: Point
) -> list[Point]:
    """The point at several fractions of the new amplitudes, with the fit held and moved along.

    The amplitudes are those of all records, and those of each record unless their angle is tracked.
    """
    position, states = whole
    known = set(fit.coordinates.names)
    is_size = np.array([p.name not in known and p.vanishes for p in coordinates.parameters])
    present = {term.name for term in fit.simulator.model.terms}
    is_tracked = any(term.tracked for term in model.terms if term.name not in present)
    amplitudes = () if is_tracked else start.own
    is_sized = bool(is_size.any()) or bool(amplitudes)
    shares = _SHARES if is_sized and not start.is_moved else _SHARES[:1]
    held = Along(np.zeros_like(position), tuple(np.zeros_like(state) for state in states))
    changes = [] if start.is_moved else [held]
    if start.along is not None:
        changes.append(_following(fit, model, coordinates, start.along))
    found = []
    for change in changes:
        for share in shares:
            moved = np.where(is_size, share, 1.0) * position + share * change.position
            reduced = [state.copy() for state in states]
            for state, own in zip(reduced, amplitudes, strict=False):
                state[state.size - own.size :] *= share
            both = zip(reduced, change.states, strict=True)
            begin = [state + share * shift for state, shift in both]
            found.append((np.clip(moved, coordinates.lower, coordinates.upper), begin))
    return found


def traded(fit: Fit, candidate: Candidate) -> list[Start]:
    """Starts at which parameters of the fit return what they had absorbed of the candidate."""
    values = fit.by_name
    found = []
    for start, factors in candidate.traded:
        after = np.array([values[name] * factors.get(name, 1.0) for name in values])
        found.append(Start(start, along=Along.to(fit, after)))
    return found


def has_odd_coefficients(fit: Fit) -> bool:
    """True if a temperature coefficient is more than one prior sd off its prior mean."""
    return any(
        parameter.name in ("alpha_Ra", "alpha_Kt")
        and abs(value - parameter.prior_mean) > parameter.prior_sd * parameter.scale
        for parameter, value in zip(fit.coordinates.parameters, fit.values, strict=True)
    )


def with_usual_coefficients(fit: Fit) -> Fit:
    """The fit moved to the temperature coefficients of usual materials.

    Resistance and torque constant keep their values at the mean temperature of the records.
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


def _following(fit: Fit, model: MotorModel, coordinates: Coordinates, along: Along) -> Along:
    """The change of the fit in the parameters and states of the changed model."""
    moves = dict(zip(fit.coordinates.names, along.position, strict=True))
    names = fit.simulator.model.state_names
    shifts = [dict(zip(names, state, strict=True)) for state in along.states]
    return Along(
        np.array([moves.get(name, 0.0) for name in coordinates.names]),
        tuple(np.array([own.get(name, 0.0) for name in model.state_names]) for own in shifts),
    )


def _states(fit: Fit, model: MotorModel, k: int) -> Array:
    """Initial state of record `k` of a changed model: fitted values, defaults for new states.

    With a delayed voltage, the simulation begins at the later sample whose voltage it reads, and so
    the fitted current and speed are not those at the first sample.
    """
    known = dict(zip(fit.simulator.model.state_names, fit.states[k], strict=True))
    if model.advance < fit.simulator.model.advance:
        del known["current"], known["speed"]
    fresh = zip(model.state_names, initial_states(model, fit.simulator.records[k]), strict=True)
    return np.array([known.get(name, value) for name, value in fresh])
