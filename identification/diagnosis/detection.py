"""Whether a fitted model lacks anything at all.

Three questions are asked of the current and of the speed, on the runs that were fitted and on those
that were not: is the residual larger than the noise, has its whitened form a memory, and does it
follow the voltage?

    found = detect(fit, campaign, localise(fit).noise)
    found.missing, found.sentence

*Which noise.*  A residual cannot be compared with itself: what the model lacks would count as noise
and nothing would ever be missing.  The noise of `localise` has the missing voltage and torque taken
out.

*Which level.*  A model that is complete is called incomplete with at most `LEVEL`, all questions
together; each has an equal part (Bonferroni), so the bands are wider than those of one question.
They hold for white, coloured and spiky noise: the scatter of a mean square grows with the colour of
the residual and with the kurtosis of its innovations, memory is looked for after whitening, and the
band of the correlation with the voltage is Bartlett's for two coloured series.  On unseen runs size
and correlation allow for the error that uncertain parameters make.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from identification.diagnosis.remains import (
    Remains,
    remains_of_training,
    remains_of_validation,
)
from identification.fit.campaign import Campaign
from identification.fit.solve import Fit

__all__ = ["LEVEL", "ChannelCheck", "Detection", "detect"]

Array = NDArray[np.float64]
Channel = Literal["current", "speed"]
Role = Literal["training", "validation"]

LEVEL: Final = 0.01
"""Probability that a complete model is called incomplete."""

_QUESTIONS: Final = 3
_CHANNELS: Final[tuple[Channel, Channel]] = ("current", "speed")
_RESOLVED: Final = 0.02
"""Excess of the noise ratio that is not called a fault even where endless records resolve it: a
remainder of a fifth of the noise, as big as quantisation by half of the noise adds."""


@dataclass(frozen=True)
class ChannelCheck:
    """What one channel says on the runs of one role.

    Args:
        channel: ``current`` or ``speed``.
        role: ``training`` or ``validation``.
        noise_ratio: Root mean square of the residual over the noise [-].
        noise_ratio_limit: Upper edge of its band, all questions together at the level [-].
        whiteness_p: p value of no memory in the whitened residual [-].
        voltage_outside: Share of lags at which the correlation with the voltage leaves a band that
            holds for all lags together [-].
        passed: Whether all three are as a complete model leaves them.
        reason: Why not, or that it did, in words.
    """

    channel: Channel
    role: Role
    noise_ratio: float
    noise_ratio_limit: float
    whiteness_p: float
    voltage_outside: float
    passed: bool
    reason: str

    @property
    def is_too_large(self) -> bool:
        """Whether the residual is larger than noise can be."""
        return self.noise_ratio > self.noise_ratio_limit


@dataclass(frozen=True)
class Detection:
    """Whether something is missing.

    Args:
        level: Probability that a complete model is called incomplete [-].
        checks: Training before validation, current before speed.
        missing: Whether any check failed.
        sentence: The same in words.
    """

    level: float
    checks: tuple[ChannelCheck, ...]
    missing: bool
    sentence: str

    def of(self, channel: str, role: str) -> tuple[ChannelCheck, ...]:
        """The check of a channel in a role; none where it was not made."""
        return tuple(c for c in self.checks if (c.channel, c.role) == (channel, role))


def detect(fit: Fit, campaign: Campaign, noise: Array) -> Detection:
    """Ask all questions of a fitted model.

    Args:
        fit: The fit, its records those of training.
        campaign: Where the runs that were left out are.
        noise: (2,) noise of current and speed [A, rad/s], that of `localise`.
    """
    floor = np.asarray(noise, dtype=np.float64)
    training = remains_of_training(fit)
    validation = remains_of_validation(fit, campaign.validation, floor)
    questions = _QUESTIONS * (len(training) + len(validation))
    checks = [
        _check(channel, "training", left, float(floor[k]), None, LEVEL / questions)
        for k, (channel, left) in enumerate(zip(_CHANNELS, training, strict=True))
    ]
    if validation:
        checks += [
            _check(channel, "validation", left, float(floor[k]), training[k], LEVEL / questions)
            for k, (channel, left) in enumerate(zip(_CHANNELS, validation, strict=True))
        ]
    failed = [check for check in checks if not check.passed]
    return Detection(LEVEL, tuple(checks), bool(failed), _sentence(checks, failed))


def _check(
    channel: Channel,
    role: Role,
    left: Remains,
    noise: float,
    training: Remains | None,
    level: float,
) -> ChannelCheck:
    if left.count < 8 or not noise > 0.0 or not left.rms > 0.0:
        return ChannelCheck(channel, role, 0.0, 1.0, 1.0, 0.0, True, "it was not measured")
    ratio, limit = left.rms / noise, _limit(left, noise, training, level)
    whiteness, outside = left.whiteness(), left.voltage_outside(level)
    reasons = []
    if ratio > limit:
        reasons.append(f"its residual is {ratio:.2f} times the noise, at most {limit:.2f} expected")
    if whiteness < level:
        reasons.append("its residual has a memory that noise does not have")
    if outside > 0.0:
        reasons.append(f"its residual follows the voltage at {100 * outside:.0f} % of the lags")
    reason = "; ".join(reasons) if reasons else "its residual is no more than noise"
    return ChannelCheck(channel, role, ratio, limit, whiteness, outside, not reasons, reason)


def _limit(left: Remains, noise: float, training: Remains | None, level: float) -> float:
    """Upper edge of the noise ratio: noise as estimated in training, and what parameters add."""
    variance = left.scatter() + (training.scatter() if training is not None else 0.0)
    mean, more = left.imitated(noise)
    reach = float(stats.norm.isf(level))
    return float(np.sqrt(1.0 + mean + reach * np.sqrt(variance + more))) + _RESOLVED


def _sentence(checks: list[ChannelCheck], failed: list[ChannelCheck]) -> str:
    if not failed:
        roles = "training and validation" if len(checks) > 2 else "training"
        return f"Nothing is missing: on {roles} runs the residuals are no more than noise."
    worst = max(failed, key=lambda check: check.noise_ratio / check.noise_ratio_limit)
    return (
        f"Something is missing: on the {worst.role} runs the {worst.channel} does not come out, "
        f"{worst.reason}."
    )
