"""Fitting a model with an effect added, or with one taken away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.fit.accuracy import TOLERATED, accurate, change_between
from identification.fit.declared import replanned
from identification.fit.solve import Fit, Patience, solve
from identification.model.composite import MotorModel
from identification.model.parameter import Coordinates
from identification.model.simulate import Simulator, initial_states
from identification.model.term import AbstractTerm
from identification.model.weighting import Weighting

__all__ = [
    "Along",
    "refined",
    "refitted_as",
    "refitted_with",
    "refitted_without",
    "with_known_amplitudes",
]

Array = NDArray[np.float64]

_STEPS: Final = 20
_ATTEMPTS: Final = 3
_ROUGH: Final = 0.1
"""Share of the residual by which one interval may be wrong where a refit begins."""
_SHARES: Final = np.array([1.0, 0.5, 0.2, 0.08, 0.03, 0.01, 1e-3, 1e-5])


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


def refitted_with(
    fit: Fit,
    term: AbstractTerm,
    start: Array,
    patience: Patience | None = None,
    own: Sequence[Array] = (),
    along: Along | None = None,
) -> Fit:
    """The fit of the model with `term` added, from where `fit` ended.

    Args:
        fit: Fit of the current model.
        term: What is added.
        start: (n_parameter,) physical values of the term's parameters.
        patience: When to give up.
        own: For each record initial values of the term's states; the usual ones where empty.
        along: How the fit is expected to move along; to where it ended where None.
    """
    return _refitted(
        fit,
        fit.simulator.model.adding(term),
        dict(
            zip(
                (f"{term.name}.{p.name}" for p in term.parameters),
                (float(value) for value in start),
                strict=True,
            )
        ),
        patience or Patience(_STEPS),
        own,
        along,
    )


def refitted_as(fit: Fit, term: AbstractTerm, patience: Patience | None = None) -> Fit:
    """The fit with a term in a richer form, from where `fit` ended; what is new starts neutral."""
    before = fit.simulator.model
    terms = tuple(term if own.name == term.name else own for own in before.terms)
    model = replace(before, terms=terms)
    known = set(fit.coordinates.names)
    new = {p.name: p.prior_mean for p in model.parameters if p.name not in known}
    return _refitted(fit, model, new, patience or Patience(_STEPS))


def refitted_without(fit: Fit, name: str, patience: Patience | None = None) -> Fit:
    """The fit of the model without the term of that name, from where `fit` ended."""
    model = fit.simulator.model.without(name)
    return _refitted(fit, model, {}, patience or Patience(_STEPS))


def with_known_amplitudes(fit: Fit, patience: Patience | None = None) -> Fit:
    """The fit with the amplitudes that records have for themselves expected where they were found.

    A run that was not fitted then starts from amplitudes as large as those of the others, and not
    from any that its first samples leave possible.
    """
    model, at = fit.simulator.model, 2
    terms = []
    for term in model.terms:
        own = [at + k for k, state in enumerate(term.states) if state.is_own]
        at += len(term.states)
        if own:
            size = float(np.sqrt(np.mean([state[own] ** 2 for state in fit.states])))
            term = term.expecting(size)  # type: ignore[attr-defined]
        terms.append(term)
    if tuple(terms) == model.terms:
        return fit
    return _refitted(fit, replace(model, terms=tuple(terms)), {}, patience or Patience(_STEPS))


def _refitted(
    fit: Fit,
    model: MotorModel,
    added: dict[str, float],
    patience: Patience,
    own: Sequence[Array] = (),
    along: Along | None = None,
) -> Fit:
    known = {p.name: p for p in fit.coordinates.parameters}
    parameters = [known.get(p.name, p) for p in model.parameters]
    here = dict(zip(fit.coordinates.names, fit.values, strict=True)) | added
    coordinates = Coordinates(parameters)
    values = np.array([here[name] for name in coordinates.names])
    records = fit.simulator.records
    simulator = Simulator.fitting(model, records, values, fit.simulator.divisions)
    states = [_states(fit, model, k) for k in range(len(records))]
    for state, values_of_record in zip(states, own, strict=False):
        state[-values_of_record.size :] = values_of_record
    plain = replace(
        Weighting.white(records), deviation=fit.weighting.deviation, robust=fit.weighting.robust
    )
    position = coordinates.of(values)
    if patience.steps and added:
        ways = [_held(coordinates, states)]
        if along is not None:
            ways.append(_following(fit, simulator.model, coordinates, along))
        # What blows up on intervals that are too long cannot be compared with what does not.
        simulator = simulator.divided_for(
            values, states, _ROUGH * plain.deviation, start=fit.simulator.divisions
        )
        place = (position, states)
        position, states = _shortened(simulator, coordinates, place, ways, set(added), plain)
    return replanned(solve(simulator, coordinates, position, states, plain, patience), patience)


def _held(coordinates: Coordinates, states: Sequence[Array]) -> Along:
    """Nothing that was fitted moves."""
    return Along(np.zeros(len(coordinates.names)), tuple(np.zeros(state.size) for state in states))


def _following(fit: Fit, model: MotorModel, coordinates: Coordinates, along: Along) -> Along:
    """How a fit moves along, in the parameters and states of the model that was added to."""
    moves = dict(zip(fit.coordinates.names, along.position, strict=True))
    names = fit.simulator.model.state_names
    shifts = [dict(zip(names, state, strict=True)) for state in along.states]
    return Along(
        np.array([moves.get(name, 0.0) for name in coordinates.names]),
        tuple(np.array([own.get(name, 0.0) for name in model.state_names]) for own in shifts),
    )


def _shortened(
    simulator: Simulator,
    coordinates: Coordinates,
    place: tuple[Array, Sequence[Array]],
    ways: Sequence[Along],
    added: set[str],
    weighting: Weighting,
) -> tuple[Array, list[Array]]:
    """The start, with the sizes of what is added made smaller where that is better.

    A size that is right to first order may be far too large where the effect is not small, and
    so may be what moves along with it.
    """
    position, states = place
    is_size = np.array(
        [p.name in added and p.vanishes for p in simulator.model.parameters], dtype=bool
    )
    if not is_size.any():
        return position, list(states)
    shares = np.tile(_SHARES, len(ways))
    lanes = np.repeat(position[:, None], shares.size, axis=1)
    lanes[is_size] *= shares
    lanes += np.column_stack([way.position for way in ways]).repeat(_SHARES.size, axis=1) * shares
    lanes = np.clip(lanes, coordinates.lower[:, None], coordinates.upper[:, None])
    starts = [
        state[:, None]
        + np.column_stack([way.states[k] for way in ways]).repeat(_SHARES.size, axis=1) * shares
        for k, state in enumerate(states)
    ]
    cost = weighting.sized(simulator.misfit(coordinates.values(lanes), starts, weighting))[
        1
    ] - coordinates.log_prior(lanes)
    best = int(np.argmin(np.where(np.isfinite(cost), cost, np.inf)))
    return lanes[:, best], [start[:, best] for start in starts]


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


def refined(fit: Fit, patience: Patience | None = None) -> Fit:
    """The fit with sample intervals divided until their error is far below the noise.

    Which intervals have to be divided depends on where the fit ended, so it is measured there and
    the fit is repeated where it had not been enough.
    """
    patience = patience or Patience(_STEPS)
    known = None
    for _ in range(_ATTEMPTS):
        deviation = fit.weighting.deviation
        simulator = accurate(fit.simulator, fit.values, fit.states, deviation, known)
        change = change_between(fit.simulator, simulator, fit.values, fit.states)
        if patience.over or np.all(change < TOLERATED * deviation):
            return fit
        fit = solve(simulator, fit.coordinates, fit.position, fit.states, fit.weighting, patience)
        known = simulator.divisions
    return fit
