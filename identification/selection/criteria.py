"""Acceptance criteria of an effect: significance, size and validation.

On long records the likelihood ratio is very large for every real effect, and also for small errors
of another origin: a smoothed temperature, coloured noise.  An effect therefore has to meet three
criteria.  None of them was tuned on a simulator.

1. *Significance.* Twice the gain of the log likelihood has to exceed k log N (Schwarz) plus twice
   the logarithm of the number of prototypes tried (union bound).  Gain and N are counted in
   effective samples, to allow for autocorrelated residuals.  The time of an event counts as two
   parameters, since it can be at any sample (Zhang and Siegmund).
2. *Size.* The simulation error of the training or of the validation runs has to fall by at least
   2 %, summed over the two channels.  Less than 1 % per channel has no practical use, and other
   imperfections cause as much: an inexact law, a smoothed temperature.  An accepted effect is not
   removed under a noise model if the error before whitening falls by as much
   (`selection/simulation_error.py`).
3. *Validation.* The error of the validation runs has to fall by at least a quarter of its fall in
   training, or of the fall that is certainly possible above the noise if that is smaller.  These
   runs also have to prefer the effect by twenty to one.  An effect of a single run is exempt from
   both; it may raise their error by at most a quarter of its fall in training.  An effect whose
   size differs from run to run is exempt from the share only: a zero error of each run may by
   chance be small in the validation runs, which still have to prefer it.  The validation
   noise level is only as certain as the kurtosis of the residual allows: a few outliers raise it
   although no effect is missing.  Per-record amplitudes are fitted to the first half of each
   validation record, because a phase cannot be predicted, and have to predict the second one.
   Runs in which the effect would change so little that it cannot be preferred by twenty to one in
   the mean are no judges of it: they may only not contradict it (decision 0036).  The falls are
   fractions of the error, not of its logarithm: that of an effect that causes nearly all of the
   training error has no bound, and validation runs with an error of their own cannot confirm a
   quarter of it.

Source: Schwarz, Annals of Statistics 6 (1978), 461-464; Zhang and Siegmund, Biometrics 63 (2007),
22-32.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from identification.selection.policy import DEFAULT, SelectionPolicy

__all__ = ["AcceptanceCriteria", "by_chance"]


@dataclass(frozen=True)
class AcceptanceCriteria:
    """Result of the three acceptance criteria."""

    gain: float
    """Gain of the log likelihood over the model without the effect, in effective samples."""
    needed: float
    """Gain that chance reaches (significance limit)."""
    training: float
    """Fall of the logarithm of the error of the training runs, summed over the channels [-]."""
    validation: float | None
    """The same for the validation runs; None without such runs [-]."""
    possible: float
    """The same for validation runs whose error falls to the noise, reduced by the uncertainty of
    the noise level [-]."""
    log_odds: float
    """Gain of the log likelihood of the validation runs, in effective samples."""
    local: bool
    """True if the effect is restricted to single runs."""
    varies: bool = False
    """True if the size of the effect differs from run to run."""
    flaw: str = ""
    """Why the fitted effect is implausible for its type; empty if it is plausible."""
    unknowns: int = 1
    """Number of unknowns that the effect adds, without those of single records."""
    tried: int = 1
    """Number of prototypes from which the effect was selected."""
    policy: SelectionPolicy = field(default=DEFAULT, repr=False)
    expected: float = np.inf
    """`log_odds` that the validation runs reach in the mean if the fitted effect is true."""
    simulation: float = -np.inf
    """`training` of the error before whitening; minus infinity if it is not whitened [-]."""

    @property
    def passed(self) -> bool:
        """True if the effect meets all three criteria and is plausible."""
        return not self.refusal

    @property
    def _is_large(self) -> bool:
        """True if the effect meets the size criterion.

        The parameters of the model without it absorb a part of the effect in the training runs, and
        cannot in the validation runs, where it may show more.
        """
        falls = [self.training, self.validation if self.is_judged else None]
        return max(fall for fall in falls if fall is not None) > self.policy.least_fall

    @property
    def is_unconfirmed(self) -> bool:
        """True if the effect is significant and large enough, but refused all the same.

        The residual then has structure that this effect follows and does not explain.
        """
        return self.gain > self.needed and self._is_large and not self.passed

    @property
    def is_kept(self) -> bool:
        """True if an effect that was accepted before stays in the model.

        Under a noise model, the size criterion is also met by the simulation error, since whitening
        removes a slow effect with the noise.  A new effect has to lower the whitened error: the
        error of an inexact law is slow as well.
        """
        of_any_size = replace(self, policy=replace(self.policy, least_fall=-np.inf))
        is_large = self.simulation > self.policy.least_fall
        return self.passed or (is_large and of_any_size.passed)

    @property
    def refines(self) -> bool:
        """True if an extended variant of an accepted effect is accepted.

        The variant claims no new effect, so the size criterion is waived: a law that hardly changes
        the error can still bias other parameters by many standard deviations.  The gain has to be
        significant, and the validation error has to fall.
        """
        is_predicted = self.validation is None or (
            self.validation > self.policy.validation_tolerance
        )
        return self.passed or (self.gain > self.needed and is_predicted and not self.flaw)

    @property
    def is_judged(self) -> bool:
        """True if the validation runs can show the effect."""
        return self.validation is not None and self.expected >= self.policy.validation_log_odds

    @property
    def _least_log_odds(self) -> float:
        """Log odds of the validation runs that the effect has to exceed.

        Those of runs that cannot show it have a mean of `expected` and twice that as variance.
        """
        if self.is_judged:
            return self.policy.validation_log_odds
        return float(self.expected - self.policy.validation_sd * np.sqrt(2.0 * self.expected))

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
        if not self._is_large:
            return (
                f"too small: the simulation error of the training runs changes by "
                f"{-100 * self.training:+.2f} % (limit {-100 * policy.least_fall:.1f} %)"
            )
        if self.validation is None:
            return ""
        training, validation = _fraction(self.training), _fraction(self.validation)
        least = -policy.validation_share * training
        if not (self.local or self.varies):
            possible = _fraction(max(self.possible, 0.0)) if self.is_judged else 0.0
            least = policy.validation_share * min(training, possible) - policy.validation_tolerance
        is_preferred = self.local or self.log_odds > self._least_log_odds
        if not (validation > least and is_preferred):
            return (
                "not confirmed by the validation runs: their simulation error changes by "
                f"{-100 * validation:+.2f} %, that of the training runs by {-100 * training:+.2f} %"
            )
        return ""


def _fraction(fall: float) -> float:
    """Fall of an error as a fraction of it [-], from the fall of its logarithm."""
    with np.errstate(over="ignore"):
        return float(-np.expm1(-fall))


def by_chance(unknowns: int, samples: float, tried: int) -> float:
    """Gain of the log likelihood that the best of `tried` prototypes reaches by chance."""
    return float(0.5 * unknowns * np.log(samples) + np.log(tried))
