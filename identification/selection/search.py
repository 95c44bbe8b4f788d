"""Forward selection of effects with backward elimination and exchange.

     1  M <- nominal model, or a given model with extended variants;
            filters of both sensors join if no motor has its L        lagged.with_filters
     2  repeat while the budget of the catalogue lasts, at most `rounds` times;
            a round that accepts an effect is not charged to the budget
     3      predict the gain of every candidate given M (Rao score)       Trials.scores
     4      refit the candidates with the largest predicted gain          Trials.refits
     5      M <- the best that meets the acceptance criteria              steps.accept
     6          none: the catalogue is exhausted, leave the loop
     7      M <- filters as in 1, then extended variants and rival laws
            that are accepted                                         steps.enrich
     8      C <- nominal model with the best curve, if curves predict
                more than the effects do and the residual has structure   _fit_curve
     9          C fits far better than M: leave the loop
    10      unless a candidate predicts more than the last effect did:
    11          remove effects that no longer meet the criteria           steps.backward
    12          replace effects by types that rank better                 steps.exchange
    13  if exhausted and the residual has structure: repeat 2 to 7 from
            the runner-up models of round 1, keep the better model        _restart
    14  M <- C if it ranks and predicts better; otherwise, if exhausted,
            M <- M with a curve that meets the criteria, then 11 and 12   _add_curve
    15  replace effects by types that rank better in evaluated models     _effects_of

The acceptance criteria are in `evidence.py`, their limits in `policy.py`.

Exchange removes surrogates: an effect that absorbed part of two others gives way to them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import replace

from identification.fit.campaign import Campaign
from identification.fit.solve import Fit
from identification.selection.evidence import (
    EvaluatedModel,
    is_at_bound,
    is_better,
    probabilities,
    ranked,
    replaces,
    scores_of,
)
from identification.selection.lagged import with_filters
from identification.selection.outcome import Alternative, Found, Outcome
from identification.selection.policy import DEFAULT, SelectionPolicy
from identification.selection.refit import with_known_amplitudes
from identification.selection.score import Score
from identification.selection.steps import (
    State,
    accept,
    admissible,
    backward,
    enrich,
    exchange,
    forward,
    has_predicted_gain,
    lacks_more,
    rivals_of,
    settled,
)
from identification.selection.tracing import traced
from identification.selection.trials import Trials
from identification.work import Budget, operations

__all__ = ["search"]


def search(
    declared: Fit,
    campaign: Campaign,
    progress: Callable[[float], None] | None = None,
    budget: Budget | None = None,
    begin: Fit | None = None,
    withheld: Collection[str] = (),
    *,
    is_part: bool = False,
    policy: SelectionPolicy = DEFAULT,
) -> Outcome:
    """Select the effects that the nominal model, or the model of `begin`, lacks.

    `progress` is called with the completed fraction [-].  Once the operation budget is spent, no
    new step starts; a round that accepts an effect extends it.  The withheld effect types are not
    candidates.  If the records are a part of the campaign, the model is refined later.
    """
    report = progress or (lambda fraction: None)
    budget = budget or Budget()
    listed = Budget(policy.catalogue_budget * budget.left)
    trials = Trials(
        campaign, budget, policy.refit_budget * budget.left, withheld=withheld, policy=policy
    )
    nominal = trials.evaluate(declared)
    first = with_filters(trials, nominal) if begin is None else trials.evaluate(begin)
    state = State(trials, nominal, first)
    is_exhausted = is_cut_short = is_postponed = False
    if begin is not None:
        enrich(state)
    for done in range(policy.rounds):
        report(done / (policy.rounds + 2))
        if listed.spent:
            is_cut_short = has_predicted_gain(state)
            is_exhausted = not is_cut_short
            break
        began = operations()
        if not forward(state):
            is_exhausted = True
            break
        _refunded(began, listed, budget)
        is_first = done == 0 and begin is None
        is_replaced, is_postponed = _consolidate(state, listed, is_first=is_first)
        if is_replaced:
            break
    if is_exhausted and is_postponed:
        backward(state)
        exchange(state)
    report(policy.rounds / (policy.rounds + 2))
    if is_exhausted and not listed.spent:
        _restart(state)
    is_cut_short |= _is_overrun(trials)
    _add_curve(state, is_exhausted=is_exhausted)
    report((policy.rounds + 1) / (policy.rounds + 2))
    is_complete = not (trials.budget.spent or is_cut_short)
    effects = tuple(_effects_of(state))
    traces = traced(trials.curves(nominal)) if effects else ()
    fit = with_known_amplitudes(state.current.fit if is_part else trials.final(state.current))
    omitted = trials.omitted(state.current)
    is_scored = bool(trials.scores(state.current) or trials.curves(state.current))
    return Outcome(fit, effects, tuple(state.searched), is_complete, traces, omitted, is_scored)


def _consolidate(state: State, listed: Budget, *, is_first: bool) -> tuple[bool, bool]:
    """Lines 7 to 12 of the algorithm, after a round that accepted an effect.

    Returns:
        Whether a curve alone fits far better, and whether lines 11 and 12 are postponed.
    """
    budget = state.trials.budget
    began = operations()
    state.current = with_filters(state.trials, state.current)
    enrich(state)
    began = _refunded(began, listed, budget)
    if state.curve is None and _is_curve_due(state):
        _fit_curve(state)
        # A curve is not in the catalogue, so its cost is not charged to the catalogue's budget.
        began = _refunded(began, listed)
    if state.curve is not None and _is_far_better(state, state.curve):
        return True, False
    if is_first or lacks_more(state):
        return False, not is_first
    backward(state)
    exchange(state)
    _refunded(began, listed, budget)
    return False, False


def _is_overrun(trials: Trials) -> bool:
    """True if the rounds have spent the whole budget; the curves have theirs in any case."""
    budget, policy = trials.budget, trials.policy
    left, whole = budget.left, trials.longest / policy.refit_budget
    reserved = (1.0 - policy.catalogue_budget) * whole
    if left < reserved:
        budget.extend(reserved - left)
    return left < 0.0


def _refunded(began: float, *budgets: Budget) -> float:
    """Extend budgets by the operations since `began`; return the count of operations now."""
    now = operations()
    for budget in budgets:
        budget.extend(now - began)
    return now


def _restart(state: State) -> None:
    """Repeat the selection from runner-up models of round 1 if the residual still has structure.

    A flexible effect can absorb a second one.  Example: a Stribeck friction that is selected first
    also fits a dry friction, which then has no predicted gain.  If the dry friction is selected
    first, the Stribeck friction still has a predicted gain.
    """
    trials = state.trials
    if not state.current.fit.simulator.model.terms or not _has_structure(state):
        return
    for runner_up in trials.runners_up()[: trials.policy.runners]:
        if trials.budget.spent:
            return
        other = State(trials, state.nominal, runner_up, state.searched)
        for _ in range(trials.policy.rounds - 1):
            if not forward(other):
                break
            enrich(other)
        if other.current is not runner_up and is_better(other.current, state.current):
            state.current = other.current
            backward(state)


def _has_structure(state: State) -> bool:
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


def _is_curve_due(state: State) -> bool:
    """Whether to fit a curve to the nominal model alone before the next round.

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


def _fit_curve(state: State) -> None:
    """Fit the best curve to the nominal model alone if the effects leave structured residuals.

    If the missing effect is not in the catalogue, the search accumulates surrogates.  A curve that
    fits better than two of them stops this.  A law with a grid of starting points is fitted in any
    case: its score is no prediction of what another point of the grid gains.
    """
    trials, nominal = state.trials, state.nominal
    if trials.budget.spent or not _has_structure(state):
        return
    scores = trials.curves(nominal)
    curves = scores[: trials.policy.curves]
    curves += [score for score in scores[len(curves) :] if score.candidate.tried is not None]
    limit = trials.abandon_cost(state.current, nominal)
    state.curve = accept(State(trials, nominal, nominal), curves, limit)


def _is_far_better(state: State, curve: EvaluatedModel) -> bool:
    """Whether a curve fits so much better than the effects that further rounds would not help.

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


def _add_curve(state: State, *, is_exhausted: bool) -> None:
    """Replace the effects by a curve, or add a curve to them, if the curve is accepted.

    If the residual has structure, or an effect has a shape parameter at its bound, all effects may
    be surrogates; a curve alone is tried first.  A curve in addition to the effects is tried only
    if the catalogue is exhausted.  Backward elimination and exchange then test the effects and the
    curve again.  A model with an unlisted term gets no second one.
    """
    trials, listed = state.trials, state.current
    curves = [] if trials.budget.spent else _curves_worth_a_refit(trials, listed)
    if state.curve is None and listed is not state.nominal:
        _fit_curve(state)
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


def _effects_of(state: State) -> list[Found]:
    """Effects of the final model, after removals and exchanges that need no further refit.

    If the search was cut short, or changed its model last, a model that was evaluated before may
    rank better with another type in place of an effect.
    """
    backward(state)
    effects, better = _explained(state)
    for _ in range(state.trials.policy.rounds):
        if better is None:
            break
        state.current = better
        effects, better = _explained(state)
    return effects


def _explained(state: State) -> tuple[list[Found], EvaluatedModel | None]:
    """Effects of the current model with alternatives, and a better-ranked model if there is one."""
    current, trials = state.current, state.trials
    effects, better = [], None
    for term in current.fit.simulator.model.terms:
        simpler = trials.without(current, term)
        criteria = trials.criteria(current, simpler)
        known = trials.evaluated_rivals(simpler, term.name)
        rivals = [settled(state, rival, simpler, term) for rival in known]
        if not trials.budget.spent and term.name != "unlisted":
            curves = [r for r in rivals if r.effects_added_to(simpler)[0].name == "unlisted"]
            rivals = [*rivals_of(state, simpler, term.name), *curves]
        rivals = admissible(state, rivals, simpler)
        models = [current, *rivals]
        share, *odds = probabilities(scores_of(models)).tolist()
        best = models[ranked(models, trials.policy)[0]]
        better = best if best is not current else better
        names = (rival.effects_added_to(simpler)[0].name for rival in rivals)
        rated = zip(names, odds, rivals, strict=True)
        alternatives = _alternatives(rated, trials.policy.reported_probability)
        is_open, removal = trials.removal(current, simpler)
        effects.append(Found(term.name, share, criteria, alternatives, 0.0, is_open, removal))
    return sorted(effects, key=lambda effect: -effect.criteria.gain), better


def _alternatives(
    rated: Iterable[tuple[str, float, EvaluatedModel]], least: float
) -> tuple[Alternative, ...]:
    """Effect types with a probability above `least`, each with the fit of its most probable law."""
    found: dict[str, Alternative] = {}
    for name, probability, rival in sorted(rated, key=lambda item: -item[1]):
        known = found.get(name) or Alternative(name, 0.0, rival.fit, rival.fraction)
        found[name] = replace(known, probability=known.probability + probability)
    ordered = sorted(found.values(), key=lambda other: -other.probability)
    return tuple(other for other in ordered if other.probability > least)
