"""Fitting a model with an effect added, or with one taken away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
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

__all__ = ["refined", "refitted_with", "refitted_without", "with_known_amplitudes"]

Array = NDArray[np.float64]

_STEPS: Final = 20
_ATTEMPTS: Final = 3
_SHARES: Final = np.array([1.0, 0.5, 0.2, 0.08, 0.03, 0.01, 1e-3, 1e-5])


def refitted_with(
    fit: Fit,
    term: AbstractTerm,
    start: Array,
    patience: Patience | None = None,
    own: Sequence[Array] = (),
) -> Fit:
    """The fit of the model with `term` added, from where `fit` ended.

    Args:
        fit: Fit of the current model.
        term: What is added.
        start: (n_parameter,) physical values of the term's parameters.
        patience: When to give up.
        own: For each record initial values of the term's states; the usual ones where empty.
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
    )


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
    if patience.steps:
        values = _shortened(simulator, values, set(added), states, plain)
    position = coordinates.of(values)
    return replanned(solve(simulator, coordinates, position, states, plain, patience), patience)


def _shortened(
    simulator: Simulator,
    values: Array,
    added: set[str],
    states: Sequence[Array],
    weighting: Weighting,
) -> Array:
    """The start, with the sizes of what is added made smaller where that is better.

    A size that is right to first order may be far too large where the effect is not small.
    """
    is_size = np.array(
        [p.name in added and p.vanishes for p in simulator.model.parameters], dtype=bool
    )
    if not is_size.any():
        return values
    lanes = np.repeat(values[:, None], _SHARES.size, axis=1)
    lanes[is_size] *= _SHARES
    cost = weighting.sized(simulator.misfit(lanes, states, weighting))[1]
    return lanes[:, int(np.argmin(np.where(np.isfinite(cost), cost, np.inf)))]


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
