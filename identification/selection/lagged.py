"""Filters of both sensors at once, if no motor has the inductance of the fit.

The nominal fit attributes the lag of a current filter to L.  A large L lags the speed as well, so
that a filter of the speed hides in it too, and J, b and the friction are biased until both filters
are in the model.  Each filter alone gains little or nothing, and an elastic shaft gains more.  A
brush drop or friction that is not yet in the model can hide the filters, so that they are tried
again after each effect beside which one of them is predicted to gain.
"""

from __future__ import annotations

import numpy as np

from identification.checks.plausible import longest_electrical
from identification.effects.sensor import CurrentFilter, SpeedFilter
from identification.fit.solve import Fit, TerminationLimits
from identification.selection.candidates import scales_of
from identification.selection.evidence import EvaluatedModel
from identification.selection.policy import SelectionPolicy
from identification.selection.refit import refitted_with, with_exchanged_lags
from identification.selection.start import Start, traded
from identification.selection.trials import Trials

__all__ = ["with_filters"]


def with_filters(trials: Trials, before: EvaluatedModel) -> EvaluatedModel:
    """The model with filters of both sensors, if it is accepted and L is then that of a motor.

    The model itself if not, if its inductance is plausible, or if it has or may have no filter.
    """
    fit, policy = before.fit, trials.policy
    left_out = {*trials.withheld, *(term.name for term in fit.simulator.model.terms)}
    filters = {CurrentFilter.name, SpeedFilter.name}
    if filters & left_out or not _is_slow(fit, policy):
        return before
    if fit.simulator.model.terms and not _predicted(trials, before, filters):
        return before
    scales = scales_of(fit)
    of_current, of_speed = (law.candidates(scales)[0] for law in (CurrentFilter, SpeedFilter))
    fits = []
    for start in traded(fit, of_current):
        # The inductance lags both channels, so that both filters take the same lag.
        slow = refitted_with(fit, of_current.final, [start], TerminationLimits(0))
        fits.append(refitted_with(slow, of_speed.final, [Start(start.values)], trials.limits()))
    best = with_exchanged_lags(min(fits, key=lambda one: one.cost), trials.limits())
    if not np.isfinite(best.cost):
        return before
    model = trials.evaluate(trials.finished(best))
    is_accepted = trials.criteria(model, before).passed and not _is_slow(model.fit, policy)
    return model if is_accepted else before


def _predicted(trials: Trials, model: EvaluatedModel, filters: set[str]) -> bool:
    """True if a filter is predicted to gain; beside other effects, a large L hides none fully."""
    least = trials.worth_a_refit(model)
    scores = trials.scores(model)
    return any(s.candidate.term.name in filters and s.gain > least for s in scores)


def _is_slow(fit: Fit, policy: SelectionPolicy) -> bool:
    """True if the electrical time constant is longer than that of any motor of this size.

    An inductance that the runs do not determine may be shorter.
    """
    values = fit.by_name
    deviation = float(fit.deviations[fit.coordinates.names.index("L")])
    return values["L"] - policy.bound_sd * deviation > values["Ra25"] * longest_electrical(values)
