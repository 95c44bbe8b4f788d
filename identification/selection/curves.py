"""Curves in place of the effects, or beside them, if the catalogue lacks what is missing."""

from __future__ import annotations

from dataclasses import replace

from identification.selection.evidence import EvaluatedModel, is_at_bound, is_better, replaces
from identification.selection.score import Score
from identification.selection.steps import State, accept, backward, exchange
from identification.selection.trials import Trials

__all__ = ["add_curve", "fit_curve", "has_structure", "is_curve_due", "is_far_better"]


def add_curve(state: State, *, is_exhausted: bool) -> None:
    """Replace the effects by a curve, or add a curve to them, if the curve is accepted.

    If the residual has structure, or an effect has a shape parameter at its bound, all effects may
    be surrogates; a curve alone is tried first.  A curve in addition to the effects is tried only
    if the catalogue is exhausted.  Backward elimination and exchange then test the effects and the
    curve again.  A model with an unlisted term gets no second one.
    """
    trials, listed = state.trials, state.current
    curves = [] if trials.budget.spent else _curves_worth_a_refit(trials, listed)
    if state.curve is None and listed is not state.nominal:
        fit_curve(state)
    if state.curve is not None and replaces(state.curve, listed, trials.policy):
        state.current = state.curve
        return
    has_curve = any(term.name == "unlisted" for term in listed.fit.simulator.model.terms)
    if curves and is_exhausted and not has_curve:
        accepted = accept(state, curves[: trials.policy.curves])
        if accepted is not None:
            state.current = accepted
            backward(state)
            exchange(state)


def fit_curve(state: State) -> None:
    """Fit the best curve to the nominal model alone if the effects leave structured residuals.

    If the missing effect is not in the catalogue, the search accumulates surrogates.  A curve that
    fits better than two of them stops this.  A law with a grid of starting points is fitted in any
    case: its score is no prediction of what another point of the grid gains.
    """
    trials, nominal = state.trials, state.nominal
    if trials.budget.spent or not has_structure(state):
        return
    scores = trials.curves(nominal)
    curves = scores[: trials.policy.curves]
    curves += [score for score in scores[len(curves) :] if score.candidate.tried is not None]
    limit = trials.abandon_cost(state.current, nominal)
    state.curve = accept(State(trials, nominal, nominal), curves, limit)


def is_curve_due(state: State) -> bool:
    """True if a curve is to be fitted to the nominal model alone before the next round.

    If effects predict at least half of the gain that curves predict, an effect is refitted first,
    which is cheaper.  Otherwise, in round 1, a curve has to predict more than the accepted effect
    did; in later rounds, a curve has to justify a refit.
    """
    trials = state.trials
    by_curve = _largest_gain(trials.curves(state.current))
    if _largest_gain(trials.scores(state.current)) >= trials.policy.curve_share * by_curve:
        return False
    if state.round > 1:
        return bool(_curves_worth_a_refit(trials, state.current))
    return by_curve > state.predicted_gain


def is_far_better(state: State, curve: EvaluatedModel) -> bool:
    """True if a curve fits so much better than the effects that more rounds would not help.

    After one effect, it has to gain three times as much, and no second effect may be predicted to
    gain most of the difference: two effects of the catalogue can be confounded with one curve in
    two signals.
    """
    policy, current = state.trials.policy, state.current
    if state.round > 1:
        return replaces(curve, current, policy)
    of_curve, of_effect = (state.nominal.fit.cost - one.fit.cost for one in (curve, current))
    if not (is_better(curve, current) and of_curve > policy.curve_factor * of_effect):
        return False
    predicted = _largest_gain(state.trials.scores(current))
    return predicted <= policy.curve_share * (current.fit.cost - curve.fit.cost)


def has_structure(state: State) -> bool:
    """True if a curve would still gain, or an effect has a shape parameter at its bound.

    A correlated residual is coloured noise or structure; here it counts as structure.
    """
    if _curves_worth_a_refit(state.trials, replace(state.current, fraction=1.0)):
        return True
    return is_at_bound(state.current.fit, state.trials.policy)


def _curves_worth_a_refit(trials: Trials, current: EvaluatedModel) -> list[Score]:
    """Curves with a predicted gain, given the current model, that justifies a refit.

    A curve has no shape parameters, so its gain is underestimated less than that of an effect.
    """
    factor, records = trials.policy.curve_underestimate, len(current.fit.states)
    return [
        score
        for score in trials.curves(current)
        if score.gain > trials.worth_a_refit(current, factor, score.unknowns(records))
    ]


def _largest_gain(scores: list[Score]) -> float:
    return max((score.gain for score in scores), default=0.0)
