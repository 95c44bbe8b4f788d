"""Acceptance criteria (significance, size, validation) and posterior model probabilities.

On long records the likelihood ratio is very large for every real effect, and also for small errors
of another origin: a smoothed temperature, coloured noise.  An effect therefore has to meet three
criteria.  None of them was tuned on a simulator.

1. *Significance.* Twice the gain of the log likelihood has to exceed k log N (Schwarz) plus twice
   the logarithm of the number of prototypes tried (union bound).  Gain and N are counted in
   effective samples, to allow for autocorrelated residuals.  The time of an event counts as two
   parameters, since it can be at any sample (Zhang and Siegmund).
2. *Size.* The simulation error has to fall by at least 2 %, summed over the two channels.  Less
   than 1 % per channel has no practical use, and other imperfections cause as much: an inexact law,
   a smoothed temperature.
3. *Validation.* The error of the validation runs has to fall by at least a quarter of its fall in
   training, or of the fall that is certainly possible above the noise if that is smaller.  These
   runs also have to prefer the effect by twenty to one.  An effect of a single run is exempt from
   both; it may raise their error by at most a quarter of its fall in training.  The validation
   noise level is only as certain as the kurtosis of the residual allows: a few outliers raise it
   although no effect is missing.  Per-record amplitudes are fitted to the validation runs, because
   a phase cannot be predicted.

The criterion for the comparison of models is half the BIC of the training runs minus the predictive
log likelihood of the validation runs, which needs no complexity penalty.  If two models differ by
less than 1, they are tied.  The model whose effect types come first in the catalogue (common
effects first) is then selected, and the other is listed as an alternative.

Source: Schwarz, Annals of Statistics 6 (1978), 461-464; Zhang and Siegmund, Biometrics 63 (2007),
22-32; Kass and Raftery, J. American Statistical Association 90 (1995), 773-795 (probabilities from
differences of BIC).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.effects.effect import AbstractEffect, effects_of
from identification.fit.campaign import Campaign
from identification.fit.evaluate import simulate_unseen
from identification.fit.order_tracking import path_size
from identification.fit.solve import Fit
from identification.linear import least_squares
from identification.selection.policy import DEFAULT, SelectionPolicy

__all__ = [
    "UNCOMPUTED",
    "AcceptanceCriteria",
    "EvaluatedModel",
    "by_chance",
    "evaluated",
    "probabilities",
    "scores_of",
]

_BY_CHANCE: Final = 0.5
"""Expected gain of the log likelihood by a parameter that has no effect."""
UNCOMPUTED: Final = "not computable: the simulation diverges or the normal equations are not finite"


@dataclass(frozen=True)
class AcceptanceCriteria:
    """Result of the three acceptance criteria."""

    gain: float
    """Gain of the log likelihood over the model without the effect, in effective samples."""
    needed: float
    """Gain that chance reaches (significance limit)."""
    training: float
    """Relative fall of the error of the training runs, summed over the channels [-]."""
    validation: float | None
    """The same for the validation runs; None without such runs [-]."""
    possible: float
    """Relative fall on the validation runs down to the noise, reduced by the uncertainty of the
    noise level [-]."""
    log_odds: float
    """Gain of the log likelihood of the validation runs, in effective samples."""
    local: bool
    """Whether the effect is restricted to single runs."""
    flaw: str = ""
    """Why the fitted effect is implausible for its type; empty if it is plausible."""
    unknowns: int = 1
    """Number of unknowns that the effect adds, without those of single records."""
    tried: int = 1
    """Number of prototypes from which the effect was selected."""
    policy: SelectionPolicy = field(default=DEFAULT, repr=False)
    """Limits of the criteria."""

    @property
    def passed(self) -> bool:
        """Whether the effect meets all three criteria and is plausible."""
        return not self.refusal

    @property
    def refines(self) -> bool:
        """Whether an extended variant of an accepted effect is accepted.

        The variant claims no new effect, so the size criterion is waived: a law that hardly changes
        the error can still bias other parameters by many standard deviations.  The gain has to be
        significant, and the validation error has to fall.
        """
        is_predicted = self.validation is None or (
            self.validation > self.policy.validation_tolerance
        )
        return self.passed or (self.gain > self.needed and is_predicted and not self.flaw)

    @property
    def refusal(self) -> str:
        """The criterion that is not met, in words; empty if all are met."""
        policy = self.policy
        if self.flaw:
            return self.flaw
        if not self.gain > self.needed:
            return (
                f"not significant: the gain in log likelihood is {self.gain:.1f}; the best of all "
                f"prototypes reaches {self.needed:.1f} by chance"
            )
        if not self.training > policy.least_fall:
            return (
                f"too small: the simulation error of the training runs changes by "
                f"{-100 * self.training:+.2f} % (limit {-100 * policy.least_fall:.1f} %)"
            )
        if self.validation is None:
            return ""
        least = -policy.validation_share * self.training
        if not self.local:
            expected = policy.validation_share * min(self.training, max(self.possible, 0.0))
            least = expected - policy.validation_tolerance
        is_preferred = self.local or self.log_odds > policy.validation_log_odds
        if not (self.validation > least and is_preferred):
            return (
                "not confirmed by the validation runs: their simulation error changes by "
                f"{-100 * self.validation:+.2f} %, that of the training runs by "
                f"{-100 * self.training:+.2f} %"
            )
        return ""


@dataclass(frozen=True)
class ValidationErrors:
    """Simulation errors of a model on the validation runs."""

    square: Array
    """(2,) mean square error [A^2, rad^2/s^2]."""
    count: Array
    """(2,) number of samples."""
    scatter: Array
    """(2,) standard error of the logarithm of the RMS error, from its kurtosis [-]."""


@dataclass(frozen=True)
class EvaluatedModel:
    """A model with its validation errors."""

    fit: Fit
    """The fit."""
    fraction: float
    """Effective sample fraction [-]."""
    unseen: ValidationErrors | None = None
    """Errors on the validation runs; None without such runs."""

    @property
    def is_computed(self) -> bool:
        """Whether cost and normal equations are finite; other models are never selected."""
        return bool(np.isfinite(self.fit.cost)) and self.fit.equations.is_finite

    def criteria(
        self, simpler: EvaluatedModel, tried: int, policy: SelectionPolicy = DEFAULT
    ) -> AcceptanceCriteria:
        """Acceptance criteria of this model against a simpler one.

        Args:
            simpler: The model without the effect.
            tried: Number of prototypes from which the effect was selected.
            policy: Limits of the criteria.
        """
        shared = self.fit.position.size - simpler.fit.position.size
        counts = self.fit.weighting.counts
        samples = max(float(counts.sum()) * self.fraction, 2.0)
        terms = effects_of(self.fit.simulator.model.terms)
        known = {term.name for term in simpler.fit.simulator.model.terms}
        added = [term for term in terms if term.name not in known]
        shared += sum(len(term.moments) for term in added)
        more = shared + _lasting(self.fit) - _lasting(simpler.fit)
        fall = np.full(2, np.inf)
        if np.isfinite(simpler.fit.cost):
            fall = np.log(simpler.fit.weighting.deviation / self.fit.weighting.deviation)
        validation, possible, log_odds = None, 0.0, 0.0
        if self.unseen is not None and simpler.unseen is not None:
            ratio = _log_ratio(simpler.unseen.square, self.unseen.square)
            excess = _log_ratio(simpler.unseen.square, self.fit.weighting.deviation**2)
            validation = float(np.sum(ratio[counts > 0]))
            scatter = float(np.linalg.norm(self.unseen.scatter[counts > 0]))
            possible = float(np.sum(excess[counts > 0])) - policy.validation_sd * scatter
            log_odds = self.fraction * float(np.sum((ratio * self.unseen.count)[counts > 0]))
        return AcceptanceCriteria(
            gain=self.fraction * (simpler.fit.cost - self.fit.cost),
            needed=by_chance(max(more, 1), samples, max(tried, 1)),
            training=float(np.sum(fall[counts > 0])),
            validation=validation,
            possible=possible,
            log_odds=log_odds,
            local=bool(added) and all(term.is_local for term in added),
            # An extended variant has the type of the term it replaces, and can be implausible too.
            flaw=self._flaw([t for t in terms if t not in simpler.fit.simulator.model.terms]),
            unknowns=max(shared, 1),
            tried=max(tried, 1),
            policy=policy,
        )

    def _flaw(self, terms: Sequence[AbstractEffect]) -> str:
        """Why a term is implausible or the model cannot be computed; empty otherwise."""
        if not self.is_computed:
            return UNCOMPUTED
        values = dict(zip(self.fit.coordinates.names, self.fit.values, strict=True))
        for term in terms:
            own = {p.name: float(values[f"{term.name}.{p.name}"]) for p in term.parameters}
            if term.flaw(own):
                return term.flaw(own)
        return ""

    def predicts_worse(self, other: EvaluatedModel, policy: SelectionPolicy) -> bool:
        """Whether the validation runs prefer the other model as clearly as they must an effect."""
        if self.unseen is None or other.unseen is None:
            return False
        ratio = _log_ratio(other.unseen.square, self.unseen.square)
        counted = (ratio * self.unseen.count)[self.fit.weighting.counts > 0]
        log_odds = max(self.fraction, other.fraction) * float(np.sum(counted))
        return log_odds < -policy.validation_log_odds

    def score(self, fraction: float) -> float:
        """Criterion for the comparison of models; smaller is better.

        Half the BIC of the training runs, plus the negative predictive log likelihood of the
        validation runs.

        Args:
            fraction: Effective sample fraction, the same for all compared models [-].

        Returns:
            The criterion; infinity for a model that cannot be computed.
        """
        if not self.is_computed:
            return float("inf")
        samples = max(float(self.fit.weighting.counts.sum()) * fraction, 2.0)
        size = _determined(self.fit) + _lasting(self.fit)
        chance = _BY_CHANCE * _fading(self.fit)
        penalty = 0.5 * size * float(np.log(samples))
        return fraction * (self.fit.cost + self._predictive()) + penalty + chance

    def _predictive(self) -> float:
        """Negative log likelihood of the validation runs at unknown noise level."""
        if self.unseen is None:
            return 0.0
        seen = self.fit.weighting.counts > 0
        with np.errstate(divide="ignore"):
            terms = 0.5 * self.unseen.count * np.log(self.unseen.square)
        return float(np.sum(terms[seen & (self.unseen.count > 0)]))


def by_chance(unknowns: int, samples: float, tried: int) -> float:
    """Gain of the log likelihood that the best of `tried` prototypes reaches by chance."""
    return float(0.5 * unknowns * np.log(samples) + np.log(tried))


def _log_ratio(square: Array, other: Array) -> Array:
    """Logarithm of the ratio of two RMS errors, from the mean squares of each channel."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(0.5 * np.log(square / other))


def _lasting(fit: Fit) -> int:
    """Number of initial values and phases, over all records, that are parameters in the BIC.

    Current, speed and fading states do not count.  Late samples contain no information on them, so
    their penalty does not grow with the logarithm of the record length.
    """
    states = [state for term in fit.simulator.model.terms for state in term.states]
    phases = path_size(fit.simulator, fit.values, fit.weighting.deviation)
    return len(fit.states) * sum(not state.fades for state in states) + phases


def _fading(fit: Fit) -> int:
    """Number of initial values of fading states, over all records."""
    states = [state for term in fit.simulator.model.terms for state in term.states]
    return len(fit.states) * sum(state.fades for state in states)


def _determined(fit: Fit) -> float:
    """Effective number of parameters: those that the data determine and not the priors.

    A parameter that stays at its prior costs nothing.  Example: the asymmetry of a friction, if the
    motor turns in one direction only.
    """
    return float(np.trace(least_squares(fit.equations.matrix, fit.equations.information)))


def scores_of(models: Sequence[EvaluatedModel]) -> list[float]:
    """Criteria of several models, counted in the effective samples of the whitest residual.

    A missing effect makes the residual autocorrelated, so the best model gives the best estimate of
    the effective sample fraction.
    """
    fraction = max((one.fraction for one in models if np.isfinite(one.fit.cost)), default=1.0)
    return [one.score(fraction) for one in models]


def evaluated(fit: Fit, campaign: Campaign, fraction: float) -> EvaluatedModel:
    """Evaluate a fit on the validation runs.

    Args:
        fit: The fit.
        campaign: Training and validation records.
        fraction: Effective sample fraction [-].
    """
    if not campaign.validation:
        return EvaluatedModel(fit, fraction)
    own = any(state.is_own for term in fit.simulator.model.terms for state in term.states)
    simulated = simulate_unseen(fit, campaign.validation, whole=own)
    total, fourth, count = np.zeros(2), np.zeros(2), np.zeros(2)
    for s in simulated:
        total += np.sum(s.record.weight * s.residual**2, axis=0)
        fourth += np.sum(s.record.weight * s.residual**4, axis=0)
        count += s.record.weight.sum(axis=0)
    many = np.maximum(count, 1.0)
    square = total / many
    with np.errstate(divide="ignore", invalid="ignore"):
        uneven = np.maximum(np.nan_to_num(fourth / many / square**2 - 1.0), 0.0)
    scatter = 0.5 * np.sqrt(uneven / (many * fraction))
    return EvaluatedModel(fit, fraction, ValidationErrors(square, count, scatter))


def probabilities(scores: Sequence[float]) -> Array:
    """Posterior model probabilities from half the BIC, at equal prior odds.

    Args:
        scores: Criterion of each model, all on the same data and effective samples.
    """
    if not np.isfinite(scores).any():
        # The first model is the current one; if none can be computed, it gets probability 1.
        return np.asarray(np.arange(len(scores)) == 0, dtype=np.float64)
    relative = -(np.asarray(scores) - np.min(scores))
    weights = np.exp(np.maximum(relative, -700.0))
    return np.asarray(weights / weights.sum())
