"""Sensor dynamics: time delays, analog low-pass filters, and the hold of the voltage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from identification.arrays import Array
from identification.effects.average import (
    CurrentAverage,
    CurrentMean,
    CurrentRecursion,
    CurrentSampleAverage,
    DigitalFilter,
    SpeedAverage,
    SpeedMean,
    SpeedRecursion,
    SpeedSampleAverage,
)
from identification.effects.confusion import INDUCTANCE
from identification.effects.effect import AbstractEffect, CampaignScales, Candidate, register
from identification.effects.parameters import columns, shape
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractDelay,
    AbstractHold,
    AbstractSensor,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = ["ChannelDelay", "CurrentFilter", "InputHold", "SpeedFilter"]

_SOURCE = "Doebelin, Measurement Systems, 5th edition, chapter 3 (zero-, first- and second-order)"


_FASTEST = 0.1
"""Shortest time constant of a filter that the sampling resolves, over the sample interval."""
_INDUCTANCES = (0.5, 0.2, 0.05)
"""Fractions of a fitted inductance that may remain once filters take up the lag, so that the sum of
the lags of each channel is unchanged."""


def _traded(
    scales: CampaignScales, channel: str, *rest: float
) -> tuple[tuple[Array, dict[str, float]], ...]:
    """Starts at which the inductance returns the lag that it has taken from a channel's sensor.

    A fit without a lag of the current explains it by a larger inductance.  That lags the speed as
    well, so that a filter of the speed lacks its lag too; it is returned if a lag of the current
    takes its part.  The parameters of a start are the lag [s] and `rest`.
    """
    lag = scales.nominal("L") / scales.nominal("Ra25")
    other = f"{'speed' if channel == 'current' else 'current'}_filter.time_constant"
    time = scales.effects.get(other)
    if time is None and channel == "speed":
        return ()
    found = []
    for left in _INDUCTANCES:
        returned = (1.0 - left) * lag
        factors = {"L": left} | ({} if time is None else {other: 1.0 + returned / time})
        found.append((np.array([returned, *rest]), factors))
    return tuple(found)


@dataclass(frozen=True)
class _Filter(AbstractEffect, AbstractSensor):
    """First- or second-order low-pass filter between a quantity x and its logged value.

        tau dy/dt + q tau^2 d2y/dt2 = x - y,   logged = y

    q = 1/4 is two equal first-order stages, q = 1/3 approximates a moving average, and q = 1/2 is
    a Butterworth filter.
    """

    fastest: float
    """Shortest time constant that the sampling resolves [s]."""
    slowest: float
    """Longest time constant [s]."""
    order: int = 1
    """1, with q = 0, or 2."""

    source = _SOURCE
    unit: ClassVar[str]

    @property
    def variant(self) -> str:
        return "second order" if self.order == 2 else ""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        time = shape(
            "time_constant", "s", "time constant of the filter", self.fastest, self.slowest
        )
        second = shape("second", "-", "coefficient q of the second-order term", 0.05, 2.0)
        return (time, second) if self.order == 2 else (time,)

    @property
    def rival_laws(self) -> tuple[AbstractEffect, ...]:
        """Filters of the samples with the same lag; another effect can make up for them."""
        digital = (law for law in self.laws if issubclass(law, DigitalFilter))
        return tuple(law(self.fastest / _FASTEST) for law in digital)

    @property
    def states(self) -> tuple[State, ...]:
        filtered = State("filtered", self.unit, self.channel, fades=True)
        rise = State("rise", self.unit, fades=True)
        return (filtered, rise) if self.order == 2 else (filtered,)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        lag = getattr(signals, self.channel) - states.filtered
        if self.order == 1:
            return [lag / values.time_constant]
        return [
            states.rise / values.time_constant,
            (lag - states.rise) / (values.second * values.time_constant),
        ]

    def reading(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        # Other errors of the sensor, such as its zero, remain.
        return before + (states.filtered - getattr(signals, self.channel))

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        scanned = [f * scales.interval for f in (0.7, 3.0, 12.0, 50.0)]
        ends = _FASTEST * scales.interval, 300 * scales.interval
        found = []
        for order, second in ((1, ()), (2, (0.4,))):
            starts = columns(*[(time, *second) for time in scanned])
            traded = _traded(scales, cls.channel, *second)
            found.append(Candidate(cls(*ends, order), starts, traded=traded))
        return found


@register
@dataclass(frozen=True)
class SpeedFilter(_Filter):
    """Low-pass filter of first or second order in the logged speed, or a filter of its samples.

        tau dy/dt + q tau^2 d2y/dt2 = w - y,   logged speed = y             [rad/s]
        logged speed = (phi(t) - phi(t - 2 tau)) / (2 tau)                  [rad/s]
        y_k = (w_k + ... + w_(k-n+1)) / n,   n = 1 + 2 tau / h              [rad/s]
        y_k = a y_(k-1) + (1 - a) w_k,   a = exp(-h / tau)                  [rad/s]

    The first law is a filter, of first order if q is absent.  The second law is the mean over a
    window that ends at the sample, as from differenced counts of an encoder with angle phi; it has
    no parameter if the window is the sample interval h.  The others are filters of the samples.
    """

    name = "speed_filter"
    confusions = (INDUCTANCE,)
    drivers = ("speed",)
    channel = "speed"
    unit = "rad/s"
    laws = (SpeedMean, SpeedAverage, SpeedSampleAverage, SpeedRecursion)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return [*super().candidates(scales), *SpeedMean.candidates(scales)]


@register
@dataclass(frozen=True)
class CurrentFilter(_Filter):
    """Low-pass filter of first or second order in the logged current, or a filter of its samples.

        tau dy/dt + q tau^2 d2y/dt2 = i - y,   logged current = y           [A]
        logged current = mean of i over a window 2 tau that ends at the sample      [A]
        y_k = (i_k + ... + i_(k-n+1)) / n,   n = 1 + 2 tau / h              [A]
        y_k = a y_(k-1) + (1 - a) i_k,   a = exp(-h / tau)                  [A]

    The first law is a filter, of first order if q is absent.  The second law is that of integrating
    converters; it has no parameter if the window is the sample interval h.  The others are filters
    of the samples.
    """

    name = "current_filter"
    confusions = (INDUCTANCE,)
    drivers = ("current",)
    channel = "current"
    unit = "A"
    laws = (CurrentMean, CurrentAverage, CurrentSampleAverage, CurrentRecursion)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return [*super().candidates(scales), *CurrentMean.candidates(scales)]


@register
@dataclass(frozen=True)
class ChannelDelay(AbstractEffect, AbstractDelay):
    """Time delay of one channel against the others: logged(t) = x(t - delay) [s]."""

    name = "channel_delay"
    confusions = (INDUCTANCE,)
    drivers = ("time",)
    source = _SOURCE

    @property
    def variant(self) -> str:
        return self.channel

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter(
                "delay", "s", f"delay of the {self.channel} channel", scale=self.interval,
                lower=0.0, upper=(self.depth - 0.01) * self.interval, prior_sd=10.0,
            ),
        )  # fmt: skip

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        depth = 8
        starts = columns(*[(f * scales.interval,) for f in (0.5, 1.5, 3.5, 6.5)])
        # The current may jump at every voltage sample, so each interval can have a local optimum.
        tried = scales.interval * np.arange(0.5, depth, 0.5)[None, :]
        traded = {name: _traded(scales, name) for name in ("current", "speed")} | {"voltage": ()}
        return [
            Candidate(cls(name, depth, scales.interval), starts, tried=tried, traded=starting)
            for name, starting in traded.items()
        ]


class _Hold(AbstractEffect, AbstractHold):
    """Hold of the voltage between samples other than the assumed one, without parameters."""

    name = "input_hold"
    confusions = (INDUCTANCE,)
    drivers = ("voltage",)
    source = "Ljung, System Identification, 2nd edition, section 13.3"
    parameters = ()


@dataclass(frozen=True)
class LateVoltage(_Hold):
    """Voltage that is logged at the end of the interval over which it is held.

    A loop sets a voltage, waits for an interval, and then logs the voltage with the response.
    """

    law: str = "voltage logged at the end of its interval"
    """Name of the law in a result."""

    is_late = True

    @property
    def variant(self) -> str:
        return self.law

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return [Candidate(cls(), columns(()))]


@register
@dataclass(frozen=True)
class InputHold(_Hold):
    """Hold of the voltage between samples other than the assumed one.

    A first-order hold replaces a zero-order hold, or the reverse, or each row has the voltage that
    was held until its samples were taken.
    """

    laws = (LateVoltage,)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return [Candidate(cls(), columns(())), *LateVoltage.candidates(scales)]
