"""Start of the selection with filters of both sensors, if no motor has the nominal inductance.

The nominal fit attributes the lag of a current filter to L.  A large L lags the speed as well, so
that a filter of the speed hides in it too, and J, b and the friction are biased until both filters
are in the model.  Each filter alone gains little or nothing, and an elastic shaft gains more.
"""

from __future__ import annotations

import numpy as np

from identification.checks.plausible import longest_electrical
from identification.effects.sensor import CurrentFilter, SpeedFilter
from identification.fit.solve import Fit, TerminationLimits
from identification.selection.candidates import scales_of
from identification.selection.evidence import EvaluatedModel
from identification.selection.policy import SelectionPolicy
from identification.selection.refit import refitted_with
from identification.selection.start import Start, traded
from identification.selection.trials import Trials

__all__ = ["started"]


def started(trials: Trials, nominal: EvaluatedModel) -> EvaluatedModel:
    """The nominal model with filters of both sensors, if it is accepted and L is that of a motor.

    The nominal model itself if not, if its inductance is plausible, or if a filter is withheld.
    """
    fit, policy = nominal.fit, trials.policy
    is_withheld = {CurrentFilter.name, SpeedFilter.name} & set(trials.withheld)
    if is_withheld or not _is_slow(fit, policy):
        return nominal
    scales = scales_of(fit)
    of_current, of_speed = (law.candidates(scales)[0] for law in (CurrentFilter, SpeedFilter))
    fits = []
    for start in traded(fit, of_current):
        # The inductance lags both channels, so that both filters take the same lag.
        slow = refitted_with(fit, of_current.final, [start], TerminationLimits(0))
        fits.append(refitted_with(slow, of_speed.final, [Start(start.values)], trials.limits()))
    best = min(fits, key=lambda one: one.cost)
    if not np.isfinite(best.cost):
        return nominal
    model = trials.evaluate(trials.finished(best))
    is_accepted = trials.criteria(model, nominal).passed and not _is_slow(model.fit, policy)
    return model if is_accepted else nominal


def _is_slow(fit: Fit, policy: SelectionPolicy) -> bool:
    """True if the electrical time constant is longer than that of any motor of this size.

    An inductance that the runs do not determine may be shorter.
    """
    values = fit.by_name
    deviation = float(fit.deviations[fit.coordinates.names.index("L")])
    return values["L"] - policy.bound_sd * deviation > values["Ra25"] * longest_electrical(values)
