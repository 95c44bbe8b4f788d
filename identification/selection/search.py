"""Forward selection of effects with backward elimination and exchange.

     1  M <- nominal model, or a given model with extended variants;
            filters of both sensors join if no motor has its L        lagged.with_filters
     2  repeat while the budget of the catalogue lasts, at most `rounds` times;
            a round that accepts an effect is not charged to the budget
     3      predict the gain of every candidate given M (Rao score)       Trials.scores
     4      refit the candidates with the largest predicted gain;
            if all fail in 5, once more those after them                  Trials.refits
     5      M <- the best that meets the acceptance criteria              steps.accept
     6          none: the catalogue is exhausted, leave the loop
     7      M <- filters as in 1, then extended variants and rival laws
            that are accepted                                         steps.enrich
     8      C <- nominal model with the best curve, if curves predict
                more than the effects do and the residual has structure   fit_curve
     9          C fits far better than M: leave the loop
    10      unless a candidate predicts more than the last effect did:
    11          remove effects that no longer meet the criteria           steps.backward
    12          replace effects by types that rank better                 steps.exchange
    13  if exhausted and the residual has structure: repeat 2 to 7 from
            the runner-up models of round 1, keep the better model        _restart
    14  M <- C if it ranks and predicts better; otherwise, if exhausted,
            M <- M with a curve that meets the criteria, then 11 and 12   add_curve
    15  replace effects by types that rank better in evaluated models,    _effects_of
            close ones compared with a sharp sign of the friction         sharp_rivals

The acceptance criteria are in `evidence.py`, their limits in `policy.py`.

Exchange removes surrogates: an effect that absorbed part of two others gives way to them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import replace
from typing import Literal

from identification.effects.effect import effects_of
from identification.fit.campaign import Campaign
from identification.fit.solve import Fit
from identification.selection.curves import (
    add_curve,
    fit_curve,
    has_structure,
    is_curve_due,
    is_far_better,
)
from identification.selection.evidence import (
    EvaluatedModel,
    is_better,
    probabilities,
    ranked,
    scores_of,
)
from identification.selection.lagged import with_filters
from identification.selection.noise_model import under_noise_model, with_ordinary_noise
from identification.selection.omitted import removal_steps
from identification.selection.outcome import Alternative, Found, Outcome
from identification.selection.policy import DEFAULT, SelectionPolicy
from identification.selection.refit import with_known_amplitudes
from identification.selection.sharp_rivals import with_sharp_signs
from identification.selection.steps import (
    State,
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

_End = Literal["exhausted", "cut short", "replaced", "all rounds"]
"""Why the rounds ended: no candidate is accepted, the budget of the catalogue is spent, a curve
fits far better, or the largest number of rounds is reached."""


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
    if begin is not None:
        enrich(state)
    end = _rounds(state, listed, report, is_new=begin is None)
    report(policy.rounds / (policy.rounds + 2))
    if end == "exhausted" and not listed.spent:
        _restart(state)
    is_complete = not _is_overrun(trials) and end != "cut short"
    add_curve(state, is_exhausted=end == "exhausted")
    report((policy.rounds + 1) / (policy.rounds + 2))
    again = _continued(state, listed) if end == "exhausted" and not listed.spent else None
    state, found, end = again or (state, _effects_of(state), end)
    is_complete &= not budget.spent and end != "cut short"
    effects = tuple(found)
    traces = traced(trials.curves(nominal)) if effects else ()
    final = state.current.fit if is_part else state.trials.final(state.current)
    fit = with_known_amplitudes(with_ordinary_noise(final))
    omitted = state.trials.omitted(state.current)
    is_scored = bool(state.trials.scores(state.current) or state.trials.curves(state.current))
    return Outcome(fit, effects, tuple(state.searched), is_complete, traces, omitted, is_scored)


def _rounds(state: State, listed: Budget, report: Callable[[float], None], *, is_new: bool) -> _End:
    """Lines 2 to 12 of the algorithm; the first round of a new model removes nothing."""
    trials, is_postponed = state.trials, False
    for done in range(trials.policy.rounds):
        report(done / (trials.policy.rounds + 2))
        if listed.spent:
            if has_predicted_gain(state):
                return "cut short"
            break
        began = operations()
        if not forward(state):
            break
        _refunded(began, listed, trials.budget)
        is_first = done == 0 and is_new
        is_replaced, is_postponed = _consolidate(state, listed, is_first=is_first)
        if is_replaced:
            return "replaced"
    else:
        return "all rounds"
    if is_postponed:
        backward(state)
        exchange(state)
    return "exhausted"


def _continued(state: State, listed: Budget) -> tuple[State, list[Found], _End] | None:
    """Lines 15 and 16 under the noise model: the state, its effects, and why the rounds ended.

    None if the residual needs no noise model.
    """
    again = under_noise_model(state)
    if again is None:
        return None
    enrich(again)
    end = _rounds(again, listed, lambda fraction: None, is_new=False)
    add_curve(again, is_exhausted=end == "exhausted")
    return again, _effects_of(again), end


def _consolidate(state: State, listed: Budget, *, is_first: bool) -> tuple[bool, bool]:
    """Lines 7 to 12 of the algorithm, after a round that accepted an effect.

    Returns:
        Whether a curve alone fits far better, and whether lines 11 and 12 are postponed.
    """
    budget = state.trials.budget
    began = operations()
    state.current = with_filters(state.trials, state.current)
    began = _refunded(began, listed, budget)
    enrich(state)
    began = _refunded(began, listed)
    if state.curve is None and is_curve_due(state):
        fit_curve(state)
        # A curve is not in the catalogue, so its cost is not charged to the catalogue's budget.
        began = _refunded(began, listed)
    if state.curve is not None and is_far_better(state, state.curve):
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
    if not state.current.fit.simulator.model.terms or not has_structure(state):
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
    for term in effects_of(current.fit.simulator.model.terms):
        simpler = trials.without(current, term)
        criteria = trials.criteria(current, simpler)
        known = trials.evaluated_rivals(simpler, term.name)
        rivals = [settled(state, rival, simpler, term) for rival in known]
        if not trials.budget.spent and term.name != "unlisted":
            curves = [r for r in rivals if r.effects_added_to(simpler)[0].name == "unlisted"]
            rivals = [*rivals_of(state, simpler, term.name), *curves]
        rivals = admissible(state, rivals, simpler)
        models = [current, *rivals]
        compared = with_sharp_signs(state, models)
        share, *odds = probabilities(scores_of(compared)).tolist()
        best = models[ranked(compared, trials.policy)[0]]
        better = best if best is not current else better
        names = (rival.effects_added_to(simpler)[0].name for rival in rivals)
        rated = zip(names, odds, rivals, strict=True)
        alternatives = _alternatives(rated, trials.policy.reported_probability)
        is_open = current.is_undecided(simpler.fit)
        removal = removal_steps(current.fit, simpler.fit)
        one = Found(term.name, share, criteria, alternatives, 0.0, is_open, removal)
        effects.append(replace(one, is_approximate=term.is_approximate))
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
