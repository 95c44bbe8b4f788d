"""Delays, filters and means of the channels, and the voltage between samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from identification.effects.effect import Candidate, Survey, columns, shape
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractDelay,
    AbstractHold,
    AbstractMean,
    AbstractSensor,
    AbstractTerm,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = [
    "ChannelDelay",
    "CurrentFilter",
    "InputHold",
    "SpeedFilter",
]

_SOURCE = "Doebelin, Measurement Systems, 5th edition, chapter 3 (zero-, first- and second-order)"


Array = NDArray[np.float64]

_INDUCTANCES = (0.5, 0.2, 0.05)
"""Shares of a fitted inductance that may be left of it beside a filter of the current."""


@dataclass(frozen=True)
class _Filter(AbstractSensor):
    """A low-pass of first or second order between the quantity and the log.

        tau dy/dt + q tau^2 d2y/dt2 = x - y,   logged = y

    With q = 1/4 it is two equal stages, 1/3 is near a moving average, 1/2 is Butterworth's.

    Args:
        fastest: Shortest time constant the sampling shows [s].
        slowest: Longest [s].
        order: 1, with q = 0, or 2.
    """

    fastest: float
    slowest: float
    order: int = 1

    equation: ClassVar[str] = "sensor"
    source: ClassVar[str] = _SOURCE
    unit: ClassVar[str]

    @property
    def variant(self) -> str:
        """Its order, where that is not the usual one."""
        return "second order" if self.order == 2 else ""

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """The time constant, and what makes it a filter of second order."""
        time = shape("time_constant", "s", "time constant", self.fastest, self.slowest)
        second = shape("second", "-", "coefficient q of the second order", 0.05, 2.0)
        return (time, second) if self.order == 2 else (time,)

    @property
    def states(self) -> tuple[State, ...]:  # type: ignore[override]
        """What is logged, and for second order its rate times the time constant."""
        filtered = State("filtered", self.unit, self.channel, fades=True)  # type: ignore[arg-type]
        rise = State("rise", self.unit, fades=True)
        return (filtered, rise) if self.order == 2 else (filtered,)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Rates of the states [unit of the channel / s]."""
        lag = getattr(signals, self.channel) - states.filtered
        if self.order == 1:
            return [lag / values.time_constant]
        return [
            states.rise / values.time_constant,
            (lag - states.rise) / (values.second * values.time_constant),
        ]

    def logged(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        """Logged value."""
        return states.filtered + 0 * before

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure of each order, its time constant scanned."""
        scanned = [f * survey.interval for f in (0.7, 3.0, 12.0, 50.0)]
        ends = 0.1 * survey.interval, 300 * survey.interval
        return [
            Candidate(
                cls(*ends), columns(*[(time,) for time in scanned]), traded=cls._traded(survey, ())
            ),
            Candidate(
                cls(*ends, 2),
                columns(*[(time, 0.4) for time in scanned]),
                traded=cls._traded(survey, (0.4,)),
            ),
        ]

    @classmethod
    def _traded(
        cls, survey: Survey, shape: tuple[float, ...]
    ) -> tuple[tuple[Array, dict[str, float]], ...]:
        """Places at which declared parameters give back what they had taken of the lag."""
        return ()


@dataclass(frozen=True)
class SpeedMean(AbstractMean):
    """The logged speed is the mean over the sample interval: encoder counts, differenced.

    Args:
        law: The word for it in a result.
    """

    law: str = "mean over the sample interval"

    name: ClassVar[str] = "speed_filter"
    equation: ClassVar[str] = "sensor"
    drivers: ClassVar[tuple[str, ...]] = ("speed",)
    channel: ClassVar[str] = "speed"
    source: ClassVar[str] = (
        "Petrella, Tursini, Peretti and Zigliotto, Proc. ACEMP (2007), 780-787 (speed from counts)"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = ()

    @property
    def variant(self) -> str:
        """The law."""
        return self.law


@dataclass(frozen=True)
class SpeedFilter(_Filter):
    """The logged speed went through a low-pass of first or second order, or is a mean.

        tau dy/dt + q tau^2 d2y/dt2 = w - y,   logged speed = y             [rad/s]
        logged speed = (phi(t) - phi(t - h)) / h                            [rad/s]

    Without q the first is of first order.  The second is the mean over the sample interval h that
    ends with the sample, as of encoder counts that are differenced; it has no parameter.
    """

    name: ClassVar[str] = "speed_filter"
    drivers: ClassVar[tuple[str, ...]] = ("speed",)
    channel: ClassVar[str] = "speed"
    unit: ClassVar[str] = "rad/s"
    laws: ClassVar[tuple[type[AbstractTerm], ...]] = (SpeedMean,)

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """A low-pass of each order, its time constant scanned, and the mean."""
        return [*super().candidates(survey), Candidate(SpeedMean(), columns(()))]


@dataclass(frozen=True)
class CurrentFilter(_Filter):
    """The logged current went through a low-pass of first or second order.

    tau dy/dt + q tau^2 d2y/dt2 = i - y,   logged current = y           [A]

    Without q it is of first order.
    """

    name: ClassVar[str] = "current_filter"
    drivers: ClassVar[tuple[str, ...]] = ("current",)
    channel: ClassVar[str] = "current"
    unit: ClassVar[str] = "A"

    @classmethod
    def _traded(
        cls, survey: Survey, shape: tuple[float, ...]
    ) -> tuple[tuple[Array, dict[str, float]], ...]:
        """A current that lags looks like a larger inductance: the two lags L / R + tau are kept."""
        lag = float(survey.values[6] / survey.values[0])
        return tuple(
            (np.array([(1.0 - share) * lag, *shape]), {"L": share}) for share in _INDUCTANCES
        )


@dataclass(frozen=True)
class ChannelDelay(AbstractDelay):
    """One channel lags the others by a time: logged(t) = x(t - delay) [s].

    Args:
        channel: The channel that lags; ``voltage`` lagging is both others leading.
        depth: Samples kept.
        interval: Sample interval [s].
    """

    channel: str
    depth: int
    interval: float

    name: ClassVar[str] = "channel_delay"
    equation: ClassVar[str] = "sensor"
    drivers: ClassVar[tuple[str, ...]] = ("time",)
    source: ClassVar[str] = _SOURCE

    @property
    def variant(self) -> str:
        """The channel."""
        return self.channel

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """The delay."""
        return (
            Parameter(
                "delay",
                "s",
                f"lag of the {self.channel} channel",
                scale=self.interval,
                lower=0.0,
                upper=(self.depth - 0.01) * self.interval,
                prior_sd=10.0,
            ),
        )

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure a channel."""
        depth = 8
        starts = columns(*[(f * survey.interval,) for f in (0.5, 1.5, 3.5, 6.5)])
        # A current may jump with every sample of the voltage: each interval has an optimum.
        tried = survey.interval * np.arange(0.5, depth, 0.5)[None, :]
        return [
            Candidate(cls(channel, depth, survey.interval), starts, tried=tried)
            for channel in ("current", "speed", "voltage")
        ]


@dataclass(frozen=True)
class InputHold(AbstractHold):
    """Between samples the voltage behaves the other way than declared: held or linear."""

    name: ClassVar[str] = "input_hold"
    equation: ClassVar[str] = "sensor"
    drivers: ClassVar[tuple[str, ...]] = ("voltage",)
    source: ClassVar[str] = "Ljung, System Identification, 2nd edition, section 13.3"
    parameters: ClassVar[tuple[Parameter, ...]] = ()

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure without parameters."""
        return [Candidate(cls(), columns(()))]
