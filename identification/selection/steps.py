"""Steps of the selection: forward, enrich, backward, exchange; `search` calls them in order."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from identification.effects.effect import effects_of
from identification.fit.solve import TerminationLimits
from identification.model.term import AbstractTerm
from identification.selection.candidates import with_predicted_gain
from identification.selection.criteria import AcceptanceCriteria
from identification.selection.evidence import (
    UNCOMPUTED,
    EvaluatedModel,
    is_better,
    ranked,
    replaces,
)
from identification.selection.outcome import Searched
from identification.selection.policy import SelectionPolicy
from identification.selection.refit import swapped
from identification.selection.score import Key, Score
from identification.selection.trials import Trials
from identification.work import Budget, operations

__all__ = [
    "State",
    "accept",
    "admissible",
    "backward",
    "enrich",
    "exchange",
    "forward",
    "has_predicted_gain",
    "lacks_more",
    "rivals_of",
    "settled",
]


@dataclass
class State:
    """State of the selection."""

    trials: Trials
    """Cache of all fits and scores, with budget and policy."""
    nominal: EvaluatedModel
    """The model without effects."""
    current: EvaluatedModel
    """Model to which the next effect is added."""
    searched: list[Searched] = field(default_factory=list)
    """Examined candidates, in order."""
    predicted_gain: float = 0.0
    """Predicted gain of the effect that was added last; zero before the first."""
    curve: EvaluatedModel | None = None
    """The nominal model with the best curve; None as long as none is fitted or accepted."""
    sharp: dict[Key, tuple[EvaluatedModel, EvaluatedModel]] = field(default_factory=dict)
    """Models, and the same with a sharp sign of the friction."""

    @property
    def round(self) -> int:
        """Number of the last round, from 1; zero before the first."""
        return max((one.round for one in self.searched), default=0)

    def note(
        self, score: Score, round_: int, criteria: AcceptanceCriteria | None, *, chosen: bool
    ) -> None:
        """Add a candidate to those that were examined."""
        term = score.candidate.final
        self.searched.append(
            Searched(term.name, round_, score.gain, criteria, chosen, term.variant)
        )


def forward(state: State) -> bool:
    """Add the best candidate that meets the acceptance criteria; return False if there is none.

    A prediction can be too large as well as too small: if the candidates with the largest predicted
    gains fail, those are refitted whose gains are the largest without them.
    """
    trials, current, round_ = state.trials, state.current, state.round + 1
    scores, accepted, refitted = trials.scores(current), None, set[tuple[str, str]]()
    for _ in range(trials.policy.batches):
        left = [score for score in scores if score.structure not in refitted]
        wanted = _with_worthwhile_gain(trials, current, left, trials.policy.candidates)
        accepted = accept(state, wanted, round_=round_)
        refitted |= {score.structure for score in wanted}
        if accepted is not None or not wanted or trials.budget.spent:
            break
    for score in with_predicted_gain(scores, len(scores)):
        if score.structure not in refitted:
            state.note(score, round_, None, chosen=False)
    for name in trials.uncomputed(current):
        state.searched.append(Searched(name, round_, np.nan, None, False, flaw=UNCOMPUTED))
    if accepted is None:
        return False
    state.current = accepted
    state.predicted_gain = next(s.predicted_gain for s in reversed(state.searched) if s.chosen)
    return True


def accept(
    state: State, wanted: Sequence[Score], abandon_cost: float = np.inf, round_: int | None = None
) -> EvaluatedModel | None:
    """Refit candidates and return the best model that meets the acceptance criteria, or None.

    The candidates, the largest predicted gain first, are added to `searched` of the state, under a
    new round if None is given; a fit above `abandon_cost` is dropped.
    """
    trials, current, round_ = state.trials, state.current, round_ or state.round + 1
    fits = trials.refits(current, wanted, abandon_cost)
    models = trials.finish_best(current, fits)
    finished = len(models)
    order = ranked(models, trials.policy)
    criteria = {k: trials.criteria(models[k], current) for k in order}
    chosen = _best_passing(models, criteria, trials.policy)
    if chosen is None:
        # Skipped candidates and fits behind the best count only if the best have failed.
        fits += trials.refits(current, _without_fit(wanted, fits), abandon_cost)
        models += [trials.evaluate(fit, current.fraction) for _, fit in fits[finished:]]
    else:
        models += [EvaluatedModel(fit, current.fraction) for _, fit in fits[finished:]]
    behind = {k: trials.criteria(models[k], current) for k in range(finished, len(fits))}
    chosen = _best_passing(models, behind, trials.policy) if chosen is None else chosen
    for k, found in (criteria | behind).items():
        state.note(fits[k][0], round_, found, chosen=k == chosen)
    for score in _without_fit(wanted, fits):
        state.note(score, round_, None, chosen=False)
    return None if chosen is None else models[chosen]


def _best_passing(
    models: Sequence[EvaluatedModel],
    criteria: Mapping[int, AcceptanceCriteria],
    policy: SelectionPolicy,
) -> int | None:
    """Index of the best of the models that meet their criteria, or None; ties count among them."""
    passing = [k for k, found in criteria.items() if found.passed]
    return passing[ranked([models[k] for k in passing], policy)[0]] if passing else None


def _without_fit(wanted: Sequence[Score], fits: Sequence[tuple[Score, object]]) -> list[Score]:
    return [score for score in wanted if all(score is not fitted for fitted, _ in fits)]


def _with_worthwhile_gain(
    trials: Trials, model: EvaluatedModel, scores: Sequence[Score], count: int
) -> list[Score]:
    """Candidates of a model that are worth a refit.

    Amplitudes that are free in each record gain by chance in each of them: a candidate is left out
    if its predicted gain would not be significant even if it were underestimated as far as any.
    """
    records, most = len(model.fit.states), max((score.gain for score in scores), default=0.0)
    least = max(trials.worth_a_refit(model), trials.policy.predicted_share * most)
    likely = [
        score
        for score in scores
        if trials.policy.underestimate * score.gain > trials.chance(model, score.unknowns(records))
    ]
    return with_predicted_gain(likely, count, least)


def has_predicted_gain(state: State) -> bool:
    """True if the predicted gain of any candidate justifies a refit."""
    scores = state.trials.scores(state.current)
    return bool(_with_worthwhile_gain(state.trials, state.current, scores, 1))


def lacks_more(state: State) -> bool:
    """True if a candidate has a larger predicted gain than the effect that was added last had.

    Backward elimination and exchange are then postponed.
    """
    scores = state.trials.scores(state.current)
    return any(score.gain > state.predicted_gain for score in scores)


def enrich(state: State) -> None:
    """Replace effects by extended variants or rival laws, as long as these are accepted.

    The effects have been accepted among all prototypes; a variant is selected among those of the
    effects alone.  None is left out because another one was expensive, so the budget does not pay
    for them: with the wrong law of an effect, the intervals would not contain the parameters.
    """
    trials = state.trials
    effects = effects_of(state.current.fit.simulator.model.terms)
    variants = sum(len(found.richer) + len(found.rival_laws) for found in effects)
    for found in effects:
        left = [*found.richer, *found.rival_laws]
        while left and not trials.budget.spent:
            began, term = operations(), left.pop(0)
            richer = trials.enriched(state.current, term)
            trials.budget.extend(operations() - began)
            criteria = richer.criteria(state.current, variants, trials.policy)
            is_accepted = criteria.refines
            round_ = max(state.round, 1)
            state.searched.append(
                Searched(term.name, round_, criteria.gain, criteria, is_accepted, term.variant)
            )
            if is_accepted:
                rivals = (law for law in left if law in found.rival_laws)
                state.current, left = richer, [*term.richer, *rivals]
                variants += len(term.richer)


def backward(state: State) -> None:
    """Remove effects that no longer meet the criteria; the last remaining effect is kept.

    An effect is also removed if it makes up for the law of another one, of which a rival law needs
    no second effect.  It is cheap, so it does not end with the budget: a fit without the effect
    that is cut short only makes the effect seem to gain more.
    """
    for term in state.current.fit.simulator.model.terms:
        if len(state.current.fit.simulator.model.terms) < 2:
            return
        simpler = state.trials.without(state.current, term)
        left = effects_of(simpler.fit.simulator.model.terms)
        laws = [law for other in left for law in other.rival_laws]
        # A rival law is fitted only if the effect would be kept.
        rivals = (state.trials.enriched(simpler, law) for law in laws)
        for model in itertools.chain([simpler], rivals):
            if not state.trials.criteria(state.current, model).is_kept:
                state.current = model
                break


def exchange(state: State) -> None:
    """Replace effects by other types that meet the criteria and rank better."""
    trials = state.trials
    for term in state.current.fit.simulator.model.terms:
        if trials.budget.spent:
            return
        simpler = trials.without(state.current, term)
        rivals = rivals_of(state, simpler, term.name)
        models = [state.current, *admissible(state, rivals, simpler)]
        state.current = models[ranked(models, trials.policy)[0]]


def admissible(
    state: State, rivals: Sequence[EvaluatedModel], simpler: EvaluatedModel
) -> list[EvaluatedModel]:
    """Rivals that meet the criteria against the simpler model.

    A rival is no new effect: under a noise model, its size is judged by the simulation error as
    well, as that of the accepted effect is.  A curve that ranks better than the current model, but
    may not replace it, is left out: it is the effect itself.
    """
    trials, current = state.trials, state.current
    passing = [rival for rival in rivals if trials.criteria(rival, simpler).is_kept]
    return [
        rival
        for rival in passing
        if rival.effects_added_to(simpler)[0].name != "unlisted"
        or not is_better(rival, current)
        or replaces(rival, current, trials.policy)
    ]


def settled(
    state: State, rival: EvaluatedModel, simpler: EvaluatedModel, term: AbstractTerm
) -> EvaluatedModel:
    """Rival with another effect in place of `term`, compared at its optimum.

    Effects of the same equation and drivers have nearly the same signature, so an unfinished fit of
    one decides nothing against the other.  It is repeated from the optimum of the current model,
    even after the budget is spent.  Both models extend the simpler one by one effect; that of the
    rival replaces `term` of the current model.
    """
    trials, current = state.trials, state.current
    (added,) = rival.effects_added_to(simpler)
    is_like = (added.equation, added.drivers) == (term.equation, term.drivers)
    if not is_like or not trials.is_due(rival, current):
        return rival
    steps, longest = trials.policy.steps, trials.longest
    limits = TerminationLimits(steps, budget=Budget(longest))
    fit = swapped(current.fit, term, added, rival.fit, limits)
    finished = trials.finished(fit, TerminationLimits(steps, budget=Budget(longest)))
    return trials.evaluate(finished, current.fraction)


def rivals_of(state: State, simpler: EvaluatedModel, name: str) -> list[EvaluatedModel]:
    """Models with another effect type in place of `name` and a cost close to the current one.

    A fit at the angles of the simpler model that gained less than predicted is repeated at those of
    the current model.  So is one that stopped before its optimum, if its effect is like the one it
    replaces: without that one, the parameters are far from those of both.
    """
    trials, policy = state.trials, state.trials.policy
    (term,) = (t for t in state.current.fit.simulator.model.terms if t.name == name)
    scores = [s for s in trials.scores(simpler) if s.candidate.term.name != name]
    limit = trials.abandon_cost(state.current, simpler)
    needed = simpler.fit.cost - limit
    scores = [
        s for s in scores if s.gain * trials.underestimate(simpler, s.candidate.term) > needed
    ]
    wanted = _with_worthwhile_gain(trials, simpler, scores, policy.rivals)
    trials.refits(simpler, wanted, limit)
    for score in wanted:
        doubtful = trials.doubtful(simpler, score)
        if doubtful is not None:
            settled(state, EvaluatedModel(doubtful, 1.0), simpler, term)
    return trials.finish_best(simpler, trials.refits(simpler, wanted, limit))
