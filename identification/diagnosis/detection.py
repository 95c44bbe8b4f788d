"""Residual tests for missing physics: size, whiteness, cross-correlation with the voltage.

Each test is applied to current and speed, on the training and on the validation runs:

    size           is the residual larger than the noise?
    whiteness      is the whitened residual autocorrelated?
    correlation    is the residual correlated with the voltage?

    found = detect(fit, simulate_fitted(fit), simulate_unseen(fit, records), localise(fit).noise)
    found.missing, found.sentence

*Noise level.* A residual cannot be its own reference: missing physics would count as noise and
would never be detected.  The noise from `localise` excludes the missing voltage and torque.

*Significance level.* A complete model is called incomplete with a probability of at most `LEVEL`,
all tests together.  Each test has an equal part of it (Bonferroni), so the bands are wider than
those of a single test.  The bands hold for white noise, for coloured noise and for noise with
outliers.  The variance of the mean square includes the autocorrelation of the residual and the
kurtosis of its innovations, whiteness is tested after whitening, and the band of the correlation is
Bartlett's for two coloured series.  On validation runs, the limits of size and correlation include
the error caused by parameter uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from scipy import stats

from identification.arrays import Array
from identification.diagnosis.channel_residuals import (
    ChannelResiduals,
    residuals_of_training,
    residuals_of_validation,
)
from identification.fit.evaluate import Simulated
from identification.fit.solve import Fit

__all__ = ["LEVEL", "ChannelCheck", "Detection", "detect"]

Channel = Literal["current", "speed"]
Role = Literal["training", "validation"]

LEVEL: Final = 0.01
"""Probability that a complete model is called incomplete."""

_QUESTIONS: Final = 3
"""Tests per channel and role."""
_CHANNELS: Final[tuple[Channel, Channel]] = ("current", "speed")
_RESOLVED: Final = 0.02
"""Excess of the noise ratio that is not called a fault even if very long records resolve it.  An
independent error of a fifth of the noise causes it, or quantisation in steps of 0.7 times the
noise."""


@dataclass(frozen=True)
class ChannelCheck:
    """Results of the tests of one channel on the runs of one role."""

    channel: Channel
    role: Role
    noise_ratio: float
    """Root mean square of the residual over the noise [-]."""
    noise_ratio_limit: float
    """Upper limit of the noise ratio at the joint level of all tests [-]."""
    whiteness_p: float
    """p value of the test that the whitened residual is white [-]."""
    voltage_outside: float
    """Fraction of lags at which the correlation with the voltage leaves a band that holds for all
    lags together [-]."""
    passed: bool
    reason: str
    """The tests that failed, in words, or that none did."""

    @property
    def is_too_large(self) -> bool:
        """True if the residual exceeds the limit of the noise."""
        return self.noise_ratio > self.noise_ratio_limit


@dataclass(frozen=True)
class Detection:
    """Joint result of all tests."""

    level: float
    """Probability that a complete model is called incomplete [-]."""
    checks: tuple[ChannelCheck, ...]
    """Training before validation, current before speed."""
    missing: bool
    sentence: str
    noisier: tuple[Channel, ...] = ()
    """Channels with more sensor noise in the validation runs: their residual is too large, but
    white, and that of the training runs is not too large.  A term that the model lacks acts through
    the time constants of the motor or follows its inputs, and the training runs have it too."""

    def is_noise(self, channel: str, role: str) -> bool:
        """True if the residual of a channel may be sensor noise alone."""
        checks = self.of(channel, role)
        is_consistent = bool(checks) and all(check.passed for check in checks)
        return is_consistent or (role == "validation" and channel in self.noisier)

    def of(self, channel: str, role: str) -> tuple[ChannelCheck, ...]:
        """The check of a channel in a role; empty if it was not made."""
        return tuple(c for c in self.checks if (c.channel, c.role) == (channel, role))


def detect(
    fit: Fit, fitted: Sequence[Simulated], unseen: Sequence[Simulated], noise: Array
) -> Detection:
    """Apply all residual tests to a fit and its simulated records, with (2,) noise [A, rad/s]."""
    floor = np.asarray(noise, dtype=np.float64)
    training = residuals_of_training(fitted)
    roles: dict[Role, list[ChannelResiduals]] = {
        "training": training,
        "validation": residuals_of_validation(fit, unseen, floor),
    }
    level = LEVEL / (_QUESTIONS * sum(map(len, roles.values())))
    checks = []
    for role, residuals in roles.items():
        for k, left in enumerate(residuals):
            reference = None if left is training[k] else training[k]
            checks.append(_check(_CHANNELS[k], role, left, float(floor[k]), reference, level))
    failed = [check for check in checks if not check.passed]
    noisier = tuple(
        channel
        for channel, seen, unseen, left in zip(
            _CHANNELS, checks, checks[len(_CHANNELS) :], roles["validation"], strict=False
        )
        if unseen.is_too_large
        and not seen.is_too_large
        and left.taps.size == 1
        and not (unseen.whiteness_p < level or unseen.voltage_outside > 0.0)
    )
    return Detection(LEVEL, tuple(checks), bool(failed), _sentence(checks, failed), noisier)


def _check(
    channel: Channel,
    role: Role,
    left: ChannelResiduals,
    noise: float,
    training: ChannelResiduals | None,
    level: float,
) -> ChannelCheck:
    if left.count < 8 or not noise > 0.0 or not left.rms > 0.0:
        return ChannelCheck(channel, role, 0.0, 1.0, 1.0, 0.0, True, "not measured")
    ratio, limit = left.rms / noise, _limit(left, noise, training, level)
    whiteness, outside = left.whiteness(), left.voltage_outside(level)
    reasons = []
    if ratio > limit:
        reasons.append(f"the residual is {ratio:.2f} times the sensor noise (limit {limit:.2f})")
    if whiteness < level:
        p_value = f"p = {whiteness:.1g}" if whiteness >= 1e-4 else "p < 0.0001"
        reasons.append(f"the residual is autocorrelated ({p_value}, limit {level:.1g})")
    if outside > 0.0:
        reasons.append(
            "the residual is correlated with the voltage beyond the limit at "
            f"{100 * outside:.0f} % of the lags"
        )
    reason = "; ".join(reasons) if reasons else "the residual is consistent with sensor noise"
    return ChannelCheck(channel, role, ratio, limit, whiteness, outside, not reasons, reason)


def _limit(
    left: ChannelResiduals, noise: float, training: ChannelResiduals | None, level: float
) -> float:
    """Upper limit of the noise ratio: noise of the training runs plus parameter uncertainty."""
    variance = left.scatter() + (training.scatter() if training is not None else 0.0)
    mean, more = left.error_variance(noise)
    reach = float(stats.norm.isf(level))
    return float(np.sqrt(1.0 + mean + reach * np.sqrt(variance + more))) + _RESOLVED


def _sentence(checks: list[ChannelCheck], failed: list[ChannelCheck]) -> str:
    if not failed:
        roles = "training and validation" if len(checks) > 2 else "training"
        return (
            f"The model explains current and speed: the residuals of the {roles} runs are "
            "consistent with sensor noise."
        )
    worst = max(failed, key=lambda check: check.noise_ratio / check.noise_ratio_limit)
    return (
        f"The model does not explain the {worst.channel} on the {worst.role} runs: {worst.reason}."
    )
