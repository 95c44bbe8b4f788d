"""Evaluated models, their ranking, and their posterior probabilities.

An effect has to meet the acceptance criteria (`selection/criteria.py`).  If the voltage is noisy,
an effect can also gain by suppressing the current that its noise causes in the simulation.  Models
are therefore compared at equal power of this noise (decision 0030), and on the samples that all of
them predict (`selection/common_samples.py`).

The criterion for the comparison of models is half the BIC of the training runs minus the predictive
log likelihood of the validation runs, which needs no complexity penalty.  If two models differ by
less than 1, they are tied.  The model whose effect types come first in the catalogue (common
effects first) is then selected, and the other is listed as an alternative.

Source: Schwarz, Annals of Statistics 6 (1978), 461-464; Kass and Raftery, J. American Statistical
Association 90 (1995), 773-795 (probabilities from differences of BIC).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.effects.catalogue import CATALOGUE
from identification.effects.effect import AbstractEffect, effects_of
from identification.fit.campaign import Campaign
from identification.fit.evaluate import median_start, voltage_noise_power
from identification.fit.own_states import term_values
from identification.fit.solve import Fit
from identification.fit.tracked_fit import tracking_penalty
from identification.linear import least_squares
from identification.model.composite import Edges
from identification.selection.common_samples import chance_of_fading, common_edges, fit_within
from identification.selection.criteria import AcceptanceCriteria, by_chance
from identification.selection.policy import DEFAULT, SelectionPolicy
from identification.selection.simulation_error import simulation_fall, unweighted_deviation
from identification.selection.start import has_odd_coefficients
from identification.selection.validation import ValidationErrors, validation_errors

__all__ = [
    "UNCOMPUTED",
    "EvaluatedModel",
    "evaluated",
    "is_at_bound",
    "is_better",
    "probabilities",
    "ranked",
    "replaces",
    "scores_of",
]

_ODD: Final = "implausible: like noise of the voltage, it makes a temperature coefficient unusual"
_COLD: Final = "implausible: losses cannot cause a winding that starts most runs colder than logged"
_NOISE: Final = "implausible: it explains no more than noise of the voltage causes"
_COLD_K: Final = -5.0
"""Median rise at the start of a run below which the losses cannot have heated the winding [K].  A
smaller difference can be an error of the thermometer, and a single run what the law lacks."""
_COLD_SD: Final = 2.0
"""Standard deviations by which it has to be below."""
UNCOMPUTED: Final = "not computable: the simulation diverges or the normal equations are not finite"


@dataclass(frozen=True)
class EvaluatedModel:
    """A model with its validation errors."""

    fit: Fit
    fraction: float
    """Effective sample fraction [-]."""
    unseen: ValidationErrors | None = None
    """Errors on the validation runs; None without such runs."""
    noise: Array = field(default_factory=lambda: np.zeros(2))
    """(2,) mean square of current and speed that the noise of the voltage causes in the simulation,
    whitened as the residuals [A^2, rad^2/s^2]."""
    edges: Edges | None = None
    """Samples at the ends of each record without which it is compared; None for its own."""

    def within(self, edges: Edges) -> EvaluatedModel:
        """The model compared without the samples at these ends of each record."""
        if not self.is_computed or edges == (self.edges or self.fit.simulator.model.edges):
            return self
        unseen = self.unseen and self.unseen.within(edges, self.fraction)
        return replace(self, fit=fit_within(self.fit, edges), unseen=unseen, edges=edges)

    def at_equal_noise(self, other: EvaluatedModel) -> EvaluatedModel:
        """The model with the squares that it had if it passed as much noise as the other model."""
        added = np.maximum(other.noise - self.noise, 0.0)
        if not (added > 0.0).any() or not np.isfinite(self.fit.cost):
            return self
        weighting = self.fit.weighting
        deviation = np.sqrt(weighting.deviation**2 + added)
        rise = float(weighting.counts @ np.log(deviation / weighting.deviation))
        weighting = replace(weighting, deviation=deviation)
        fit = replace(self.fit, cost=self.fit.cost + rise, weighting=weighting)
        unseen = self.unseen and replace(self.unseen, square=self.unseen.square + added)
        return replace(self, fit=fit, unseen=unseen, noise=self.noise + added)

    @property
    def is_computed(self) -> bool:
        """True if cost and normal equations are finite; other models are never selected."""
        return bool(np.isfinite(self.fit.cost)) and self.fit.equations.is_finite

    def is_undecided(self, simpler: Fit) -> bool:
        """True if a finite fit did not converge and may still reach the cost of this model."""
        is_open = bool(np.isfinite(simpler.cost)) and not simpler.converged
        return is_open and simpler.may_reach(self.fit.cost)

    def effects_added_to(self, simpler: EvaluatedModel) -> list[AbstractEffect]:
        """Effects of types that the simpler model lacks; they may stand anywhere among the terms.

        The terms are in the order in which they were accepted, another one in each path of search.
        """
        known = {term.name for term in simpler.fit.simulator.model.terms}
        return [t for t in effects_of(self.fit.simulator.model.terms) if t.name not in known]

    def criteria(
        self, simpler: EvaluatedModel, tried: int, policy: SelectionPolicy = DEFAULT
    ) -> AcceptanceCriteria:
        """Acceptance criteria of this model against a simpler one without the effect.

        The effect was selected from `tried` prototypes.
        """
        own, other = _comparable([self, simpler])
        return own._criteria(other, tried, policy)

    def _criteria(
        self, simpler: EvaluatedModel, tried: int, policy: SelectionPolicy
    ) -> AcceptanceCriteria:
        """Acceptance criteria against a simpler model that is comparable."""
        shared = self.fit.position.size - simpler.fit.position.size
        counts = self.fit.weighting.counts
        samples = max(float(counts.sum()) * self.fraction, 2.0)
        added = self.effects_added_to(simpler)
        shared += sum(len(term.moments) for term in added)
        more = shared + _lasting(self.fit) - _lasting(simpler.fit)
        paths = [tracking_penalty(model.fit, self.fraction) for model in (self, simpler)]
        fall = np.full(2, np.inf)
        if np.isfinite(simpler.fit.cost):
            fall = np.log(unweighted_deviation(simpler.fit) / unweighted_deviation(self.fit))
        validation, possible, log_odds, expected = None, 0.0, 0.0, np.inf
        if self.unseen is not None and simpler.unseen is not None:
            ratio = _log_ratio(simpler.unseen.square, self.unseen.square)
            excess = _log_ratio(simpler.unseen.square, unweighted_deviation(self.fit) ** 2)
            validation = float(np.sum(ratio[counts > 0]))
            scatter = float(np.linalg.norm(self.unseen.scatter[counts > 0]))
            possible = float(np.sum(excess[counts > 0])) - policy.validation_sd * scatter
            log_odds = self.fraction * float(np.sum((ratio * self.unseen.count)[counts > 0]))
            deviation = self.fit.weighting.deviation
            expected = self.fraction * self.unseen.expected_log_odds(simpler.unseen, deviation)
        return AcceptanceCriteria(
            gain=self.fraction * (simpler.fit.cost - self.fit.cost),
            needed=by_chance(max(more, 1), samples, max(tried, 1)) + paths[0] - paths[1],
            training=float(np.sum(fall[counts > 0])),
            validation=validation,
            possible=possible,
            log_odds=log_odds,
            local=bool(added) and all(term.is_local for term in added),
            varies=bool(added) and all(term.varies for term in added),
            flaw=self._flaw(simpler),
            unknowns=max(shared, 1),
            tried=max(tried, 1),
            policy=policy,
            expected=expected,
            simulation=-np.inf if self.noise.any() else simulation_fall(self.fit, simpler.fit),
        )

    def _flaw(self, simpler: EvaluatedModel) -> str:
        """Why the added terms are implausible or the model cannot be computed; empty otherwise."""
        if not self.is_computed:
            return UNCOMPUTED
        for term in effects_of(self.fit.simulator.model.terms):
            # An extended variant has the type of the term it replaces, and can be implausible too.
            if term in simpler.fit.simulator.model.terms:
                continue
            flaw = term.flaw(term_values(self.fit, term)) or (_COLD if self._is_cold(term) else "")
            if flaw:
                return flaw
        if not self.noise.any():
            return ""
        removed = simpler.fit.weighting.deviation**2 - self.fit.weighting.deviation**2
        is_curve = any(term.name == "unlisted" for term in self.effects_added_to(simpler))
        if is_curve and np.all(removed <= simpler.noise):
            return _NOISE
        is_odd = has_odd_coefficients(self.fit)
        return _ODD if is_odd and not has_odd_coefficients(simpler.fit) else ""

    def _is_cold(self, term: AbstractEffect) -> bool:
        """True if a winding that its losses heat starts most runs clearly colder than logged."""
        sd = _COLD_SD / np.sqrt(self.fraction)
        return term.heats and median_start(self.fit, term, sd) < _COLD_K

    def predicts_worse(self, other: EvaluatedModel, policy: SelectionPolicy) -> bool:
        """True if the validation runs prefer the other model as clearly as they must an effect."""
        edges = common_edges([self.fit, other.fit])
        own, other = self.within(edges), other.within(edges)
        if own.unseen is None or other.unseen is None:
            return False
        ratio = _log_ratio(other.unseen.square, own.unseen.square)
        counted = float(np.sum((ratio * own.unseen.count)[self.fit.weighting.counts > 0]))
        log_odds = max(self.fraction, other.fraction) * counted
        return log_odds < -policy.validation_log_odds

    def score(self, fraction: float) -> float:
        """Criterion for the comparison of models; smaller is better, infinite if not computed.

        Half the BIC of the training runs, plus the negative predictive log likelihood of the
        validation runs.  The effective sample fraction is the same for all compared models [-].
        """
        if not self.is_computed:
            return float("inf")
        samples = max(float(self.fit.weighting.counts.sum()) * fraction, 2.0)
        penalty = 0.5 * (_determined(self.fit) + _lasting(self.fit)) * float(np.log(samples))
        penalty += chance_of_fading(self.fit, self.edges) + tracking_penalty(self.fit, fraction)
        return fraction * (self.fit.cost + self._predictive()) + penalty

    def _predictive(self) -> float:
        """Negative log likelihood of the validation runs at unknown noise level."""
        if self.unseen is None:
            return 0.0
        seen = self.fit.weighting.counts > 0
        with np.errstate(divide="ignore"):
            terms = 0.5 * self.unseen.count * np.log(self.unseen.square)
        return float(np.sum(terms[seen & (self.unseen.count > 0)]))


def _log_ratio(square: Array, other: Array) -> Array:
    """Logarithm of the ratio of two RMS errors, from the mean squares; 0 if both are infinite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = 0.5 * np.log(square / other)
    return np.where(np.isinf(square) & np.isinf(other), 0.0, ratio)


def _lasting(fit: Fit) -> int:
    """Number of initial values, over all records, that are parameters in the BIC.

    Current, speed and fading states do not count.  Late samples contain no information on them, so
    their penalty does not grow with the logarithm of the record length.
    """
    states = [state for term in fit.simulator.model.terms for state in term.states]
    return len(fit.states) * sum(not state.fades for state in states)


def _determined(fit: Fit) -> float:
    """Effective number of parameters: those that the data determine and not the priors.

    A parameter that stays at its prior costs nothing.  Example: the asymmetry of a friction, if the
    motor turns in one direction only.
    """
    return float(np.trace(least_squares(fit.equations.matrix, fit.equations.information)))


def scores_of(models: Sequence[EvaluatedModel]) -> list[float]:
    """Criteria of several models, counted in the effective samples of the whitest residual.

    A missing effect makes the residual autocorrelated, so the best model has the best fraction.
    """
    fraction = max((one.fraction for one in models if np.isfinite(one.fit.cost)), default=1.0)
    return [one.score(fraction) for one in _comparable(models)]


def _comparable(models: Sequence[EvaluatedModel]) -> list[EvaluatedModel]:
    """The models on the samples that all of them predict, and at equal noise of the voltage."""
    edges = common_edges(one.fit for one in models if one.is_computed)
    found = [one.within(edges) for one in models]
    for other in found:
        found = [one.at_equal_noise(other) for one in found]
    return found


def evaluated(fit: Fit, campaign: Campaign, fraction: float) -> EvaluatedModel:
    """Evaluate a fit on the validation runs of a campaign."""
    runs = campaign.validation
    unseen = validation_errors(fit, runs, fraction) if runs else None
    return EvaluatedModel(fit, fraction, unseen, voltage_noise_power(fit))


def probabilities(scores: Sequence[float]) -> Array:
    """Posterior model probabilities from half the BIC, at equal prior odds.

    All scores are on the same data and effective samples.
    """
    if not np.isfinite(scores).any():
        # The first model is the current one; if none can be computed, it gets probability 1.
        return np.asarray(np.arange(len(scores)) == 0, dtype=np.float64)
    relative = -(np.asarray(scores) - np.min(scores))
    weights = np.exp(np.maximum(relative, -700.0))
    return np.asarray(weights / weights.sum())


def ranked(models: Sequence[EvaluatedModel], policy: SelectionPolicy) -> list[int]:
    """Indices of the models, best first; ties are decided by the catalogue, common types first."""
    scores = scores_of(models)
    best = min(scores, default=0.0)
    positions = {name: position for position, name in enumerate(CATALOGUE)}

    def key(k: int) -> tuple[float, float]:
        alike = scores[k] < best + policy.tie
        terms = models[k].fit.simulator.model.terms
        places = [positions.get(term.name, np.inf) for term in terms]
        return (best, float(sum(places))) if alike else (scores[k], 0.0)

    return sorted(range(len(models)), key=key)


def is_better(one: EvaluatedModel, other: EvaluatedModel) -> bool:
    """True if the first model has the lower criterion."""
    scores = scores_of([one, other])
    return scores[0] < scores[1]


def replaces(curve: EvaluatedModel, listed: EvaluatedModel, policy: SelectionPolicy) -> bool:
    """True if a curve replaces the effects of the catalogue.

    The curve has to rank better, and its validation error must not be clearly larger.  In place of
    a single effect it also has to lower the error by the size limit, because a free curve that fits
    only as well as an effect is that effect.  The size limit does not apply if the effect has a
    shape parameter at its bound.
    """
    if curve.predicts_worse(listed, policy):
        return False
    fall = np.log(listed.fit.weighting.deviation / curve.fit.weighting.deviation)
    is_only = len(listed.fit.simulator.model.terms) == 1
    must_be_smaller = is_only and not is_at_bound(listed.fit, policy)
    is_small = float(np.sum(fall)) < policy.least_fall
    return is_better(curve, listed) and not (must_be_smaller and is_small)


def is_at_bound(fit: Fit, policy: SelectionPolicy) -> bool:
    """True if a defining shape parameter of an effect may lie beyond a bound of its range.

    Example: a drag at the largest allowed exponent is more curved than real drag.  The data require
    another law, with which the drag is confounded.
    """
    at = {name: k for k, name in enumerate(fit.coordinates.names)}
    shapes = [
        at[f"{term.name}.{name}"]
        for term in effects_of(fit.simulator.model.terms)
        for name in term.defining
    ]
    if not shapes:
        return False
    lower, position, upper = (
        side[shapes] for side in (fit.coordinates.lower, fit.position, fit.coordinates.upper)
    )
    spread = np.sqrt(np.diag(fit.equations.covariance())[shapes])
    margin = np.maximum(policy.bound_range * (upper - lower), policy.bound_sd * spread)
    return bool(np.any(np.minimum(position - lower, upper - position) < margin))
