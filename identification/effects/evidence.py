"""What counts as evidence for an effect, and how probable the models are that survive.

Likelihood ratios of long records are enormous for anything real, and also for small errors of
quite another kind: a temperature that was smoothed, noise that is not white.  So an effect has to
pass three gates, none of which was tuned on a simulator:

1. *Chance.*  Twice the gain of the log likelihood, counted in effective samples (the share that
   correlated residuals leave), has to exceed what the best of all prototypes reaches by chance:
   k log N (Schwarz) plus twice the logarithm of the number of prototypes tried (union bound); the
   time of an event counts twice, since it may be at any sample (Zhang and Siegmund).
2. *Size.*  The simulation error has to fall by at least two per cent, summed over the two channels;
   less, a hundredth of each, is of no use to anybody and within the reach of what is left of other
   imperfections: an inexact law, a smoothed temperature.
3. *Prediction.*  On runs that were left out, the error has to fall too, by at least a quarter of
   what it fell by on the training runs, or of what it could surely fall by before it reached the
   noise, where that is less, and by so much that these runs prefer the effect by twenty to one; an
   effect of a single run only must not make it worse.  How loud the noise is there is known as well
   as their residual is even: a few spikes make a run louder that nothing is missing from.
   Amplitudes that every record has for itself are fitted to the runs left out: a phase is no
   prediction.

Models are compared by half the Bayesian information criterion of the training runs and by what
they foretell of the runs left out: the chain rule of probability, in which the second factor asks
for no penalty since nothing was fitted to it.  Two that differ by less than one
are alike; the one whose kinds come first in the catalogue, commoner things first, is then named,
and the other is listed beside it.

Source: Schwarz, Annals of Statistics 6 (1978), 461-464; Zhang and Siegmund, Biometrics 63 (2007),
22-32; Kass and Raftery, J. American Statistical Association 90 (1995), 773-795 (probabilities from
differences of BIC).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.fit.campaign import Campaign
from identification.fit.evaluate import simulate_unseen
from identification.fit.solve import Fit
from identification.linear import least_squares
from identification.model.term import AbstractTerm, State

__all__ = [
    "LEAST_SIZE",
    "UNCOMPUTED",
    "Gates",
    "Judged",
    "judged",
    "probabilities",
    "scores_of",
]

Array = NDArray[np.float64]

LEAST_SIZE: Final = 0.02
_LEAST_SHARE: Final = 0.25
_SCATTER: Final = 0.002
"""Relative change of an error that is none."""
_LEAST_LOG_ODDS: Final = 3.0
"""Logarithm of the odds by which runs left out have to prefer an effect, twenty to one: strong
evidence on the scale of Kass and Raftery."""
_SURELY: Final = 2.0
"""Standard deviations by which the noise of the runs left out may be louder than is known."""
_BY_CHANCE: Final = 0.5
"""Log likelihood that a number which is fitted gains where there is nothing to gain."""
UNCOMPUTED: Final = "cannot be computed: its simulation or its normal equations are not finite"


@dataclass(frozen=True)
class Gates:
    """Outcome of the three gates.

    Args:
        gain: Gain of the log likelihood over the model without the effect, in effective samples.
        needed: Gain that chance reaches.
        training: Relative fall of the error on training runs [-].
        validation: Relative fall on runs left out, None where there are none [-].
        possible: Relative fall on runs left out that would surely leave nothing but noise [-].
        log_odds: Gain of the log likelihood of the runs left out, in effective samples.
        local: Whether the effect concerns single runs only.
        flaw: Why the effect is not what its kind is; empty where it is.
    """

    gain: float
    needed: float
    training: float
    validation: float | None
    possible: float
    log_odds: float
    local: bool
    flaw: str = ""

    @property
    def passed(self) -> bool:
        """Whether the effect is real by all three."""
        return not self.refusal

    @property
    def refines(self) -> bool:
        """Whether a richer form of an effect that is there is real; it claims nothing new.

        However little it does to the error, parameters beside it may be off by many deviations.
        """
        is_foretold = self.validation is None or self.validation > _SCATTER
        return self.passed or (self.gain > self.needed and is_foretold and not self.flaw)

    @property
    def refusal(self) -> str:
        """Which gate refused it, in words; empty where none did."""
        if self.flaw:
            return self.flaw
        if not self.gain > self.needed:
            return (
                f"within chance: it gains {self.gain:.1f} in log likelihood where the best of all "
                f"prototypes gains {self.needed:.1f} by chance"
            )
        if not self.training > LEAST_SIZE:
            return (
                f"too small: the error falls by {100 * self.training:.2f} %, less than "
                f"{100 * LEAST_SIZE:.1f} %"
            )
        if self.validation is None:
            return ""
        expected = _LEAST_SHARE * min(self.training, max(self.possible, 0.0))
        least = -_LEAST_SHARE * self.training if self.local else expected - _SCATTER
        is_preferred = self.local or self.log_odds > _LEAST_LOG_ODDS
        if not (self.validation > least and is_preferred):
            return (
                f"not supported by the runs left out: their error changes by "
                f"{-100 * self.validation:.2f} % against {-100 * self.training:.2f} % on training"
            )
        return ""


@dataclass(frozen=True)
class Unseen:
    """Errors of a model on the runs left out.

    Args:
        square: (2,) mean square error [A^2, rad^2/s^2].
        count: (2,) number of samples.
        scatter: (2,) standard deviation of the root's logarithm, by how even the error is [-].
    """

    square: Array
    count: Array
    scatter: Array


@dataclass(frozen=True)
class Judged:
    """A model and its errors.

    Args:
        fit: The fit.
        share: Effective share of the samples.
        unseen: Errors on the runs left out, None without such runs.
    """

    fit: Fit
    share: float
    unseen: Unseen | None = None

    @property
    def is_computed(self) -> bool:
        """Whether cost and normal equations are finite; a model without is never chosen."""
        return bool(np.isfinite(self.fit.cost)) and self.fit.equations.is_finite

    def gates(self, simpler: Judged, tried: int) -> Gates:
        """The three gates between this model and a simpler one.

        Args:
            simpler: The model without the effect.
            tried: Number of prototypes among which the effect was found.
        """
        more = self.fit.position.size - simpler.fit.position.size
        more += _lasting(self.fit) - _lasting(simpler.fit)
        counts = self.fit.weighting.counts
        samples = max(float(counts.sum()) * self.share, 2.0)
        terms = self.fit.simulator.model.terms
        known = {term.name for term in simpler.fit.simulator.model.terms}
        added = [term for term in terms if term.name not in known]
        more += sum(len(term.moments) for term in added)
        fall = np.full(2, np.inf)
        if np.isfinite(simpler.fit.cost):
            fall = np.log(simpler.fit.weighting.deviation / self.fit.weighting.deviation)
        validation, possible, log_odds = None, 0.0, 0.0
        if self.unseen is not None and simpler.unseen is not None:
            floor = self.fit.weighting.deviation**2
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = 0.5 * np.log(simpler.unseen.square / self.unseen.square)
                excess = 0.5 * np.log(simpler.unseen.square / floor)
            validation = float(np.sum(ratio[counts > 0]))
            scatter = float(np.linalg.norm(self.unseen.scatter[counts > 0]))
            possible = float(np.sum(excess[counts > 0])) - _SURELY * scatter
            log_odds = self.share * float(np.sum((ratio * self.unseen.count)[counts > 0]))
        return Gates(
            gain=self.share * (simpler.fit.cost - self.fit.cost),
            needed=0.5 * max(more, 1) * np.log(samples) + np.log(max(tried, 1)),
            training=float(np.sum(fall[counts > 0])),
            validation=validation,
            possible=possible,
            log_odds=log_odds,
            local=bool(added) and all(term.is_local for term in added),
            # A richer form is no other kind, and may be flawed all the same.
            flaw=self._flaw([t for t in terms if t not in simpler.fit.simulator.model.terms]),
        )

    def _flaw(self, terms: Sequence[AbstractTerm]) -> str:
        """Why one of these terms is not what its kind is, or the model no candidate; else empty."""
        if not self.is_computed:
            return UNCOMPUTED
        values = dict(zip(self.fit.coordinates.names, self.fit.values, strict=True))
        for term in terms:
            own = {p.name: float(values[f"{term.name}.{p.name}"]) for p in term.parameters}
            if term.flaw(own):
                return term.flaw(own)
        return ""

    def predicts_worse(self, other: Judged) -> bool:
        """Whether the runs left out prefer another model by twenty to one."""
        if self.unseen is None or other.unseen is None:
            return False
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = 0.5 * np.log(other.unseen.square / self.unseen.square)
        counted = (ratio * self.unseen.count)[self.fit.weighting.counts > 0]
        return bool(max(self.share, other.share) * float(np.sum(counted)) < -_LEAST_LOG_ODDS)

    def score(self, share: float) -> float:
        """What speaks against the model; smaller is better.

        Half the Bayesian information criterion of the training runs, and the negative log
        likelihood of the runs left out, foretold from there.

        Args:
            share: Effective share of the samples, the same for all that are compared.

        Returns:
            Infinity for a model that cannot be computed.
        """
        if not self.is_computed:
            return float("inf")
        samples = max(float(self.fit.weighting.counts.sum()) * share, 2.0)
        size = _determined(self.fit) + _lasting(self.fit)
        chance = _BY_CHANCE * _fading(self.fit)
        return (
            share * (self.fit.cost + self._foretold())
            + 0.5 * size * float(np.log(samples))
            + chance
        )

    def _foretold(self) -> float:
        """Negative log likelihood of the runs left out, their noise unknown, up to a constant."""
        if self.unseen is None:
            return 0.0
        seen = self.fit.weighting.counts > 0
        with np.errstate(divide="ignore"):
            terms = 0.5 * self.unseen.count * np.log(self.unseen.square)
        return float(np.sum(terms[seen & (self.unseen.count > 0)]))


def _lasting(fit: Fit) -> int:
    """Number of initial values, over all records, that count as parameters.

    Those of current and speed do not, nor any that fades: what a sample tells of them ends early in
    the record, so that they do not cost the logarithm of its length.
    """
    return len(fit.states) * sum(not state.fades for state in _states(fit))


def _fading(fit: Fit) -> int:
    """Number of initial values, over all records, that fade."""
    return len(fit.states) * sum(state.fades for state in _states(fit))


def _states(fit: Fit) -> list[State]:
    return [state for term in fit.simulator.model.terms for state in term.states]


def _determined(fit: Fit) -> float:
    """Number of parameters that the data determine and not the priors.

    A parameter that is left where its prior has it costs no evidence: the asymmetry of a friction,
    where a motor turns one way only.
    """
    return float(np.trace(least_squares(fit.equations.matrix, fit.equations.information)))


def scores_of(models: Sequence[Judged]) -> list[float]:
    """Scores of models against each other, counted in the samples of the whitest of them.

    What a model lacks colours its residual, so that the best one says best how much the samples
    are worth.
    """
    share = max((one.share for one in models if np.isfinite(one.fit.cost)), default=1.0)
    return [one.score(share) for one in models]


def judged(fit: Fit, campaign: Campaign, share: float) -> Judged:
    """A fit with its errors on the runs left out.

    Args:
        fit: The fit.
        campaign: Records.
        share: Effective share of the samples.
    """
    if not campaign.validation:
        return Judged(fit, share)
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
    scatter = 0.5 * np.sqrt(uneven / (many * share))
    return Judged(fit, share, Unseen(square, count, scatter))


def probabilities(scores: Sequence[float]) -> Array:
    """Posterior probabilities of models from half their BIC, equal prior odds.

    Args:
        scores: Half the criterion of each model, all on the same data and effective samples.
    """
    if not np.isfinite(scores).any():
        # The first is the model at hand; where none can be computed it keeps its place alone.
        return np.asarray(np.arange(len(scores)) == 0, dtype=np.float64)
    relative = -(np.asarray(scores) - np.min(scores))
    weights = np.exp(np.maximum(relative, -700.0))
    return np.asarray(weights / weights.sum())
