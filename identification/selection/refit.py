"""Refits of a model with an effect added, extended or removed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from identification.effects.effect import AbstractEffect, Candidate, effects_of
from identification.effects.sensor import CurrentFilter, SpeedFilter
from identification.fit.order_tracking import tracked
from identification.fit.own_states import amplitude_sizes
from identification.fit.solve import Fit, TerminationLimits, continued, renewed, solve
from identification.model.composite import MotorModel
from identification.model.parameter import Coordinates
from identification.model.term import AbstractTerm
from identification.model.weighting import Weighting
from identification.selection.candidates import candidates_of
from identification.selection.exchanged import exchanged
from identification.selection.policy import DEFAULT, SelectionPolicy
from identification.selection.screen import screened
from identification.selection.start import (
    Start,
    begun,
    has_odd_coefficients,
    traded,
    with_usual_coefficients,
)
from identification.work import Budget, operations

__all__ = [
    "fitted_candidate",
    "refined",
    "refitted_as",
    "refitted_from_parts",
    "refitted_with",
    "refitted_without",
    "swapped",
    "with_exchanged_lags",
    "with_known_amplitudes",
]

_LIMITS: Final = TerminationLimits(DEFAULT.steps)
_RESIZED: Final = 6
"""Refits at most until the prior scale of per-record amplitudes agrees with the amplitudes."""
_SAME_SIZE: Final = 0.05
"""Logarithm of the ratio of two scales that count as equal [-]."""


def refitted_with(
    fit: Fit, term: AbstractTerm, starts: Sequence[Start], limits: TerminationLimits = _LIMITS
) -> Fit:
    """Fit of the model with `term` added, from the optimum of `fit` and the best of the starts.

    For a thermal term, if the temperature coefficients of `fit` are implausible, a second fit
    starts from the usual coefficients with the same budget, and the better fit is returned.
    """
    model = fit.simulator.model.adding(term)
    began = operations()
    found = _refitted(fit, model, starts, limits)
    if term.equation == "thermal" and has_odd_coefficients(fit):
        other = _refitted(with_usual_coefficients(fit), model, starts, _extended(limits, began))
        found = min(found, other, key=lambda one: one.cost)
    return found


def fitted_candidate(
    fit: Fit, candidate: Candidate, starts: Sequence[Start], limits: TerminationLimits = _LIMITS
) -> Fit:
    """Fit of the model with a candidate added, from the best of its starts.

    What the parameters have absorbed of it may hold the fit at a local optimum near its start, as a
    large inductance does beside a filter of the current.  A second fit then starts where they have
    returned it.  Two more give a filter the other lags of its channel.  The best fit is returned.
    """
    began = operations()
    found = _returned(fit, candidate, starts, limits)
    if isinstance(candidate.final, CurrentFilter | SpeedFilter):
        return with_exchanged_lags(found, _extended(limits, began))
    return found


def with_exchanged_lags(fit: Fit, limits: TerminationLimits = _LIMITS) -> Fit:
    """The best of the fit and of those from its starts with other lags in the filters of sensors.

    Far from its optimum, a fit does not foresee the cost that it reaches; none is abandoned.
    """
    began, fits = operations(), [fit]
    for start in exchanged(fit):
        own = replace(_extended(limits, began), abandon_cost=np.inf, reference=fit.cost)
        fits.append(_refitted(fit, fit.simulator.model, [start], own))
    return min(fits, key=lambda one: one.cost)


def _returned(
    fit: Fit, candidate: Candidate, starts: Sequence[Start], limits: TerminationLimits
) -> Fit:
    """Fit with a candidate, from its starts and from those that return what was absorbed of it."""
    returned, began = traded(fit, candidate), operations()
    found = refitted_with(fit, candidate.final, [*starts, *returned], limits)
    before, after = fit.by_name, found.by_name
    most: dict[str, float] = {}
    for _, factors in candidate.traded:
        most |= {name: max(most.get(name, 0.0), factor) for name, factor in factors.items()}
    if all(after[name] <= factor * before[name] for name, factor in most.items() if factor < 1.0):
        return found
    moved = [replace(start, is_moved=True) for start in returned]
    other = refitted_with(fit, candidate.final, moved, _extended(limits, began))
    return min(found, other, key=lambda one: one.cost)


def _extended(limits: TerminationLimits, began: float) -> TerminationLimits:
    """The limits with a budget as large as it was before the operations since `began`."""
    if limits.budget is None:
        return limits
    return replace(limits, budget=Budget(limits.budget.left + (operations() - began)))


def refitted_as(fit: Fit, term: AbstractTerm, limits: TerminationLimits = _LIMITS) -> Fit:
    """Fit with a term in an extended variant, from the optimum of `fit`.

    New parameters start at their neutral values.  Substeps are chosen beforehand so that the whole
    simulation is accurate.  Otherwise an angle that accumulates integration errors would be a
    revolution off once the substeps become finer.
    """
    before = fit.simulator.model
    terms = tuple(term if own.name == term.name else own for own in before.terms)
    model = replace(before, terms=terms)
    known = set(fit.coordinates.names)
    new = np.array([p.prior_mean for p in model.parameters if p.name not in known])
    return _refitted(fit, model, [Start(new)], limits, finely=True)


def refitted_without(fit: Fit, name: str, limits: TerminationLimits = _LIMITS) -> Fit:
    """Fit of the model without the term of that name, from the optimum of `fit`."""
    model = fit.simulator.model.without(name)
    return _refitted(fit, model, (), limits)


def refitted_from_parts(fit: Fit, parts: Sequence[Fit], limits: TerminationLimits = _LIMITS) -> Fit:
    """The fit, or one from the best model that it contains if that model has a lower cost.

    A model fits at least as well as each model that it contains, so a fit above one of them is
    stuck at a local optimum.  The terms that a part lacks start at their values in the fit.
    """
    part = min(parts, key=lambda one: one.cost, default=fit)
    if limits.over or not part.cost < fit.cost - DEFAULT.tie:
        return fit
    at, found = fit.by_name, part
    for term in effects_of(fit.simulator.model.terms):
        if term.name not in {own.name for own in part.simulator.model.terms}:
            values = np.array([at[f"{term.name}.{p.name}"] for p in term.parameters])
            found = refitted_with(found, term, [Start(values)], limits)
    return min(fit, found, key=lambda one: one.cost)


def swapped(
    fit: Fit, old: AbstractTerm, new: AbstractEffect, rival: Fit, limits: TerminationLimits
) -> Fit:
    """Fit with `new` in place of `old`, from the optimum of `fit`.

    Its starting points are those of the score test without `old` at that optimum.  If `new` is no
    candidate there, as a law that refines another one, it starts at its values in `rival`, another
    fit of the model with `new`.
    """
    bare = refitted_without(fit, old.name, TerminationLimits(0))
    candidates = [
        candidate
        for candidate in candidates_of(bare, ())
        if (candidate.final.name, candidate.final.variant) == (new.name, new.variant)
    ]
    starts = [start for score in screened(bare, candidates) for start in score.starts]
    known = set(bare.coordinates.names)
    values = zip(rival.coordinates.names, rival.values, strict=True)
    there = Start(np.array([value for name, value in values if name not in known]))
    return refitted_with(bare, new, starts or [there], limits)


def with_known_amplitudes(fit: Fit) -> Fit:
    """The fit with the prior scale of per-record amplitudes set to their size in these runs.

    The amplitudes of a new run are then expected to be as large as those of the fitted runs.
    Without this prior, the first samples of that run would leave almost any amplitude possible.

    A stiff model at the limit of its substeps can fail to be fitted again with another step plan;
    its scale is then not changed.
    """
    own = sum(state.is_own for term in fit.simulator.model.terms for state in term.states)
    for _ in range(_RESIZED):
        model, sizes = fit.simulator.model, amplitude_sizes(fit)
        terms = []
        for term in effects_of(model.terms):
            size = max((state.scale for state in term.states if state.is_own), default=1.0)
            is_new = abs(np.log(sizes.get(term.name, size) / size)) > _SAME_SIZE
            terms.append(term.expecting(sizes[term.name]) if is_new else term)
        if tuple(terms) == model.terms:
            break
        found = _refitted(fit, replace(model, terms=tuple(terms)), (), _LIMITS)
        # Amplitudes of the expected size cost a half each; a larger rise is another optimum.
        if not found.cost < fit.cost + own * len(fit.states):
            break
        fit = found
    return fit


def _refitted(
    fit: Fit,
    model: MotorModel,
    starts: Sequence[Start],
    limits: TerminationLimits,
    *,
    finely: bool = False,
) -> Fit:
    known = {p.name: p for p in fit.coordinates.parameters}
    coordinates = Coordinates([known.get(p.name, p) for p in model.parameters])
    weighting = replace(
        Weighting.white([record.within(model.edges) for record in fit.simulator.records]),
        deviation=fit.weighting.deviation,
        robust=fit.weighting.robust,
        whitening=fit.weighting.whitening,
    )
    names = {term.name for term in fit.simulator.model.terms}
    is_untracked = any(term.tracked for term in model.terms if term.name not in names)
    if is_untracked:
        # Before the angle is tracked, a simulation does not show which order is right.
        starts = starts[:1]
    simulator, position, states = begun(fit, model, coordinates, starts, weighting)
    if finely:
        start = coordinates.values(position)
        simulator = simulator.accurate(start, states, weighting.deviation)
    if not is_untracked:
        return solve(simulator, coordinates, position, states, weighting, limits)
    values = coordinates.values(position)
    simulator, begin = tracked(simulator, values, states, fit.weighting.deviation)
    weighting = replace(weighting, records=simulator.records)
    return solve(simulator, coordinates, position, begin, weighting, limits)


def refined(
    fit: Fit, limits: TerminationLimits = _LIMITS, policy: SelectionPolicy = DEFAULT
) -> Fit:
    """The fit with substeps whose integration error is far below the noise.

    The substeps that are needed depend on the optimum, so the error is measured there.  If the
    substeps were too coarse, the fit is repeated; if it then moved far, the error is measured
    again.
    """
    for _ in range(policy.refinements):
        if limits.over:
            return fit
        here = (fit.values, fit.states, fit.weighting.deviation)
        simulator = fit.simulator.accurate(*here)
        if simulator is fit.simulator or not fit.simulator.differs_from(simulator, *here):
            return fit
        before = fit
        # With finer substeps the fit may reach a stiffer motor than its step plan allows.
        fit = renewed(continued(replace(fit, simulator=simulator), limits), limits)
        if before.cost - fit.cost < policy.refinement_gain * float(fit.weighting.counts.sum()):
            return fit
    return fit
