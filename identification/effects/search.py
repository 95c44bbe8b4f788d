"""Finding the effects that the declared model lacks.

    forward    screen every prototype, refit the most promising kinds, take the best that passes
    backward   try to take each effect away again
    exchange   take each effect away and look whether another kind serves as well or better

until nothing passes.  Exchange is what guards against proxies: a wrong effect that was taken
first since it soaked up part of two right ones is replaced once the others are in.  Kinds that
serve as well are kept as alternatives with their probabilities.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.effects.catalogue import CATALOGUE
from identification.effects.effect import Candidate, survey_of
from identification.effects.evidence import LEAST_SIZE, Gates, Judged, judged, probabilities
from identification.effects.refit import refined, refitted_with, refitted_without
from identification.effects.screen import Score, screened
from identification.fit.campaign import Campaign
from identification.fit.noise import effective_shares
from identification.fit.solve import Fit, Patience

__all__ = ["Alternative", "Found", "Outcome", "Searched", "search"]

Array = NDArray[np.float64]

_REFITTED: Final = 7
_STEPS: Final = 20
_MOST_EFFECTS: Final = 4
_WORTH: Final = 2.0
_KEPT: Final = 0.005
_REACH: Final = 0.15
_NEAR: Final = 0.02
_SLACK: Final = 30.0
_UNDERSTATED: Final = 5.0


@dataclass(frozen=True)
class Alternative:
    """Another kind in the place of an effect.

    Args:
        name: The kind.
        probability: Posterior probability of the model with it.
    """

    name: str
    probability: float


@dataclass(frozen=True)
class Found:
    """An effect of the final model.

    Args:
        name: The kind.
        probability: Posterior probability against the alternatives in its place.
        gates: How it passed against the model without it.
        alternatives: Kinds that could stand in its place, most probable first.
    """

    name: str
    probability: float
    gates: Gates
    alternatives: tuple[Alternative, ...]


@dataclass(frozen=True)
class Searched:
    """One candidate that was looked at.

    Args:
        name: The kind.
        round: Number of the round, from 1.
        promised: Gain of the log likelihood that screening promised.
        gates: How it fared in the refit, None where it was not refitted.
        chosen: Whether it was taken in that round.
        detail: Which variant of the kind: the channel or the run it concerns.
    """

    name: str
    round: int
    promised: float
    gates: Gates | None
    chosen: bool
    detail: str = ""


@dataclass
class _State:
    campaign: Campaign
    current: Judged
    searched: list[Searched] = field(default_factory=list)
    tried: int = 1
    until: float = np.inf

    @property
    def over(self) -> bool:
        """Whether the time is up."""
        return time.monotonic() > self.until

    def patience(self, hopeless: float = np.inf) -> Patience:
        """What a refit may take."""
        return Patience(_STEPS, hopeless, self.until)


@dataclass(frozen=True)
class Outcome:
    """What the search found.

    Args:
        fit: Fit of the final model.
        effects: Its effects, strongest evidence first.
        searched: Everything that was looked at.
        complete: Whether it ended by itself and not because its time was up.
    """

    fit: Fit
    effects: tuple[Found, ...]
    searched: tuple[Searched, ...]
    complete: bool = True


def search(
    declared: Fit,
    campaign: Campaign,
    progress: Callable[[float], None] | None = None,
    seconds: float = np.inf,
) -> Outcome:
    """Search the catalogue for what the declared model lacks.

    Args:
        declared: Fit of the declared model.
        campaign: Records of training and of runs left out.
        progress: Told the fraction done.
        seconds: Time after which nothing new is begun; what passed until then stands [s].
    """
    tell = progress or (lambda fraction: None)
    state = _State(campaign, _judged(declared, campaign), until=time.monotonic() + seconds)
    for round_ in range(1, _MOST_EFFECTS + 1):
        tell((round_ - 1) / (_MOST_EFFECTS + 1))
        if state.over or not _forward(state, round_):
            break
        if round_ > 1:
            _backward(state)
            _exchange(state)
    tell(_MOST_EFFECTS / (_MOST_EFFECTS + 1))
    complete = not state.over
    effects = _explained(state)
    return Outcome(state.current.fit, tuple(effects), tuple(state.searched), complete)


def _judged(fit: Fit, campaign: Campaign) -> Judged:
    return judged(fit, campaign, float(np.min(effective_shares(fit))))


def _candidates(fit: Fit, without: Sequence[str] = ()) -> list[Candidate]:
    """Every structure of every kind that is not in the model yet."""
    survey = survey_of(fit)
    present = {term.name for term in fit.simulator.model.terms} | set(without)
    return [
        candidate
        for name, kind in CATALOGUE.items()
        if name not in present
        for candidate in kind.candidates(survey)
    ]


def _variant(candidate: Candidate) -> str:
    term = candidate.term
    run = getattr(term, "run", None)
    channel = getattr(term, "channel", "") if term.name == "channel_delay" else ""
    return f"run {run + 1}" if run is not None else str(channel)


def _promising(scores: Sequence[Score], count: int) -> list[Score]:
    """The best prototypes of the most promising kinds, one a variant."""
    best: dict[tuple[str, str], Score] = {}
    for score in scores:
        best.setdefault((score.candidate.term.name, _variant(score.candidate)), score)
    kinds: dict[str, int] = {}
    kept = []
    for score in best.values():
        name = score.candidate.term.name
        kinds[name] = kinds.get(name, 0) + 1
        if kinds[name] <= 2 and score.gain > _WORTH:
            kept.append(score)
    return kept[:count]


def _forward(state: _State, round_: int) -> bool:
    """Add the best effect that passes; False where none does."""
    current = state.current
    candidates = _candidates(current.fit)
    scores = screened(current.fit, candidates)
    state.tried = sum(max(c.starts.shape[1] // c.joint, 1) for c in candidates)
    needed = _worth_a_refit(current, state.tried)
    promising = [s for s in _promising(scores, _REFITTED) if current.share * s.gain > needed]
    trials = list(zip(promising, _refitted(state, promising), strict=True))
    trials.sort(key=lambda trial: trial[1].cost)
    # Only those in reach of the leader are worth the finer steps that a nonlinear term needs.
    reach = trials[0][1].cost + _REACH * (current.fit.cost - trials[0][1].cost) if trials else 0.0
    near = [(s, refined(f, state.patience())) for s, f in trials if f.cost <= reach]
    near.sort(key=lambda trial: trial[1].cost)
    outcomes = [(s, _judged(f, state.campaign)) for s, f in near]
    outcomes += [(s, judged(f, state.campaign, current.share)) for s, f in trials[len(near) :]]
    chosen: Judged | None = None
    for score, outcome in outcomes:
        gates = outcome.gates(current, state.tried)
        take = chosen is None and gates.passed
        if take:
            chosen = outcome
        state.searched.append(
            Searched(
                score.candidate.term.name,
                round_,
                score.gain,
                gates,
                take,
                _variant(score.candidate),
            )
        )
    looked = {(s.candidate.term.name, _variant(s.candidate)) for s, _ in outcomes}
    for score in _promising(scores, len(scores)):
        key = (score.candidate.term.name, _variant(score.candidate))
        if key not in looked:
            state.searched.append(Searched(key[0], round_, score.gain, None, False, key[1]))
    if chosen is None:
        return False
    state.current = chosen
    return True


def _worth_a_refit(current: Judged, tried: int) -> float:
    """Promised gain below which an effect would fail the gates even if it were five times larger.

    Screening is exact for small effects and understates large ones, whose prototypes have another
    shape parameter than the motor; five is more than any has been seen to be understated by.
    """
    counts = current.fit.weighting.counts
    chance = np.log(max(tried, 1)) + 0.5 * np.log(max(counts.sum() * current.share, 2.0))
    size = LEAST_SIZE * float(counts.max()) * current.share
    return float(max(chance / 2, size / _UNDERSTATED))


def _refitted(state: _State, scores: Sequence[Score]) -> list[Fit]:
    """Refits of prototypes; those that fall far behind the best so far are cut short."""
    fit = state.current.fit
    fits: list[Fit] = []
    best = fit.cost
    for score in scores:
        slack = max(_SLACK, _REACH * (fit.cost - best))
        patience = state.patience(best + slack)
        fits.append(refitted_with(fit, score.candidate.final, score.start, patience))
        best = min(best, fits[-1].cost)
    return fits


def _backward(state: _State) -> None:
    """Take effects away that do not pass any more beside the others."""
    for term in state.current.fit.simulator.model.terms:
        if len(state.current.fit.simulator.model.terms) < 2 or state.over:
            return
        simpler = _judged(
            refitted_without(state.current.fit, term.name, state.patience()), state.campaign
        )
        if not state.current.gates(simpler, state.tried).passed:
            state.current = simpler


def _exchange(state: _State) -> None:
    """Replace effects for which another kind serves better beside the others."""
    for term in state.current.fit.simulator.model.terms:
        if state.over:
            return
        rivals = _rivals(state, term.name, 3)
        if not rivals:
            continue
        best = min(rivals, key=lambda rival: rival.score())
        finer = _judged(refined(best.fit, state.patience()), state.campaign)
        if finer.score() < state.current.score():
            state.current = finer


def _rivals(state: _State, name: str, count: int) -> list[Judged]:
    """Models in which another kind stands in the place of an effect."""
    current = state.current
    simpler = refitted_without(current.fit, name, state.patience())
    scores = screened(simpler, _candidates(simpler, without=(name,)))
    hopeless = current.fit.cost + max(_SLACK, _NEAR * (simpler.cost - current.fit.cost))
    fits = [
        refitted_with(simpler, score.candidate.final, score.start, state.patience(hopeless))
        for score in _promising(scores, count)
    ]
    return [judged(fit, state.campaign, current.share) for fit in fits if fit.cost <= hopeless]


def _explained(state: _State) -> list[Found]:
    """The effects of the final model, each with what could stand in its place."""
    current = state.current
    effects = []
    for term in current.fit.simulator.model.terms:
        simpler = judged(refitted_without(current.fit, term.name), state.campaign, current.share)
        gates = current.gates(simpler, state.tried)
        looked = [] if state.over else _rivals(state, term.name, 4)
        rivals = [r for r in looked if r.gates(simpler, state.tried).passed]
        odds = probabilities([current.score(), *(r.score() for r in rivals)])
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
    return sorted(effects, key=lambda effect: -effect.gates.gain)
