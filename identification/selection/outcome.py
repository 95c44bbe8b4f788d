"""Result of a search: accepted effects, alternatives and examined candidates.

A posterior model probability compares models of which one is true.  If the final model leaves a
discrepancy above the noise, none of them is, and an effect may only be a surrogate: a term outside
the catalogue may cause both what the effect explains and what remains.  Such a term is worth a
curve, so the runs contain as many independent observations of a discrepancy as a curve has
coefficients, however many samples they have.  The odds of the effect against this term are
therefore those of the Schwarz criterion with that number as sample size: the effect has to reduce
the discrepancy far more than the best of all prototypes would by chance.

An `unlisted` law of approximate form leaves a discrepancy as well, although further effects may
absorb it.  Two powers of a signal whose exponents differ by one, such as x and x^2, share 15/16 of
their mean square, so an effect beside such a law is compared with 1/16 of what the law explains.

Source: Kennedy and O'Hagan, J. Royal Statistical Society B 63 (2001), 425-464 (discrepancy of a
model); Berger, Bayarri and Pericchi, Econometric Reviews 33 (2014), 197-217 (effective sample size
in the Schwarz criterion).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from scipy.special import expit

from identification.arrays import Array
from identification.fit.solve import Fit
from identification.model.composite import MotorModel
from identification.selection.criteria import AcceptanceCriteria, by_chance
from identification.selection.omitted import OmittedTerm
from identification.selection.policy import DEFAULT
from identification.selection.tracing import Trace
from identification.surrogates.curve import HEIGHTS

__all__ = ["Alternative", "Found", "Outcome", "Searched"]

_FORM: Final = 1.0 / 16.0
"""Fraction of the mean square of x^2, uniform from 0 to its largest value, that a x leaves."""


@dataclass(frozen=True)
class Alternative:
    """Another effect type in place of an accepted effect."""

    name: str
    """Effect type."""
    probability: float
    """Posterior probability of the model with it [-]."""
    fit: Fit
    """Fit of the model with it in place of the accepted effect."""
    fraction: float
    """Effective sample fraction of that fit [-]."""


@dataclass(frozen=True)
class Found:
    """An effect of the final model."""

    name: str
    """Effect type."""
    probability: float
    """Posterior probability against the alternatives [-]."""
    criteria: AcceptanceCriteria
    """Acceptance criteria against the model without the effect."""
    alternatives: tuple[Alternative, ...]
    """Other effect types in its place, the most probable first."""
    outside: float = 0.0
    """Probability that a term outside the catalogue causes what the effect explains [-]."""
    is_undecided: bool = False
    """True if the fit without the effect did not converge and may still reach the cost of that with
    it."""
    removal: dict[str, float] = field(default_factory=dict)
    """Change of each remaining parameter if the effect is removed, in search coordinates; empty if
    unknown."""
    is_comparable: bool = True
    """False if none of the compared models explains the runs, so that their odds say nothing."""
    is_approximate: bool = False
    """True if its law is `unlisted` and stands for laws of another form."""

    @property
    def others(self) -> list[tuple[str, float]]:
        """Names and probabilities of other causes of what the effect explains, best first."""
        found = {other.name: other.probability for other in self.alternatives}
        if self.outside > DEFAULT.reported_probability:
            found["unlisted"] = found.get("unlisted", 0.0) + self.outside
        return sorted(found.items(), key=lambda item: -item[1])

    def _scaled(self, share: float) -> Found:
        """The effect and its alternatives with a share of their probabilities."""
        alternatives = tuple(
            replace(other, probability=share * other.probability) for other in self.alternatives
        )
        return replace(self, probability=share * self.probability, alternatives=alternatives)

    @property
    def fall(self) -> float:
        """Logarithm of the RMS error without the effect over that with it, summed over channels."""
        criteria, seen = self.criteria, self.criteria.validation
        return criteria.training if seen is None or criteria.local or criteria.varies else seen

    def given(self, ratios: Array, approximate: float = 0.0) -> Found:
        """The effect with its probabilities given what the final model leaves unexplained.

        If the fit without the effect decided nothing, that model is as probable as the one with it.
        The ratios (n_channel,) are the RMS error of the final model over the largest that noise
        explains [-]; `approximate` is the `fall` by a law of the model whose form is approximate.
        """
        odds = self._scaled(1.0 / (1.0 + self.probability)) if self.is_undecided else self
        after = _discrepancy(ratios)
        explained = _discrepancy(ratios, self.fall) - after
        left = after + _FORM * (_discrepancy(ratios, approximate) - after)
        if self.name == "unlisted" or not left > 0.0:
            return odds
        gain = 0.5 * HEIGHTS * np.log(max(1.0 + explained / left, 1e-300))
        chance = by_chance(self.criteria.unknowns, HEIGHTS, self.criteria.tried)
        share = float(expit(gain - chance))
        return replace(odds._scaled(share), outside=1.0 - share)


def _discrepancy(ratios: Array, fall: float = 0.0) -> float:
    """Mean square above the noise, summed over the channels, where the error is larger by `fall`.

    The fall is the sum over both channels of the logarithm of the RMS error.
    """
    return float(np.sum(np.maximum(ratios**2 * np.exp(min(fall, 100.0)) - 1.0, 0.0)))


@dataclass(frozen=True)
class Searched:
    """One examined candidate."""

    name: str
    """Effect type."""
    round: int
    """Number of the round, from 1."""
    predicted_gain: float
    """Predicted gain of the log likelihood; achieved gain of an extended variant."""
    criteria: AcceptanceCriteria | None
    """Acceptance criteria after the refit; None without a refit."""
    chosen: bool
    """True if the candidate was accepted in that round."""
    detail: str = ""
    """Variant of the effect type, for example the channel or the run."""
    flaw: str = ""
    """Why the candidate could not be computed; empty if it could."""


@dataclass(frozen=True)
class Outcome:
    """Result of a search."""

    fit: Fit
    """Fit of the final model."""
    effects: tuple[Found, ...]
    """Its effects, the largest gain first."""
    searched: tuple[Searched, ...]
    complete: bool = True
    """True if the search ended by itself and not because its budget was spent."""
    traces: tuple[Trace, ...] = ()
    """Curves of what the nominal model lacks over single signals, best first; empty if no effect
    was accepted."""
    omitted: tuple[OmittedTerm, ...] = ()
    """Terms outside the final model with a predicted gain above chance."""
    is_scored: bool = True
    """True if any term in addition to the final model has a finite score."""
    smooth: MotorModel | None = None
    """The final model with the friction of the search, if that of `fit` is sharper."""

    def given(self, ratios: Array) -> Outcome:
        """The outcome with the probabilities of its effects as of `Found.given`."""
        approximate = max((found.fall for found in self.effects if found.is_approximate), default=0)
        return replace(
            self, effects=tuple(found.given(ratios, approximate) for found in self.effects)
        )

    @property
    def doubtful(self) -> tuple[OmittedTerm, ...]:
        """Effects that may be surrogates for a term outside the catalogue, as consider terms.

        The law of that term is unknown: the parameters may be those with the effect, those without
        it, or others as far away.  The change is as probable as that term.
        """
        return tuple(
            OmittedTerm(found.name, None, None, found.removal, surrogate=outside)
            for found in self.effects
            if (outside := found.outside if found.is_comparable else 1.0)
            > DEFAULT.reported_probability
            and found.removal
        )

    def with_alternatives_of(self, effects: Sequence[Found]) -> Outcome:
        """The outcome, its effects without alternatives with those of an earlier search.

        Args:
            effects: Effects of a search on a part of the samples.
        """
        known = {found.name: found for found in effects}
        return replace(
            self,
            effects=tuple(
                replace(found, probability=before.probability, alternatives=before.alternatives)
                if (before := known.get(found.name)) and not found.alternatives
                else found
                for found in self.effects
            ),
        )

    def without_probabilities(self) -> Outcome:
        """The outcome of models that do not explain the runs."""
        effects = tuple(replace(found, is_comparable=False) for found in self.effects)
        return replace(self, effects=effects)

    def doubting(self, names: Sequence[str]) -> Outcome:
        """The outcome with a term outside the catalogue in place of effects that cannot be."""
        effects = tuple(
            replace(found, probability=0.0, alternatives=(), outside=1.0)
            if found.name in names
            else found
            for found in self.effects
        )
        return replace(self, effects=effects)
