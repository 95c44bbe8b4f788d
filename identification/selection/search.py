"""Forward selection of effects with backward elimination and exchange.

    forward    score every prototype, refit the candidates with the largest predicted gain, and
               add the best one that meets the acceptance criteria
    enrich     replace effects by extended variants of their laws
    backward   remove the effects that no longer meet the criteria
    exchange   replace effects by other types that meet the criteria and rank better

The rounds end when no candidate is accepted or the budget is spent.  Exchange removes surrogates:
an effect that was added first because it absorbed part of two true effects is replaced once these
are in the model.  Effect types that fit equally well are reported as alternatives with their
posterior probabilities.

At the end, curves that belong to no effect type are tried.  If a curve meets the same criteria,
nothing in the catalogue explains the residual.  The curve then replaces the effects, or it is added
and all effects have to meet the criteria again together with it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from identification.fit.campaign import Campaign
from identification.fit.solve import Fit
from identification.selection.evidence import EvaluatedModel, probabilities, scores_of
from identification.selection.outcome import Alternative, Found, Outcome
from identification.selection.policy import DEFAULT, SelectionPolicy
from identification.selection.ranking import is_better, is_strained, ranked, replaces
from identification.selection.refit import with_known_amplitudes
from identification.selection.rounds import (
    State,
    abandon_cost,
    backward,
    enrich,
    exchange,
    forward,
    has_predicted_gain,
    lacks_more,
    rivals_of,
    taken,
)
from identification.selection.score import Score
from identification.selection.tracing import traced
from identification.selection.trials import Trials
from identification.work import Budget, operations

__all__ = ["search"]


def search(
    declared: Fit,
    campaign: Campaign,
    progress: Callable[[float], None] | None = None,
    work: float = np.inf,
    begin: Fit | None = None,
    withheld: Collection[str] = (),
    *,
    is_part: bool = False,
    policy: SelectionPolicy = DEFAULT,
) -> Outcome:
    """Select the effects that the nominal model lacks.

    Args:
        declared: Fit of the nominal model.
        campaign: Training and validation records.
        progress: Called with the completed fraction [-].
        work: Operation budget.  After it is spent no new step starts; the effects accepted until
            then are kept.
        begin: Fit of the model from which the selection starts; the nominal model if None.
        withheld: Names of effect types that are not candidates.
        is_part: Whether the records are a representative subset.  The selected model is then
            refitted to all samples later and is not refined here.
        policy: Limits of the search.
    """
    tell = progress or (lambda fraction: None)
    trials = Trials(
        campaign, Budget(work), policy.refit_budget * work, withheld=withheld, policy=policy
    )
    listed = Budget(policy.catalogue_budget * work)
    first = trials.evaluate(declared)
    state = State(trials, first if begin is None else trials.evaluate(begin))
    alone: EvaluatedModel | None = None
    is_exhausted = is_cut_short = is_postponed = False
    for round_ in range(1, policy.rounds + 1):
        tell((round_ - 1) / (policy.rounds + 2))
        if listed.spent:
            is_cut_short = has_predicted_gain(state)
            is_exhausted = not is_cut_short
            break
        if not forward(state, round_):
            is_exhausted = True
            break
        enrich(state, round_)
        if alone is None and _asks_for_a_curve(state, round_):
            began = operations()
            alone = _curve_alone(state, first)
            # A curve is not in the catalogue, so its cost is not charged to the catalogue's budget.
            listed = listed.longer(operations() - began)
        if alone is not None and _ends(state, round_, alone, first):
            break
        is_postponed = round_ > 1 and lacks_more(state)
        if round_ > 1 and not is_postponed:
            backward(state)
            exchange(state)
    if is_exhausted and is_postponed:
        backward(state)
        exchange(state)
    tell(policy.rounds / (policy.rounds + 2))
    if is_exhausted and not listed.spent:
        _second_thoughts(state)
    _unlisted(state, first, alone, is_exhausted)
    complete = not (trials.over or is_cut_short)
    tell((policy.rounds + 1) / (policy.rounds + 2))
    effects = _settled(state)
    traces = traced(trials.curves(first)) if effects else ()
    last = state.current.fit if is_part else trials.final(state.current)
    fit = with_known_amplitudes(last)
    return Outcome(
        fit, tuple(effects), tuple(state.searched), complete, traces, trials.omitted(state.current)
    )


def _second_thoughts(state: State) -> None:
    """Repeat the selection from runner-up models of round 1 if the residual still has structure.

    A flexible effect can absorb a second one.  Example: a Stribeck friction that is selected first
    also fits a dry friction, which then has no predicted gain.  If the dry friction is selected
    first, the Stribeck friction still has a predicted gain.
    """
    if not state.current.fit.simulator.model.terms:
        return
    if not (_is_left(state) or is_strained(state.current.fit, state.trials.policy)):
        return
    for runner in state.trials.runners()[: state.trials.policy.runners]:
        if state.trials.over:
            return
        other = State(state.trials, runner, state.searched)
        round_ = 1 + max(one.round for one in state.searched)
        if forward(other, round_):
            enrich(other, round_)
            if is_better(other.current, state.current):
                state.current = other.current
                backward(state)


def _is_left(state: State) -> list[Score]:
    """Curves with a predicted gain, given the current model, that justifies a refit.

    A curve has no shape parameters, so its gain is underestimated less than that of an effect.
    """
    trials, current = state.trials, state.current
    return [
        score
        for score in trials.curves(current)
        if score.gain
        > trials.worth_a_refit(
            current, trials.policy.curve_underestimate, _amplitudes(current, score)
        )
    ]


def _amplitudes(current: EvaluatedModel, score: Score) -> int:
    """Number of amplitudes of a curve; per-record amplitudes count once for each record."""
    records = len(current.fit.states) if score.candidate.by_record else 1
    return score.candidate.joint * records


def _asks_for_a_curve(state: State, round_: int) -> bool:
    """Whether to fit a curve to the nominal model alone before the next round.

    If effects predict at least half of the gain that curves predict, an effect is refitted first,
    which is cheaper.  Otherwise, in round 1, a curve has to predict more than the accepted effect
    did; in later rounds, a curve has to justify a refit.
    """
    left = max((score.gain for score in state.trials.curves(state.current)), default=0.0)
    listed = max((score.gain for score in state.trials.scores(state.current)), default=0.0)
    if listed >= state.trials.policy.curve_share * left:
        return False
    if round_ > 1:
        return bool(_is_left(state))
    return left > state.predicted_gain


def _curve_alone(state: State, declared: EvaluatedModel) -> EvaluatedModel | None:
    """Fit the best curve to the nominal model alone if the effects leave structured residuals.

    If the missing effect is not in the catalogue, the search accumulates surrogates.  A curve that
    fits better than two of them stops this.
    """
    if state.trials.over or not (
        _is_left(state) or is_strained(state.current.fit, state.trials.policy)
    ):
        return None
    curves = state.trials.curves(declared)[: state.trials.policy.curves]
    needed = abandon_cost(state.current, declared, state.trials.policy)
    return taken(State(state.trials, declared), curves, 1, needed)


def _ends(state: State, round_: int, alone: EvaluatedModel, declared: EvaluatedModel) -> bool:
    """Whether a curve fits so much better than the effects that further rounds would not help."""
    if round_ > 1:
        return replaces(alone, state.current, state.trials.policy)
    is_far = _is_far_better(state, alone, declared)
    return is_far and not _closes_the_gap(state, alone)


def _is_far_better(state: State, alone: EvaluatedModel, declared: EvaluatedModel) -> bool:
    """Whether a curve gains more than three times as much as the best effect.

    The missing effect is then not in the catalogue, and further rounds would accumulate surrogates.
    """
    gains = [declared.fit.cost - one.fit.cost for one in (alone, state.current)]
    is_far = gains[0] > state.trials.policy.curve_factor * gains[1]
    return is_better(alone, state.current) and is_far


def _closes_the_gap(state: State, alone: EvaluatedModel) -> bool:
    """Whether a further effect is predicted to gain most of what the curve gains over the model.

    Two effects of the catalogue can be confounded with one curve in two signals.
    """
    gap = state.current.fit.cost - alone.fit.cost
    predicted = max((score.gain for score in state.trials.scores(state.current)), default=0.0)
    return predicted > state.trials.policy.curve_share * gap


def _unlisted(
    state: State, declared: EvaluatedModel, alone: EvaluatedModel | None, is_exhausted: bool
) -> None:
    """Replace the effects by a curve, or add a curve to them, if the curve is accepted.

    If the residual has structure, or an effect has a shape parameter at its bound, all effects may
    be surrogates; a curve alone is tried first.  A curve in addition to the effects is tried only
    if the catalogue is exhausted.  Backward elimination and exchange then test the effects and the
    curve again.  A model with an unlisted term gets no second one.
    """
    trials, listed = state.trials, state.current
    left = [] if trials.over else _is_left(state)
    strained = not trials.over and is_strained(listed.fit, trials.policy)
    if (left or strained) and alone is None and listed is not declared:
        alone = _curve_alone(state, declared)
    if alone is not None and replaces(alone, listed, trials.policy):
        state.current = alone
        return
    has_curve = any(term.name == "unlisted" for term in listed.fit.simulator.model.terms)
    if left and is_exhausted and not has_curve:
        round_ = 1 + max((s.round for s in state.searched), default=0)
        chosen = taken(state, left[: trials.policy.curves], round_)
        if chosen is not None:
            state.current = chosen
            backward(state)
            exchange(state)


def _settled(state: State) -> list[Found]:
    """Effects of the final model, after exchanges that need no further refit.

    If the search was cut short, or changed its model last, a model that was evaluated before may
    rank better with another type in place of an effect.
    """
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
        looked = trials.known_beside(simpler, term)
        if not trials.over and term.name != "unlisted":
            curves = [one for one in looked if one.fit.simulator.model.terms[-1].name == "unlisted"]
            looked = [*rivals_of(state, simpler, term.name), *curves]
        rivals = [r for r in looked if trials.criteria(r, simpler).passed]
        models = [current, *rivals]
        odds = probabilities(scores_of(models))
        best = models[ranked(models, trials.policy)[0]]
        better = best if best is not current else better
        others: dict[str, float] = {}
        for rival, probability in zip(rivals, odds[1:], strict=True):
            added = rival.fit.simulator.model.terms[-1].name
            others[added] = others.get(added, 0.0) + float(probability)
        alternatives = tuple(
            Alternative(other, probability)
            for other, probability in sorted(others.items(), key=lambda item: -item[1])
            if probability > trials.policy.reported_probability
        )
        effects.append(Found(term.name, float(odds[0]), criteria, alternatives))
    return sorted(effects, key=lambda effect: -effect.criteria.gain), better
