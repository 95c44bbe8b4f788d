"""Moving averages and recursive filters of samples, as loggers, drives and firmware form them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

import casadi as ca

from identification.effects.effect import AbstractEffect, CampaignScales, Candidate
from identification.effects.parameters import columns, shape
from identification.model.history import windowed
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractMean,
    AbstractSampleFilter,
    Channel,
    Expression,
    Values,
)

__all__ = [
    "CurrentAverage",
    "CurrentMean",
    "CurrentRecursion",
    "CurrentSampleAverage",
    "DigitalFilter",
    "SpeedAverage",
    "SpeedMean",
    "SpeedRecursion",
    "SpeedSampleAverage",
]

_MOST: Final = 32
"""Sample intervals of the longest window."""
_SHORTEST: Final = 1.2
"""Sample intervals of the shortest window; one interval is the law of the means."""
_FASTEST: Final = 0.3
_SLOWEST: Final = 300.0
"""Time constants of a recursive filter over the sample interval: the fastest keeps 4 % of its last
value, and the slowest is that of an analog filter."""


class _OfSpeed(AbstractEffect):
    """Law of the logged speed."""

    name = "speed_filter"
    drivers = ("speed",)
    channel: ClassVar[Channel] = "speed"


class _OfCurrent(AbstractEffect):
    """Law of the logged current."""

    name = "current_filter"
    drivers = ("current",)
    channel: ClassVar[Channel] = "current"


@dataclass(frozen=True)
class _Mean(AbstractEffect, AbstractMean):
    """Mean over the sample interval that ends with the sample."""

    law: str = "mean over the sample interval"
    """Name of the law in a result."""

    parameters = ()

    @property
    def variant(self) -> str:
        return self.law

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:  # noqa: ARG003
        return [Candidate(cls(), columns(()))]


@dataclass(frozen=True)
class SpeedMean(_OfSpeed, _Mean):
    """Mean of the speed over the sample interval, as from differenced encoder counts."""

    source = (
        "Petrella, Tursini, Peretti and Zigliotto, Proc. ACEMP (2007), 780-787 (speed from counts)"
    )


@dataclass(frozen=True)
class CurrentMean(_OfCurrent, _Mean):
    """Mean of the current over the sample interval, as of an integrating converter."""

    source = "Kester (ed.), The Data Conversion Handbook, Newnes (2005), chapter 3"


@dataclass(frozen=True)
class DigitalFilter(AbstractEffect):
    """Filter of the samples of a channel, with the lag `time_constant`."""

    interval: float
    """Sample interval [s]."""

    source = "Oppenheim and Schafer, Discrete-Time Signal Processing, 3rd edition, section 2.2"

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:  # noqa: ARG003
        """None: the laws rival an analog filter that has been accepted."""
        return []


@dataclass(frozen=True)
class _Average(DigitalFilter, AbstractMean):
    """Mean over the last 2 tau seconds, as of an integrating converter or of encoder counts."""

    intervals: int = _MOST
    """Sample intervals of the longest window."""

    variant = "moving average"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        shortest, longest = _SHORTEST * self.interval, self.intervals * self.interval
        meaning = "half of the window, the time by which the average lags"
        return (shape("time_constant", "s", meaning, shortest / 2, longest / 2),)

    def window(self, values: Values) -> Expression:
        return 2 * values.time_constant / self.interval


@dataclass(frozen=True)
class _SampleAverage(DigitalFilter, AbstractSampleFilter):
    """Mean of the last n samples, n = 1 + 2 tau / h."""

    memory: int = _MOST - 1
    """Samples of the longest average but the latest."""

    variant = "moving average of samples"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        shortest, longest = (_SHORTEST - 1) * self.interval, self.memory * self.interval
        meaning = "time by which the average lags, (n - 1) h / 2 for n samples at intervals h"
        return (shape("time_constant", "s", meaning, shortest / 2, longest / 2),)

    def filtered(
        self, sample: Expression, past: Sequence[Expression], values: Values
    ) -> tuple[Expression, Sequence[Expression]]:
        kept = (sample, *past)
        return windowed(kept, 1 + 2 * values.time_constant / self.interval), kept[:-1]


@dataclass(frozen=True)
class _Recursion(DigitalFilter, AbstractSampleFilter):
    """Recursive filter of the samples: y_k = a y_(k-1) + (1 - a) x_k, a = exp(-h / tau)."""

    variant = "recursive filter of samples"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        fastest, slowest = _FASTEST * self.interval, _SLOWEST * self.interval
        return (shape("time_constant", "s", "time constant of the filter", fastest, slowest),)

    def filtered(
        self, sample: Expression, past: Sequence[Expression], values: Values
    ) -> tuple[Expression, Sequence[Expression]]:
        share = 1 - ca.exp(-self.interval / values.time_constant)
        reading = past[0] + share * (sample - past[0])
        return reading, (reading,)


@dataclass(frozen=True)
class SpeedAverage(_OfSpeed, _Average):
    """Moving average of the logged speed."""


@dataclass(frozen=True)
class SpeedSampleAverage(_OfSpeed, _SampleAverage):
    """Moving average of the samples of the speed."""


@dataclass(frozen=True)
class SpeedRecursion(_OfSpeed, _Recursion):
    """Recursive filter of the samples of the speed."""


@dataclass(frozen=True)
class CurrentAverage(_OfCurrent, _Average):
    """Moving average of the logged current."""


@dataclass(frozen=True)
class CurrentSampleAverage(_OfCurrent, _SampleAverage):
    """Moving average of the samples of the current."""


@dataclass(frozen=True)
class CurrentRecursion(_OfCurrent, _Recursion):
    """Recursive filter of the samples of the current."""
