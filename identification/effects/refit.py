"""Fitting a model with an effect added, or with one taken away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.effects.start import Start, begun, has_odd_coefficients, with_usual_coefficients
from identification.fit.accuracy import TOLERATED, accurate, change_between
from identification.fit.declared import replanned
from identification.fit.solve import Fit, Patience, solve
from identification.model.composite import MotorModel
from identification.model.parameter import Coordinates
from identification.model.term import AbstractTerm
from identification.model.weighting import Weighting
from identification.work import operations

__all__ = [
    "as_declared",
    "refined",
    "refitted_as",
    "refitted_with",
    "refitted_without",
    "with_known_amplitudes",
]

Array = NDArray[np.float64]

_STEPS: Final = 20
_ATTEMPTS: Final = 3
_NEAR: Final = 0.005
"""Gain of log likelihood a sample by which a simulation moves by a tenth of the noise."""


def refitted_with(
    fit: Fit, term: AbstractTerm, starts: Sequence[Start], patience: Patience | None = None
) -> Fit:
    """The fit of the model with `term` added, from where `fit` ended.

    Args:
        fit: Fit of the current model.
        term: What is added; a thermal one also starts from the usual temperature coefficients where
            those of the fit are odd, and has the same budget again for that.
        starts: Where it may start; the fit goes on from the best of them.
        patience: When to give up.
    """
    model, patience = fit.simulator.model.adding(term), patience or Patience(_STEPS)
    began = operations()
    found = _refitted(fit, model, starts, patience)
    if term.equation == "thermal" and has_odd_coefficients(fit):
        again = patience
        if patience.budget is not None:
            again = replace(patience, budget=patience.budget.longer(operations() - began))
        other = _refitted(with_usual_coefficients(fit), model, starts, again)
        found = min(found, other, key=lambda one: one.cost)
    return found


def refitted_as(fit: Fit, term: AbstractTerm, patience: Patience | None = None) -> Fit:
    """The fit with a term in a richer form, from where `fit` ended; what is new starts neutral.

    Sample intervals are divided beforehand until the whole simulation is accurate: an angle that
    adds up their errors would be a turn away once they are divided later.
    """
    before = fit.simulator.model
    terms = tuple(term if own.name == term.name else own for own in before.terms)
    model = replace(before, terms=terms)
    known = set(fit.coordinates.names)
    new = np.array([p.prior_mean for p in model.parameters if p.name not in known])
    return _refitted(fit, model, [Start(new)], patience or Patience(_STEPS), finely=True)


def refitted_without(fit: Fit, name: str, patience: Patience | None = None) -> Fit:
    """The fit of the model without the term of that name, from where `fit` ended."""
    model = fit.simulator.model.without(name)
    return _refitted(fit, model, (), patience or Patience(_STEPS))


def as_declared(fit: Fit, declared: Fit) -> Fit:
    """The place of a fit, with the declared parameters where the declared model has them."""
    values = dict(zip(fit.coordinates.names, fit.values, strict=True))
    values |= dict(zip(declared.coordinates.names, declared.values, strict=True))
    place = fit.coordinates.of(np.array([values[name] for name in fit.coordinates.names]))
    return replace(fit, position=place)


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
    return _refitted(fit, replace(model, terms=tuple(terms)), (), patience or Patience(_STEPS))


def _refitted(
    fit: Fit,
    model: MotorModel,
    starts: Sequence[Start],
    patience: Patience,
    *,
    finely: bool = False,
) -> Fit:
    known = {p.name: p for p in fit.coordinates.parameters}
    coordinates = Coordinates([known.get(p.name, p) for p in model.parameters])
    weighting = replace(
        Weighting.white([record.within(model.edges) for record in fit.simulator.records]),
        deviation=fit.weighting.deviation,
        robust=fit.weighting.robust,
    )
    simulator, position, states = begun(fit, model, coordinates, starts, weighting)
    if finely:
        values = coordinates.values(position)
        simulator = accurate(simulator, values, states, weighting.deviation, simulator.divisions)
    return replanned(solve(simulator, coordinates, position, states, weighting, patience), patience)


def refined(fit: Fit, patience: Patience | None = None) -> Fit:
    """The fit with sample intervals divided until their error is far below the noise.

    Which intervals have to be divided depends on where the fit ended, so it is measured there and
    the fit is repeated where it had not been enough, and measured again where it went far.

    Args:
        fit: The fit.
        patience: When to give up.
    """
    patience = patience or Patience(_STEPS)
    for _ in range(_ATTEMPTS):
        if patience.over:
            return fit
        deviation = fit.weighting.deviation
        states = fit.states
        simulator = accurate(fit.simulator, fit.values, states, deviation, fit.simulator.divisions)
        change = change_between(fit.simulator, simulator, fit.values, states)
        if np.all(change < TOLERATED * deviation):
            return fit
        before = fit
        fit = solve(simulator, fit.coordinates, fit.position, states, fit.weighting, patience)
        # Finer intervals may lead to a stiffer motor than the plan of the steps holds for.
        fit = replanned(fit, patience)
        if before.cost - fit.cost < _NEAR * float(fit.weighting.counts.sum()):
            return fit
    return fit
