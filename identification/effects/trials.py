"""Everything a search has fitted and screened so far, each model once.

A search comes back to the same model by several ways: as the best of a round, as what is left when
an effect is taken away again, as a rival in the place of another.  `Trials` remembers what became
of it, so that looking again costs nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from identification.effects.catalogue import CATALOGUE
from identification.effects.effect import Candidate, survey_of
from identification.effects.evidence import LEAST_SIZE, Judged, judged
from identification.effects.omitted import OmittedTerm, omitted_terms
from identification.effects.refit import (
    as_declared,
    refined,
    refitted_as,
    refitted_with,
    refitted_without,
)
from identification.effects.score import Score, gathered
from identification.effects.screen import screened
from identification.effects.start import Start, traded
from identification.effects.tracing import missing_curves
from identification.effects.unlisted import LAWS
from identification.fit.campaign import Campaign
from identification.fit.declared import replanned
from identification.fit.noise import effective_share
from identification.fit.solve import Fit, Patience, solve
from identification.model.term import AbstractTerm
from identification.work import Budget, operations

__all__ = ["UNDERSTATED", "Trials", "promising"]

Key = frozenset[tuple[str, str]]

_STEPS: Final = 20
_LEGS: Final = 4
_WORTH: Final = 2.0
_SLACK: Final = 30.0
_REACH: Final = 0.15
UNDERSTATED: Final = 5.0
"""Gain of a refit over what screening promised, at most."""
_COMMON: Final = 4.0
_FINISH: Final = 2.5
"""Operations to finish a model of a round, over those of a first refit."""
_PART: Final = 0.2
"""Share of the gain of the best kind that makes another one worth to go on from."""


@dataclass
class Trials:
    """Models of one campaign.

    Args:
        campaign: Records of training and of runs left out.
        budget: Operations after which nothing new is begun.
        longest: Operations after which a first refit is given up; the best are finished later.
        tried: Number of prototypes that were scored in one round.
        withheld: Kinds of the catalogue that are not candidates.
    """

    campaign: Campaign
    budget: Budget = field(default_factory=Budget)
    longest: float = np.inf
    tried: int = 1
    withheld: Collection[str] = ()
    _judged: dict[Key, Judged] = field(default_factory=dict)
    _fits: dict[Key, Fit] = field(default_factory=dict)
    _scores: dict[Key, list[Score]] = field(default_factory=dict)
    _curves: dict[Key, list[Score]] = field(default_factory=dict)
    _uncomputed: dict[Key, list[str]] = field(default_factory=dict)
    _unfinished: set[Key] = field(default_factory=set)
    _led: set[tuple[Key, Key]] = field(default_factory=set)

    @property
    def over(self) -> bool:
        """Whether the budget is spent."""
        return self.budget.spent

    def patience(
        self, hopeless: float = np.inf, longest: float = np.inf, reference: float = np.inf
    ) -> Patience:
        """What a refit may take.

        Args:
            hopeless: Cost of a rival; the fit stops where it is not going to come near it.
            longest: Operations after which it is given up.
            reference: Cost of a better model that it is compared with.
        """
        return Patience(_STEPS, hopeless, Budget(longest, within=self.budget), reference)

    def judge(self, fit: Fit, share: float | None = None) -> Judged:
        """The fit with its errors on the runs left out; the first of a model is kept.

        Args:
            fit: The fit.
            share: Effective share of the samples; from its own residual where none is given.
        """
        key = _key(fit)
        known = self._judged.get(key)
        if known is None and not np.isfinite(fit.cost):
            # It runs away: whatever mends that is needed, and it is never chosen itself.
            known = self._judged[key] = Judged(fit.light(), 1.0)
        elif known is None or fit.cost < known.fit.cost - 1e-3:
            share = effective_share(fit) if share is None else share
            known = self._judged[key] = judged(fit.light(), self.campaign, share)
        return known

    def without(self, current: Judged, term: AbstractTerm) -> Judged:
        """The model without one of its terms.

        One that is known but had not come to its optimum is fitted again from here: what was added
        to it may have done nothing but lead it on.
        """
        key = _key(current.fit) - {_name(term)}
        known = self._judged.get(key)
        if known is None or not (known.fit.converged or (key, _key(current.fit)) in self._led):
            self._led.add((key, _key(current.fit)))
            patience = self.patience(reference=current.fit.cost)
            fit = refitted_without(current.fit, term.name, patience)
            if not np.isfinite(fit.cost):
                # What the term held back runs away; the declared model did not.
                declared = self._judged[frozenset()].fit
                place = as_declared(current.fit, declared)
                fit = refitted_without(place, term.name, patience)
            known = self.judge(refined(fit, patience) if np.isfinite(fit.cost) else fit)
        return known

    def enriched(self, current: Judged, term: AbstractTerm) -> Judged:
        """The model with one of its terms in this richer form."""
        kept = {name for name in _key(current.fit) if name[0] != term.name}
        known = self._judged.get(frozenset(kept | {_name(term)}))
        if known is None:
            fit, hopeless = current.fit, current.fit.cost + _SLACK
            (before,) = [own for own in fit.simulator.model.terms if own.name == term.name]
            for form in (*term.leads(before), term):
                led = refitted_as(fit, form, self.patience(hopeless, self.longest))
                if led.cost > fit.cost and fit is not current.fit:
                    break
                fit = led
            fit = self._finished(fit) if fit.cost < hopeless else fit
            known = self.judge(fit, current.share)
        return known

    def known_beside(self, simpler: Judged, term: AbstractTerm) -> list[Judged]:
        """What was judged of models with another kind in the place of a term."""
        key = _key(simpler.fit)
        return [
            one
            for known, one in self._judged.items()
            if known > key
            and len(known) == len(key) + 1
            and next(iter(known - key))[0] != term.name
        ]

    def scores(self, current: Judged) -> list[Score]:
        """Scores of every prototype of every kind that is not in the model, best first."""
        key = _key(current.fit)
        known = self._scores.get(key)
        if not np.isfinite(current.fit.cost):
            return []
        if known is None:
            candidates = _candidates(current.fit, self.withheld)
            found = screened(current.fit, candidates)
            scored = {score.candidate.term.name for score in found}
            names = dict.fromkeys(candidate.term.name for candidate in candidates)
            self._uncomputed[key] = [name for name in names if name not in scored]
            known = self._scores[key] = _single(found)
            self.tried = max(self.tried, sum(candidate.prototypes for candidate in candidates))
        return known

    def uncomputed(self, current: Judged) -> list[str]:
        """Kinds of which no prototype has a finite score beside a model that was screened."""
        return self._uncomputed.get(_key(current.fit), [])

    def curves(self, current: Judged) -> list[Score]:
        """Scores of curves and ripples that belong to no kind, best first."""
        key = _key(current.fit)
        known = self._curves.get(key)
        if known is None:
            known = self._curves[key] = missing_curves(current.fit)
        return known

    def omitted(self, current: Judged) -> tuple[OmittedTerm, ...]:
        """What a model leaves out and is no chance, the kinds and the curves."""
        scores = [*self.scores(current), *self.curves(current)]
        return omitted_terms(current.fit, current.share, scores, self.tried)

    def refits(
        self, current: Judged, scores: Sequence[Score], hopeless: float = np.inf
    ) -> list[tuple[Score, Fit]]:
        """Refits of prototypes, best first; those far behind the best are cut short.

        A prototype is left out where even several times its promise would not come in reach of
        what the best of them gained, or of the cost that has to be reached.

        Args:
            current: The model that is added to.
            scores: Prototypes.
            hopeless: Cost that has to be reached.
        """
        found = []
        best = current.fit.cost
        for score in scores:
            key = _key(current.fit) | {_name(score.candidate.final)}
            fit = self._fits.get(key)
            needed = current.fit.cost - min(hopeless, current.fit.cost)
            needed = max(needed, (1.0 - _REACH) * (current.fit.cost - best))
            if fit is None and UNDERSTATED * score.gain < needed:
                continue
            if fit is None:
                slack = max(_SLACK, _REACH * (current.fit.cost - best))
                patience = self.patience(min(best + slack, hopeless), self.longest)
                starts = list(score.starts)
                if score.candidate.tried is not None:
                    starts += [Start(place) for place in score.candidate.tried.T]
                starts += traded(current.fit, score.candidate)
                fit = refitted_with(current.fit, score.candidate.final, starts, patience)
                fit = self._fits[key] = fit.light()
            best = min(best, fit.cost)
            if fit.cost <= hopeless:
                found.append((score, fit))
        return sorted(found, key=lambda trial: trial[1].cost)

    def runners(self) -> list[Judged]:
        """Models with one kind beside the declared ones, that gain a part of what the best does."""
        bare = self._judged[frozenset()].fit.cost
        alone = sorted((f.cost, key) for key, f in self._fits.items() if len(key) == 1)
        gains = {key: bare - cost for cost, key in alone if next(iter(key))[0] != "unlisted"}
        most = max(gains.values(), default=0.0)
        far = [key for key, gain in gains.items() if gain > _PART * most][1:]
        return [self.judge(self._finished(self._fits[key])) for key in far]

    def near(self, current: Judged, trials: Sequence[tuple[Score, Fit]]) -> list[Judged]:
        """The refits in reach of the best, on intervals as fine as they need, in their order."""
        if not trials:
            return []
        reach = trials[0][1].cost + _REACH * (current.fit.cost - trials[0][1].cost)
        finer: list[Judged] = []
        for score, fit in trials:
            if fit.cost > reach:
                break
            key = _key(current.fit) | {_name(score.candidate.final)}
            best = min((one.fit.cost for one in finer), default=np.inf)
            began = operations()
            share = min((one.share for one in finer), default=1.0)
            patience = self.patience(best + _SLACK / share, self.longest_finish, best)
            finished = self._finished(fit, patience)
            if finished.is_behind(patience) or operations() - began > self.longest_finish:
                self._unfinished.add(key)
            # Judged while its derivatives are in memory.
            finer.append(self.judge(finished))
            self._fits[key] = finished.light()
        return finer

    @property
    def longest_finish(self) -> float:
        """Operations after which a model that may get further terms is not made more accurate."""
        return _FINISH * self.longest

    def final(self, current: Judged) -> Fit:
        """The fit of the final model, finished where its budget had ended before it was."""
        fit = current.fit
        return (
            refined(fit, Patience(_STEPS, budget=Budget()))
            if _key(fit) in self._unfinished
            else fit
        )

    def _finished(self, fit: Fit, patience: Patience | None = None) -> Fit:
        """The fit at its optimum, on intervals as fine as it needs.

        A base that has not converged would make everything that is added to it look good.

        Args:
            fit: The fit.
            patience: When it is left as it is.
        """
        patience = patience or self.patience()
        return self._converged(refined(self._converged(fit, patience), patience), patience)

    def _converged(self, fit: Fit, patience: Patience) -> Fit:
        """The fit taken on until it converges, or hardly gets better."""
        for _ in range(_LEGS):
            if fit.converged or patience.over or fit.is_behind(patience):
                break
            before = fit.cost
            fit = replanned(
                solve(
                    fit.simulator,
                    fit.coordinates,
                    fit.position,
                    fit.states,
                    fit.weighting,
                    patience,
                ),
                patience,
            )
            if before - fit.cost < 1.0:
                break
        return fit

    def worth_a_refit(
        self, current: Judged, understated: float = UNDERSTATED, amplitudes: int = 1
    ) -> float:
        """Promised gain below which an effect would fail even if it were several times larger.

        Screening is exact for small effects and understates large ones, whose prototypes have
        another shape parameter than the motor; five is more than any has been seen to be
        understated by.

        Args:
            current: The model that is added to.
            understated: How many times larger the gain may be than what is promised.
            amplitudes: Numbers that are fitted.
        """
        counts = current.fit.weighting.counts
        each = 0.5 * np.log(max(counts.sum() * current.share, 2.0))
        chance = np.log(max(self.tried, 1)) + amplitudes * each
        size = LEAST_SIZE * float(counts.max()) * current.share
        return float(max(chance / 2, size / understated)) / current.share


def promising(scores: Sequence[Score], count: int, least: float = _WORTH) -> list[Score]:
    """The best prototypes of the most promising kinds, one a variant and two a kind.

    Args:
        scores: Best first.
        count: Most that are taken.
        least: Gain that has to be promised.
    """
    kinds: dict[str, int] = {}
    kept = []
    for score in gathered(scores):
        name = score.candidate.term.name
        kinds[name] = kinds.get(name, 0) + 1
        if kinds[name] <= 2 and score.gain > least:
            kept.append(score)
    return kept[:count]


def _name(term: AbstractTerm) -> tuple[str, str]:
    return term.name, term.variant


def _key(fit: Fit) -> Key:
    return frozenset(_name(term) for term in fit.simulator.model.terms)


def _candidates(fit: Fit, withheld: Collection[str]) -> list[Candidate]:
    """Every structure of every kind that is not in the model yet."""
    survey = survey_of(fit)
    absent = {term.name for term in fit.simulator.model.terms} | set(withheld)
    return [
        candidate
        for kind in (*CATALOGUE.values(), *LAWS)
        if kind.name not in absent
        for candidate in kind.candidates(survey)
    ]


def _single(scores: Sequence[Score]) -> list[Score]:
    """The scores without effects of some runs that the other runs ask for as well.

    An event in a run promises much there and nothing elsewhere.  What else is wrong with the model
    promises about as much in every run, so the other runs are the control: a run has to promise
    four times what they do in the middle.
    """
    promised: dict[str, dict[int, float]] = {}
    for score in scores:
        concerned = _runs_of(score)
        if len(concerned) == 1:
            runs = promised.setdefault(score.candidate.term.name, {})
            runs[concerned[0]] = max(runs.get(concerned[0], 0.0), score.gain)
    kept = []
    for score in scores:
        concerned = _runs_of(score)
        runs = promised.get(score.candidate.term.name, {}) if concerned else {}
        control = [gain for run, gain in runs.items() if run not in concerned]
        each = score.gain / max(len(concerned), 1)
        if not control or each >= _COMMON * float(np.median(control)):
            kept.append(score)
    return kept


def _runs_of(score: Score) -> tuple[int, ...]:
    """Numbers of the runs that a prototype belongs to; empty where it belongs to all."""
    run = getattr(score.candidate.term, "run", None)
    return () if run is None else (run, *getattr(score.candidate.term, "others", ()))
