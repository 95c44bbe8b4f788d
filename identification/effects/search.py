"""Finding the effects that the declared model lacks.

    forward    screen every prototype, refit the most promising kinds, take the best that passes
    backward   try to take each effect away again
    exchange   take each effect away and look whether another kind serves as well or better

until nothing passes.  Exchange is what guards against proxies: a wrong effect that was taken
first since it soaked up part of two right ones is replaced once the others are in.  Kinds that
serve as well are kept as alternatives with their probabilities.

What is left then is looked at once more, with curves that belong to no kind: where one of them
passes the same gates, nothing in the catalogue explains the motor, and the kinds that had been
taken in its place have to pass again beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Final

import numpy as np

from identification.effects.evidence import Judged, probabilities, scores_of
from identification.effects.outcome import Alternative, Found, Outcome
from identification.effects.ranking import is_better, is_strained, ranked, replaces
from identification.effects.refit import with_known_amplitudes
from identification.effects.rounds import (
    State,
    backward,
    enrich,
    exchange,
    forward,
    hopeless_for,
    is_promised,
    lacks_more,
    rivals_of,
    taken,
)
from identification.effects.score import Score
from identification.effects.tracing import traced
from identification.effects.trials import Trials
from identification.fit.campaign import Campaign
from identification.fit.solve import Fit
from identification.work import Budget, operations

__all__ = ["search"]

_CURVES: Final = 4
_RUNNERS: Final = 2
_CURVE_UNDERSTATED: Final = 2.0
_FAR_MORE: Final = 3.0
_MOST_OF_IT: Final = 0.5
_LISTED_SHARE: Final = 0.75
_REFIT_SHARE: Final = 0.06
"""Shares of the budget for the catalogue and for one refit."""
_MOST_EFFECTS: Final = 6
_KEPT: Final = 0.005


def search(
    declared: Fit,
    campaign: Campaign,
    progress: Callable[[float], None] | None = None,
    work: float = np.inf,
    begin: Fit | None = None,
    withheld: Collection[str] = (),
    *,
    is_part: bool = False,
) -> Outcome:
    """Search the catalogue for what the declared model lacks.

    Args:
        declared: Fit of the declared model.
        campaign: Records of training and of runs left out.
        progress: Called with the fraction done.
        work: Operations after which nothing new is begun; what passed until then stands.
        begin: Fit of the model that the search goes on from; the nominal one where None.
        withheld: Kinds of the catalogue that are not candidates.
        is_part: Whether the model will be fitted to more samples, so that it need not be made
            more accurate here.
    """
    tell = progress or (lambda fraction: None)
    trials = Trials(campaign, Budget(work), longest=_REFIT_SHARE * work, withheld=withheld)
    listed = Budget(_LISTED_SHARE * work)
    first = trials.judge(declared)
    state = State(trials, first if begin is None else trials.judge(begin))
    alone: Judged | None = None
    is_exhausted = is_cut_short = is_postponed = False
    for round_ in range(1, _MOST_EFFECTS + 1):
        tell((round_ - 1) / (_MOST_EFFECTS + 2))
        if listed.spent:
            is_cut_short = is_promised(state)
            is_exhausted = not is_cut_short
            break
        if not forward(state, round_):
            is_exhausted = True
            break
        enrich(state, round_)
        if alone is None and _asks_for_a_curve(state, round_):
            began = operations()
            alone = _curve_alone(state, first)
            # A curve is no kind of the catalogue, whose rounds keep what is theirs.
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
    tell(_MOST_EFFECTS / (_MOST_EFFECTS + 2))
    if is_exhausted and not listed.spent:
        _second_thoughts(state)
    _unlisted(state, first, alone, is_exhausted)
    complete = not (trials.over or is_cut_short)
    tell((_MOST_EFFECTS + 1) / (_MOST_EFFECTS + 2))
    effects = _settled(state)
    traces = traced(trials.curves(first)) if effects else ()
    last = state.current.fit if is_part else trials.final(state.current)
    fit = with_known_amplitudes(last)
    return Outcome(
        fit, tuple(effects), tuple(state.searched), complete, traces, trials.omitted(state.current)
    )


def _second_thoughts(state: State) -> None:
    """Go on from kinds that came next in the first round, where the best leaves something.

    One kind may bend its shape so far that it stands for two: beside a Stribeck friction that does
    for a dry one as well, the dry one promises nothing any more, and the other way round it does.
    """
    if not state.current.fit.simulator.model.terms:
        return
    if not (_is_left(state) or is_strained(state.current.fit)):
        return
    for runner in state.trials.runners()[:_RUNNERS]:
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
    """Curves that promise something beside what the model has; they have no shape to find."""
    trials, current = state.trials, state.current
    return [
        score
        for score in trials.curves(current)
        if score.gain
        > trials.worth_a_refit(current, _CURVE_UNDERSTATED, _amplitudes(current, score))
    ]


def _amplitudes(current: Judged, score: Score) -> int:
    """Numbers that a curve has, those that each record has for itself counted for each."""
    records = len(current.fit.states) if score.candidate.by_record else 1
    return score.candidate.joint * records


def _asks_for_a_curve(state: State, round_: int) -> bool:
    """Whether a curve by itself may do better than the kinds that were taken in so many rounds.

    Where the catalogue promises most of what curves do, the next kind is refitted first, which is
    cheaper.  After the first round curves have to promise more beside the kind than it promised
    itself.
    """
    left = max((score.gain for score in state.trials.curves(state.current)), default=0.0)
    listed = max((score.gain for score in state.trials.scores(state.current)), default=0.0)
    if listed >= _MOST_OF_IT * left:
        return False
    if round_ > 1:
        return bool(_is_left(state))
    return left > max(one.promised for one in state.searched if one.chosen)


def _curve_alone(state: State, declared: Judged) -> Judged | None:
    """The best curve beside the declared model alone, where the effects found leave something.

    Stand-ins pile up where nothing in the catalogue is what is missing; one curve that does better
    than two of them ends that.
    """
    if state.trials.over or not (_is_left(state) or is_strained(state.current.fit)):
        return None
    curves = state.trials.curves(declared)[:_CURVES]
    needed = hopeless_for(state.current, declared)
    return taken(State(state.trials, declared), curves, 1, needed)


def _ends(state: State, round_: int, alone: Judged, declared: Judged) -> bool:
    """Whether a curve does so much better than what was found that more kinds would not help."""
    if round_ > 1:
        return replaces(alone, state.current)
    is_far = _is_far_better(alone, state.current, declared)
    return is_far and not _closes_the_gap(state, alone)


def _is_far_better(alone: Judged, listed: Judged, declared: Judged) -> bool:
    """Whether a curve gains several times what the best kind does.

    Then nothing in the catalogue is what is missing, and more rounds would pile up stand-ins.
    """
    gains = [declared.fit.cost - one.fit.cost for one in (alone, listed)]
    return is_better(alone, listed) and gains[0] > _FAR_MORE * gains[1]


def _closes_the_gap(state: State, alone: Judged) -> bool:
    """Whether another kind beside the one found promises most of what a curve does better.

    Two effects that are both in the catalogue may be imitated by one curve in two signals.
    """
    gap = state.current.fit.cost - alone.fit.cost
    promised = max((score.gain for score in state.trials.scores(state.current)), default=0.0)
    return promised > _MOST_OF_IT * gap


def _unlisted(state: State, declared: Judged, alone: Judged | None, is_exhausted: bool) -> None:
    """Put a curve in the place of the effects of the catalogue, or beside them, where one passes.

    Where something is left beside the effects that were found, or one of them is strained, they
    may all be stand-ins: a curve by itself is tried first.  One beside them is tried only where the
    catalogue is exhausted; after it they have to pass again, and so has the curve against the kinds
    that were not taken.  A model that began with a curve gets no second one.
    """
    trials, listed = state.trials, state.current
    left = [] if trials.over else _is_left(state)
    strained = not trials.over and is_strained(listed.fit)
    if (left or strained) and alone is None and listed is not declared:
        alone = _curve_alone(state, declared)
    if alone is not None and replaces(alone, listed):
        state.current = alone
        return
    has_curve = any(term.name == "unlisted" for term in listed.fit.simulator.model.terms)
    if left and is_exhausted and not has_curve:
        round_ = 1 + max((s.round for s in state.searched), default=0)
        chosen = taken(state, left[:_CURVES], round_)
        if chosen is not None:
            state.current = chosen
            backward(state)
            exchange(state)


def _settled(state: State) -> list[Found]:
    """The effects of the final model, after exchanges that need no further fit.

    A search that was cut short, or that changed its model last, may end with an effect in whose
    place another kind that was judged before does better.
    """
    effects, better = _explained(state)
    for _ in range(_MOST_EFFECTS):
        if better is None:
            break
        state.current = better
        effects, better = _explained(state)
    return effects


def _explained(state: State) -> tuple[list[Found], Judged | None]:
    """The effects of a model, each with what could stand in its place, and a better model."""
    current, trials = state.current, state.trials
    effects, better = [], None
    for term in current.fit.simulator.model.terms:
        simpler = trials.without(current, term)
        gates = current.gates(simpler, trials.tried)
        looked = trials.known_beside(simpler, term)
        if not trials.over and term.name != "unlisted":
            curves = [one for one in looked if one.fit.simulator.model.terms[-1].name == "unlisted"]
            looked = [*rivals_of(state, simpler, term.name), *curves]
        rivals = [r for r in looked if r.gates(simpler, trials.tried).passed]
        models = [current, *rivals]
        odds = probabilities(scores_of(models))
        best = models[ranked(models)[0]]
        better = best if best is not current else better
        others: dict[str, float] = {}
        for rival, probability in zip(rivals, odds[1:], strict=True):
            added = rival.fit.simulator.model.terms[-1].name
            others[added] = others.get(added, 0.0) + float(probability)
        alternatives = tuple(
            Alternative(other, probability)
            for other, probability in sorted(others.items(), key=lambda item: -item[1])
            if probability > _KEPT
        )
        effects.append(Found(term.name, float(odds[0]), gates, alternatives))
    return sorted(effects, key=lambda effect: -effect.gates.gain), better
