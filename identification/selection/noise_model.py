"""Selection under the noise model of the residuals.

The search compares models by the likelihood of independent normal errors and counts the samples of
coloured noise as fewer.  That is right on average over all directions, not for each effect: slow
noise hides a slow effect, but not that a filter is no delay.  Once no effect is missing any more,
the residual of the model is noise, and its noise model decides among effects as it does among
parameters: whitened residuals for coloured noise, Student-t weights for outliers.

Source: Ljung, System Identification, 2nd edition, section 7.4 (likelihood of a noise model).
"""

from __future__ import annotations

from dataclasses import replace

from identification.fit.noise import with_noise_model
from identification.fit.solve import Fit, continued
from identification.selection.steps import State
from identification.selection.trials import Trials

__all__ = ["under_noise_model", "with_ordinary_noise"]


def under_noise_model(state: State) -> State | None:
    """State of a search that continues from the current model with the noise model of its residual.

    None if the residual is white and normal or holds more than noise: a candidate of the last round
    is significant, but was refused.
    """
    fit, trials = state.current.fit, state.trials
    last = [one.criteria for one in state.searched if one.round == state.round]
    is_structured = any(one is not None and one.is_unconfirmed for one in last)
    if is_structured:
        return None
    current = with_noise_model(fit)
    if current is fit or not current.converged:
        return None
    again = Trials(
        trials.campaign, trials.budget, trials.longest, trials.tried, trials.withheld, trials.policy
    )
    nominal = state.nominal.fit
    weighting = replace(
        current.weighting, records=nominal.weighting.records, deviation=nominal.weighting.deviation
    )
    start = replace(nominal, weighting=weighting) if fit.simulator.model.terms else current
    evaluated = again.evaluate(continued(start, again.limits()))
    return State(again, evaluated, again.evaluate(current), state.searched)


def with_ordinary_noise(fit: Fit) -> Fit:
    """Fit with independent normal errors, from the optimum under a noise model."""
    weighting = fit.weighting.unwhitened
    if weighting.robust is None and fit.weighting.order == 0:
        return fit
    return continued(replace(fit, weighting=replace(weighting, robust=None)))
