"""Removal of the bias by smoothed friction and by finite substeps.

At standstill the sign of friction is smoothed, and intervals are integrated in a few substeps.
Both errors are far below the noise of one sample, but they act in every sample alike: the bias of a
parameter stays, while its standard deviation falls with the square root of the number of samples.

The bias is therefore predicted to first order, from a simulation with a ten times sharper sign and
finer substeps.  If it is a relevant fraction of the standard deviation of any parameter, the fit
continues with that simulation.  The bias is proportional to the width of the smoothing, so that
about a tenth of it is left.

Source: Allgower and Georg, Numerical Continuation Methods, Springer (1990), for the step from a
smooth to a sharp problem.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Final

import numpy as np

from identification.effects.effect import effects_of
from identification.fit.campaign import Campaign
from identification.fit.solve import Fit, TerminationLimits, continued, renewed
from identification.model.simulate import Simulator
from identification.selection.omitted import optimum_shifts
from identification.selection.outcome import Outcome
from identification.selection.policy import DEFAULT
from identification.selection.trials import Trials
from identification.work import Budget

__all__ = ["sharpened", "with_sharp_friction"]

_LEAST_RATIO: Final = 0.5
"""Least ratio of the standard deviations after and before; a sharper sign adds no information, so a
smaller ratio shows sensitivities that the substeps do not resolve."""


def with_sharp_friction(
    outcome: Outcome, campaign: Campaign, withheld: Collection[str] = ()
) -> Outcome:
    """The outcome of a search with a final fit that smoothed friction does not bias.

    Terms outside the model may imitate the creep of the smoothed friction: they are screened again.
    """
    sharp, omitted = sharpened(outcome.fit), outcome.omitted
    if sharp is outcome.fit:
        return outcome
    if omitted:
        trials = Trials(campaign, Budget(), withheld=withheld)
        omitted = trials.omitted(trials.evaluate(sharp))
    return replace(outcome, fit=sharp, omitted=omitted, smooth=outcome.fit.simulator.model)


def sharpened(fit: Fit) -> Fit:
    """Fit whose parameters are not biased by smoothed friction and finite substeps.

    The same fit if the bias is small, or if the runs prefer the smoothed friction.
    """
    # As the finish of the final model, without limit: a truncated search has spent its own budget.
    limits = TerminationLimits(DEFAULT.steps, budget=Budget())
    if not fit.simulator.model.terms or limits.over:
        return fit
    sharp = _sharper(fit)
    if not _largest_bias(fit, sharp) > DEFAULT.bias:
        return fit
    found = continued(replace(fit, simulator=sharp), limits)
    found = renewed(found if found.converged else continued(found, limits), limits)
    is_better = found.cost < fit.cost and np.all(found.deviations > _LEAST_RATIO * fit.deviations)
    return found if is_better else fit


def _largest_bias(fit: Fit, sharp: Simulator) -> float:
    """Largest predicted change of a parameter by another simulation [standard deviations]."""
    simulated = [one.logged(fit.values[:, None], fit.states) for one in (sharp, fit.simulator)]
    shifts = optimum_shifts(fit, [after - before for after, before in zip(*simulated, strict=True)])
    deviations = np.sqrt(np.diag(fit.equations.covariance()))
    return float(np.max(np.abs(np.sum(shifts, axis=0)[:, 0]) / deviations))


def _sharper(fit: Fit) -> Simulator:
    """Simulator with sharper friction and an eight times smaller integration error."""
    model = fit.simulator.model
    terms = tuple(term.sharper for term in effects_of(model.terms))
    simulator = fit.simulator
    if terms != model.terms:
        simulator = simulator.changed_to(replace(model, terms=terms), fit.values)
    return simulator.finer(fit.values, fit.states, fit.weighting.deviation)
