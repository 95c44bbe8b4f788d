"""Numbers that govern the selection of effects, each with unit and origin.

Only the first group decides which model is accepted; none of its numbers was tuned on a simulator.
The second group decides between effects and curves, and what is reported with an effect.  The
third limits the work: a larger limit finds more of the effects that a cheap prediction misses, at
more operations, and every model still has to meet the acceptance criteria.  The last group concerns
the intervals and not the selection.

Tolerances of a single algorithm (line search, greedy design, spectral peaks) stay in its module.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from scipy.stats import chi2

__all__ = ["DEFAULT", "SelectionPolicy"]


@dataclass(frozen=True)
class SelectionPolicy:
    """Limits of the search for effects."""

    # Acceptance (decision 0008).
    least_fall: float = 0.02
    """Fall of the simulation error, summed over both channels, that the size criterion requires
    [-].  Less than 1 % per channel has no practical use; with 0.5 %, laws slightly different from
    the catalogue's required a second effect."""
    validation_share: float = 0.25
    """Fraction of the fall in training that the validation runs must confirm [-]."""
    validation_tolerance: float = 0.002
    """Change of the validation error that counts as none [-]: a tenth of `least_fall`."""
    validation_log_odds: float = 3.0
    """Log odds by which the validation runs must prefer an effect [-]: twenty to one, strong
    evidence on the scale of Kass and Raftery."""
    validation_sd: float = 2.0
    """Standard errors by which the validation noise may exceed its estimate: a one-sided level of
    2.3 %."""
    tie: float = 1.0
    """Difference of the criterion below which models are tied [log likelihood]: not worth more than
    a bare mention on the scale of Kass and Raftery."""

    # Curves in place of effects (decision 0009).  The factors are judgements without a derivation.
    bound_sd: float = 2.0
    """Standard deviations within which a shape parameter counts as at its bound: an interval of
    95 %."""
    bound_range: float = 1e-3
    """The same as a fraction of its range [-]; only for parameters with a negligible deviation."""
    curve_factor: float = 3.0
    """Ratio of a curve's gain to the first effect's, from which the search ends [-]."""
    curve_share: float = 0.5
    """Fraction of a curve's gain; effects that predict more are tried before the curve [-]."""
    reported_probability: float = 0.005
    """Posterior probability below which an alternative is not reported [-]: rounds to 0 %."""

    # Predicted gains that justify a refit.
    underestimate: float = 5.0
    """Ratio of achieved to predicted gain up to which a candidate is refitted [-], unless an effect
    with the same equation and drivers has exceeded it (decision 0018)."""
    curve_underestimate: float = 2.0
    """The same for a curve [-], which has no shape parameter: the prediction is nearly exact."""
    predicted_share: float = 0.1
    """Fraction of the largest predicted gain below which no candidate of a batch is refitted [-];
    the next round predicts all gains anew."""
    close_share: float = 0.15
    """Fraction of the best gain by which a fit may fall behind and still be finished [-]: first
    refits stop early and are only as accurate as that."""
    rival_share: float = 0.02
    """Fraction of an effect's gain by which a rival may fall behind it [-]."""
    abandon_slack: float = 30.0
    """Log likelihood by which a fit may fall behind before it is abandoned; a model behind by 30
    has a posterior probability of e^-30."""
    runner_share: float = 0.2
    """Fraction of the best gain above which another effect is a runner-up of round 1 [-]."""

    # Cost: counts and fractions of the operation budget.
    rounds: int = 6
    """Rounds; each adds at most one effect.  Most motors have none or one (decision 0008)."""
    candidates: int = 7
    """Candidates refitted in one batch."""
    batches: int = 2
    """Batches of one round; a further one is refitted if all candidates before it fail."""
    rivals: int = 4
    """Candidates refitted in place of one effect."""
    curves: int = 4
    """Curves refitted."""
    runners: int = 2
    """Runner-up models of round 1 from which the selection is repeated."""
    steps: int = 20
    """Gauss-Newton steps of one fit; a fit that needs more is continued."""
    continuations: int = 4
    """Continuations of a fit that has not converged."""
    refinements: int = 3
    """Refinements of the substeps of one fit."""
    refinement_gain: float = 0.005
    """Gain per sample below which the substeps are not measured again [log likelihood]: the
    simulation then changes by a tenth of the noise, 0.1^2 / 2."""
    catalogue_budget: float = 0.75
    """Fraction of the operation budget for the catalogue; the rest is for curves [-]."""
    refit_budget: float = 0.06
    """Fraction of the operation budget for one refit [-]."""
    finish_factor: float = 2.5
    """Operations to finish a model of a round, over those of a refit [-]; the final model is
    finished without limit."""

    # Cost: samples (decision 0018).
    screening_samples: int = 20_000
    """Samples compared in the screening: an effect that changes the error by 2 % gains hundreds in
    log likelihood on them."""
    screening_substeps: int = 2
    """Substeps of a sample interval in the screening; effects can be told apart without their
    fastest transients."""
    subset_ratio: float = 1.5
    """Samples over the size of the representative subset from which the subset is used [-]."""
    subset_budget: float = 0.7
    """Fraction of the operation budget for the search on the subset [-]."""
    segment_samples: int = 1_000
    """Samples of one segment at least: many times the slowest time constant."""

    # Confounded lags and friction (decision 0023): intervals, not selection.
    exclusion_loss: float = float(0.5 * chi2.isf(1e-3, 1))
    """Loss of log likelihood that the true value exceeds once in a thousand (Wilks): 5.4."""
    bias: float = 0.25
    """Bias by smoothed friction and finite substeps above which the final model is refitted
    [standard deviations]: the coverage of a 90 % interval falls by 1 %."""
    widening: float = 0.46
    """Change of a parameter that widens its interval by a tenth [standard deviations]:
    sqrt(1.1^2 - 1)."""
    remaining_lag: float = 0.1
    """Fraction of the motor's lag that is left if the sensor has the rest [-]."""
    least_lag: float = 0.01
    """Least fraction of the motor's lag that a fit of long records leaves [-]; no run distinguishes
    less from none."""
    small_lag: float = 0.2
    """Fraction of the lag that is small enough for first order [-]."""
    confirmed_samples: int = 100_000
    """Samples up to which an optimum that the subset does not exclude is fitted to all samples."""


DEFAULT: Final = SelectionPolicy()
"""Policy of the service and of the command line."""
