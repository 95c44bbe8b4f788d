"""Cache of the fits, scores and evaluations of one search.

The search reaches the same model in several ways: as the best of a round, after the removal of an
effect, or as a rival in an exchange.  `Trials` stores the results, so that repeated requests cost
nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identification.effects.effect import AbstractEffect
from identification.fit.campaign import Campaign
from identification.fit.effective_samples import effective_fraction
from identification.fit.order_tracking import is_tracked
from identification.fit.solve import Fit, TerminationLimits, continued, renewed
from identification.fit.tracked_fit import retracked
from identification.model.term import AbstractTerm
from identification.selection.candidates import candidates_of, without_shared
from identification.selection.criteria import AcceptanceCriteria, by_chance
from identification.selection.evidence import EvaluatedModel, evaluated
from identification.selection.omitted import OmittedTerm, omitted_terms
from identification.selection.policy import DEFAULT, SelectionPolicy
from identification.selection.refit import (
    fitted_candidate,
    refined,
    refitted_as,
    refitted_from_parts,
    refitted_without,
)
from identification.selection.score import Key, Score, key_of, structure_of, with_fitted_hold
from identification.selection.screen import screened
from identification.selection.start import Start
from identification.selection.tracing import missing_curves
from identification.work import Budget, operations

__all__ = ["Trials"]


@dataclass
class Trials:
    """Cache of the models of one campaign."""

    campaign: Campaign
    """Training and validation records."""
    budget: Budget = field(default_factory=Budget)
    """Operation budget; no new fit starts after it is spent."""
    longest: float = np.inf
    """Operations after which a first refit stops; the best fits are finished later."""
    tried: int = 1
    """Largest number of prototypes that were scored together, for the significance limit."""
    withheld: Collection[str] = ()
    """Names of effect types that are not candidates."""
    policy: SelectionPolicy = DEFAULT
    _evaluated: dict[Key, EvaluatedModel] = field(default_factory=dict)
    _fits: dict[Key, Fit] = field(default_factory=dict)
    _scores: dict[Key, list[Score]] = field(default_factory=dict)
    _curves: dict[Key, list[Score]] = field(default_factory=dict)
    _uncomputed: dict[Key, list[str]] = field(default_factory=dict)
    _unfinished: set[Key] = field(default_factory=set)
    _retried: set[tuple[Key, Key]] = field(default_factory=set)

    def limits(
        self, abandon_cost: float = np.inf, longest: float = np.inf, reference: float = np.inf
    ) -> TerminationLimits:
        """Termination limits of a fit, which stops after `longest` operations.

        A fit is abandoned once it is predicted to stay above `abandon_cost`; it is compared with a
        better model of the cost `reference`.
        """
        budget = Budget(longest, within=self.budget)
        return TerminationLimits(self.policy.steps, abandon_cost, budget, reference)

    def criteria(self, model: EvaluatedModel, simpler: EvaluatedModel) -> AcceptanceCriteria:
        """Acceptance criteria of a model against a simpler one."""
        return model.criteria(simpler, self.tried, self.policy)

    def evaluate(self, fit: Fit, fraction: float | None = None) -> EvaluatedModel:
        """Evaluate a fit on the validation runs; one result per model structure is cached.

        A later fit replaces the cached one if its cost is lower by more than 0.001, and its scores
        if by more than a tie.  The effective sample fraction [-] is computed from the residual of
        the fit if None.
        """
        key = key_of(fit)
        known = self._evaluated.get(key)
        if known is None and not np.isfinite(fit.cost):
            # The simulation diverges; it is never selected, and a term that stabilises it is kept.
            known = self._evaluated[key] = EvaluatedModel(fit.light(), 1.0)
        elif known is None or fit.cost < known.fit.cost - 1e-3:
            fraction = effective_fraction(fit) if fraction is None else fraction
            if known is not None and fit.cost < known.fit.cost - self.policy.tie:
                self._scores.pop(key, None)
                self._curves.pop(key, None)
            known = self._evaluated[key] = evaluated(fit.light(), self.campaign, fraction)
            if key in self._fits and known.fit.cost < self._fits[key].cost:
                self._fits[key] = known.fit
        return known

    def is_due(
        self, model: EvaluatedModel, start: EvaluatedModel, removed: AbstractTerm | None = None
    ) -> bool:
        """True, once, if a fit is to be repeated from the optimum of another model.

        It has not converged, or it costs more than that optimum with a term removed.
        """
        keys = key_of(model.fit), key_of(start.fit)
        if keys in self._retried:
            return False
        self._retried.add(keys)
        if removed is None or not model.fit.converged:
            return not model.fit.converged
        begin = refitted_without(start.fit, removed.name, TerminationLimits(0))
        return begin.cost < model.fit.cost - self.policy.tie

    def without(self, current: EvaluatedModel, term: AbstractTerm) -> EvaluatedModel:
        """Model without one of its terms.

        A cached fit that is due is repeated from the current optimum: the removed term may only
        have helped the optimiser.  A fit that decides nothing is repeated from the nominal
        parameters, which have absorbed nothing of the other terms.
        """
        key = frozenset(name for name in key_of(current.fit) if name[0] != term.name)
        known = self._evaluated.get(key)
        if known is None or self.is_due(known, current, term):
            self._retried.add((key, key_of(current.fit)))
            limits = self.limits(reference=current.fit.cost)
            if limits.over:
                # The effect would be judged by the budget and not by the runs.
                limits = replace(limits, budget=Budget(self.longest))
            fit = refitted_without(current.fit, term.name, limits)
            if current.is_undecided(fit):
                limits = replace(limits, budget=Budget(self.longest))
                fit = continued(fit, limits)
            if current.is_undecided(fit) or not np.isfinite(fit.cost):
                nominal = current.fit.moved_to(self._evaluated[frozenset()].fit.by_name)
                limits = replace(limits, budget=Budget(self.longest))
                other = self._converged(refitted_without(nominal, term.name, limits), limits)
                fit = min(fit, other, key=lambda one: one.cost)
            parts = [m.fit for own, m in self._evaluated.items() if own < key]
            fit = refitted_from_parts(fit, parts, limits)
            fit = refined(fit, limits, self.policy) if np.isfinite(fit.cost) else fit
            known = self.evaluate(fit)
        return known

    def enriched(self, current: EvaluatedModel, term: AbstractEffect) -> EvaluatedModel:
        """Model with a term replaced by an extended variant or another law."""
        kept = {name for name in key_of(current.fit) if name[0] != term.name}
        known = self._evaluated.get(frozenset(kept | {structure_of(term)}))
        if known is None:
            abandon_cost = current.fit.cost + self.policy.abandon_slack
            fit = refitted_as(current.fit, term, self.limits(abandon_cost, self.longest))
            fit = self.finished(fit) if fit.cost < abandon_cost else fit
            known = self.evaluate(fit, current.fraction)
        return known

    def evaluated_rivals(self, simpler: EvaluatedModel, name: str) -> list[EvaluatedModel]:
        """Evaluated models that add one term of another type than `name` to the simpler model."""
        key = key_of(simpler.fit)
        return [
            model
            for known, model in self._evaluated.items()
            if known > key and len(known - key) == 1 and next(iter(known - key))[0] != name
        ]

    def doubtful(self, simpler: EvaluatedModel, score: Score) -> Fit | None:
        """The fit of a candidate that was abandoned, or gained too little at tracked angles."""
        fit = self._fits.get(key_of(simpler.fit) | {score.structure})
        if fit is None or not fit.converged:
            return fit
        is_poor = simpler.fit.cost - fit.cost < score.gain
        is_wrong = is_poor and is_tracked(simpler.fit.simulator.model)
        return replace(fit, converged=False) if is_wrong else None

    def abandon_cost(self, current: EvaluatedModel, simpler: EvaluatedModel) -> float:
        """Cost above which an extension of the simpler model is no rival of the current model."""
        gain = simpler.fit.cost - current.fit.cost
        slack = max(self.policy.abandon_slack, self.policy.rival_share * gain)
        return current.fit.cost + slack

    def scores(self, current: EvaluatedModel) -> list[Score]:
        """Scores of all prototypes of the effect types that are not in the model, best first."""
        key = key_of(current.fit)
        if not np.isfinite(current.fit.cost):
            return []
        if key not in self._scores:
            candidates = candidates_of(current.fit, self.withheld)
            found = screened(current.fit, candidates, self.policy)
            if not key:
                found = with_fitted_hold(current.fit, found)
            scored = {score.candidate.term.name for score in found}
            names = dict.fromkeys(candidate.term.name for candidate in candidates)
            self._uncomputed[key] = [name for name in names if name not in scored]
            self._scores[key] = without_shared(found)
            self.tried = max(self.tried, sum(candidate.prototypes for candidate in candidates))
        return self._scores[key]

    def uncomputed(self, current: EvaluatedModel) -> list[str]:
        """Effect types without a finite score for a screened model."""
        return self._uncomputed.get(key_of(current.fit), [])

    def curves(self, current: EvaluatedModel) -> list[Score]:
        """Scores of terms that belong to no effect type (curves, ripples, ...), best first."""
        key = key_of(current.fit)
        if key not in self._curves:
            self._curves[key] = missing_curves(current.fit, self.policy)
        return self._curves[key]

    def omitted(self, current: EvaluatedModel) -> tuple[OmittedTerm, ...]:
        """Terms outside the model with a predicted gain above chance, effect types and curves."""
        scores = [*self.scores(current), *self.curves(current)]
        return omitted_terms(current.fit, current.fraction, scores, self.tried)

    def underestimate(self, current: EvaluatedModel, term: AbstractEffect) -> float:
        """Largest ratio of achieved to predicted gain that is assumed for an effect [-].

        Effects of the same equation and drivers have nearly the same signature.  If one of them
        gained more than predicted, so may the others: the score is taken at a biased model.
        """
        key, ratio, signature = key_of(current.fit), 1.0, (term.equation, term.drivers)
        best: dict[tuple[str, str], float] = {}
        # The last gain of a structure remains, which is that of its best score.
        for score in reversed(self._scores.get(key, [])):
            other = score.candidate.final
            if (other.equation, other.drivers) == signature:
                best[score.structure] = score.gain
        for structure, gain in best.items():
            if gain > 0:
                found = key | {structure}
                model = self._evaluated.get(found)
                fit = self._fits.get(found) if model is None else model.fit
                if fit is not None:
                    ratio = max(ratio, (current.fit.cost - fit.cost) / gain)
        return self.policy.underestimate * ratio

    def refits(
        self, current: EvaluatedModel, scores: Sequence[Score], abandon_cost: float = np.inf
    ) -> list[tuple[Score, Fit]]:
        """Fits of the model with each candidate added, best first; poor fits are stopped early.

        A candidate is skipped if its predicted gain, however much it is underestimated, is less
        than the gain that `abandon_cost` requires, or less than a gain close to the best so far.
        An unlisted law with a grid of starting points has no such prediction.
        """
        found, policy = [], self.policy
        best = current.fit.cost
        for score in scores:
            key = key_of(current.fit) | {score.structure}
            fit = self._fits.get(key)
            if fit is None:
                needed = current.fit.cost - min(abandon_cost, current.fit.cost)
                needed = max(needed, (1.0 - policy.close_share) * (current.fit.cost - best))
                term, grid = score.candidate.term, score.candidate.tried
                is_predicted = grid is None or term.name != "unlisted"
                if is_predicted and self.underestimate(current, term) * score.gain < needed:
                    continue
                slack = max(policy.abandon_slack, policy.close_share * (current.fit.cost - best))
                limits = self.limits(min(best + slack, abandon_cost), self.longest)
                starts = list(score.starts)
                if score.candidate.tried is not None:
                    starts += [Start(values) for values in score.candidate.tried.T]
                fit = fitted_candidate(current.fit, score.candidate, starts, limits)
                fit = self._fits[key] = fit.light()
            best = min(best, fit.cost)
            if fit.cost <= abandon_cost:
                found.append((score, fit))
        return sorted(found, key=lambda trial: trial[1].cost)

    def runners_up(self) -> list[EvaluatedModel]:
        """Runner-up models of round 1, best first, at their optima."""
        nominal = self._evaluated[frozenset()].fit.cost
        costs = sorted((f.cost, key) for key, f in self._fits.items() if len(key) == 1)
        gains = {key: nominal - cost for cost, key in costs if next(iter(key))[0] != "unlisted"}
        least = self.policy.runner_share * max(gains.values(), default=0.0)
        keys = [key for key, gain in gains.items() if gain > least][1:]
        return [self.evaluate(self.finished(self._fits[key])) for key in keys]

    def finish_best(
        self, current: EvaluatedModel, fits: Sequence[tuple[Score, Fit]]
    ) -> list[EvaluatedModel]:
        """Finish and evaluate the first refits, those with a cost close to the best."""
        policy, longest = self.policy, self.policy.finish_factor * self.longest
        models: list[EvaluatedModel] = []
        for score, fit in fits:
            lowest = fits[0][1].cost
            if fit.cost > lowest + policy.close_share * (current.fit.cost - lowest):
                break
            key = key_of(current.fit) | {score.structure}
            best = min((model.fit.cost for model in models), default=np.inf)
            began = operations()
            fraction = min((model.fraction for model in models), default=1.0)
            limits = self.limits(best + policy.abandon_slack / fraction, longest, best)
            finished = self.finished(fit, limits)
            if finished.is_behind(limits) or operations() - began > longest:
                self._unfinished.add(key)
            # Evaluate the fit while its derivatives are still in memory.
            models.append(self.evaluate(finished))
            self._fits[key] = finished.light()
        return models

    def final(self, current: EvaluatedModel) -> Fit:
        """Fit of the final model, finished now if the search only needed it for a comparison."""
        fit = current.fit
        if key_of(fit) not in self._unfinished and not fit.is_off(self.policy.bias):
            return fit
        limits = TerminationLimits(self.policy.steps, budget=Budget())
        fit = self._converged(replace(fit, converged=False), limits)
        return refined(fit, limits, self.policy)

    def finished(self, fit: Fit, limits: TerminationLimits | None = None) -> Fit:
        """Fit at its optimum, with substeps as fine as it needs.

        If the base model had not converged, every added effect would seem to improve it.
        """
        limits = limits or self.limits()
        fit = retracked(self._converged(fit, limits), limits)
        return self._converged(refined(fit, limits, self.policy), limits)

    def _converged(self, fit: Fit, limits: TerminationLimits) -> Fit:
        """Continue a fit until it converges or gains less than 1 in log likelihood."""
        for _ in range(self.policy.continuations):
            if fit.converged or limits.over or fit.is_behind(limits):
                break
            before = fit.cost
            fit = renewed(continued(fit, limits), limits)
            if before - fit.cost < 1.0:
                break
        return fit

    def worth_a_refit(
        self, current: EvaluatedModel, understated: float | None = None, unknowns: int = 1
    ) -> float:
        """Predicted gain below which an effect would fail even if its gain were underestimated.

        The score is exact for small effects and underestimates large ones, whose shape differs from
        the prototype.  The size limit is divided by `understated`, the largest ratio of achieved to
        predicted gain (that of effects if None), the significance limit by two.
        """
        size = self.policy.least_fall * float(current.fit.weighting.counts.max())
        understated = understated or self.policy.underestimate
        return float(max(self.chance(current, unknowns) / 2, size / understated))

    def chance(self, current: EvaluatedModel, unknowns: int) -> float:
        """Gain that a number of added unknowns needs to be significant."""
        samples = max(float(current.fit.weighting.counts.sum()) * current.fraction, 2.0)
        return by_chance(unknowns, samples, max(self.tried, 1)) / current.fraction
