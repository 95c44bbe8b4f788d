"""Steps of one selection round: forward, enrich, backward, exchange.

The module `search` describes the steps and calls them in order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from identification.selection.candidates import with_predicted_gain
from identification.selection.evidence import UNCOMPUTED, EvaluatedModel
from identification.selection.outcome import Searched
from identification.selection.policy import SelectionPolicy
from identification.selection.ranking import ranked
from identification.selection.score import Score
from identification.selection.trials import Trials

__all__ = [
    "State",
    "backward",
    "enrich",
    "exchange",
    "forward",
    "abandon_cost",
    "has_predicted_gain",
    "lacks_more",
    "rivals_of",
    "taken",
]


@dataclass
class State:
    """State of the selection.

    Args:
        trials: Cache of all fits and scores.
        current: Model to which the next effect is added.
        searched: Examined candidates, in order.
        predicted_gain: Predicted gain of the effect that was added last; zero before the first.
    """

    trials: Trials
    current: EvaluatedModel
    searched: list[Searched] = field(default_factory=list)
    predicted_gain: float = 0.0


def forward(state: State, round_: int) -> bool:
    """Add the best candidate that meets the acceptance criteria; return False if there is none."""
    trials, current = state.trials, state.current
    scores = trials.scores(current)
    wanted = with_predicted_gain(scores, trials.policy.candidates, _least(trials, current, scores))
    chosen = taken(state, wanted, round_)
    looked = {(s.candidate.term.name, s.candidate.final.variant) for s in wanted}
    for score in with_predicted_gain(scores, len(scores)):
        key = (score.candidate.term.name, score.candidate.final.variant)
        if key not in looked:
            state.searched.append(Searched(key[0], round_, score.gain, None, False, key[1]))
    for name in trials.uncomputed(current):
        state.searched.append(Searched(name, round_, np.nan, None, False, flaw=UNCOMPUTED))
    if chosen is None:
        return False
    state.current = chosen
    state.predicted_gain = next(s.predicted_gain for s in reversed(state.searched) if s.chosen)
    return True


def _least(trials: Trials, current: EvaluatedModel, scores: Sequence[Score]) -> float:
    """Predicted gain below which no candidate is refitted."""
    most = max((score.gain for score in scores), default=0.0)
    return max(trials.worth_a_refit(current), trials.policy.predicted_share * most)


def has_predicted_gain(state: State) -> bool:
    """Whether the predicted gain of any candidate justifies a refit."""
    scores = state.trials.scores(state.current)
    return bool(with_predicted_gain(scores, 1, _least(state.trials, state.current, scores)))


def taken(
    state: State, wanted: Sequence[Score], round_: int, abandon_cost: float = np.inf
) -> EvaluatedModel | None:
    """Refit candidates and return the best accepted model; None if none is accepted.

    Fits with a cost above `abandon_cost` are dropped.
    """
    trials, current = state.trials, state.current
    fits = trials.refits(current, wanted, abandon_cost)
    near = trials.near(current, fits)
    order = ranked(near, trials.policy)
    passing = [k for k in order if trials.criteria(near[k], current).passed]
    # Rank the passing models again, because ties are counted from the best model of the set.
    chosen = passing[ranked([near[k] for k in passing], trials.policy)[0]] if passing else None
    left_out = [s for s in wanted if all(s is not fitted for fitted, _ in fits)]
    if chosen is None and left_out:
        # Candidates with a far smaller predicted gain are refitted only if the best have failed.
        fits += trials.refits(current, left_out, abandon_cost)
        left_out = [s for s in wanted if all(s is not fitted for fitted, _ in fits)]
    far = [EvaluatedModel(fit, current.fraction) for _, fit in fits[len(near) :]]
    if chosen is None and far:
        # Fits far from the best are evaluated only if the near ones have failed.
        far = [trials.evaluate(one.fit, current.fraction) for one in far]
        passed = [trials.criteria(one, current).passed for one in far]
        chosen = len(near) + passed.index(True) if any(passed) else None
    evaluations = [*near, *far]
    for k in [*order, *range(len(near), len(fits))]:
        score, criteria = fits[k][0], trials.criteria(evaluations[k], current)
        term = score.candidate.final
        state.searched.append(
            Searched(term.name, round_, score.gain, criteria, k == chosen, term.variant)
        )
    for score in left_out:
        term = score.candidate.final
        state.searched.append(Searched(term.name, round_, score.gain, None, False, term.variant))
    return None if chosen is None else evaluations[chosen]


def lacks_more(state: State) -> bool:
    """Whether a candidate has a larger predicted gain than the effect that was added last had.

    Backward elimination and exchange are then postponed.
    """
    scores = state.trials.scores(state.current)
    return any(score.gain > state.predicted_gain for score in scores)


def enrich(state: State, round_: int) -> None:
    """Replace effects by extended variants of their laws, as long as the variants are accepted."""
    for found in state.current.fit.simulator.model.terms:
        left = list(found.richer)
        while left and not state.trials.over:
            term = left.pop(0)
            richer = state.trials.enriched(state.current, term)
            criteria = state.trials.criteria(richer, state.current)
            state.searched.append(
                Searched(term.name, round_, criteria.gain, criteria, criteria.refines, term.variant)
            )
            if criteria.refines:
                state.current, left = richer, list(term.richer)


def backward(state: State) -> None:
    """Remove effects that no longer meet the criteria; the last remaining effect is kept."""
    for term in state.current.fit.simulator.model.terms:
        if len(state.current.fit.simulator.model.terms) < 2 or state.trials.over:
            return
        simpler = state.trials.without(state.current, term)
        if not state.trials.criteria(state.current, simpler).passed:
            state.current = simpler


def exchange(state: State) -> None:
    """Replace effects by other types that meet the criteria and rank better."""
    for term in state.current.fit.simulator.model.terms:
        if state.trials.over:
            return
        simpler = state.trials.without(state.current, term)
        rivals = [
            rival
            for rival in rivals_of(state, simpler, term.name)
            if state.trials.criteria(rival, simpler).passed
        ]
        if rivals:
            models = [state.current, *rivals]
            state.current = models[ranked(models, state.trials.policy)[0]]


def rivals_of(state: State, simpler: EvaluatedModel, name: str) -> list[EvaluatedModel]:
    """Models with another effect type in place of `name` and a cost close to the current one."""
    trials, current = state.trials, state.current
    scores = [s for s in trials.scores(simpler) if s.candidate.term.name != name]
    abandon = abandon_cost(current, simpler, trials.policy)
    least = max(
        _least(trials, simpler, scores), (simpler.fit.cost - abandon) / trials.policy.underestimate
    )
    wanted = with_predicted_gain(scores, trials.policy.rivals, least)
    return trials.near(simpler, trials.refits(simpler, wanted, abandon))


def abandon_cost(
    current: EvaluatedModel, simpler: EvaluatedModel, policy: SelectionPolicy
) -> float:
    """Cost above which an extension of the simpler model is no rival of the current model."""
    gain = simpler.fit.cost - current.fit.cost
    return current.fit.cost + max(policy.abandon_slack, policy.rival_share * gain)
