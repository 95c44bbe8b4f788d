"""What the channels do to what they measure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from identification.effects.effect import Candidate, Survey, amplitude, columns, shape
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractDelay,
    AbstractHold,
    AbstractMean,
    AbstractSensor,
    AbstractSupply,
    AbstractTerm,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = [
    "ChannelDelay",
    "CurrentFilter",
    "CurrentOffset",
    "InputHold",
    "SpeedFilter",
    "SpeedOffset",
    "VoltageOffset",
]

_SOURCE = "Doebelin, Measurement Systems, 5th edition, chapter 3 (zero-, first- and second-order)"


Array = NDArray[np.float64]

_DRIFTING = "from run to run"
_FEWEST_RUNS = 3
_INDUCTANCES = (0.5, 0.2, 0.05)
"""Shares of a fitted inductance that may be left of it beside a filter of the current."""


def _forms(survey: Survey) -> tuple[bool, ...]:
    """Whether to look for constant zero errors, and for those that move."""
    return (False, True) if len(survey.runs) >= _FEWEST_RUNS else (False,)


def _zero_error(unit: str, size: float, drifts: bool) -> tuple[Parameter, ...]:
    offset = amplitude("offset", unit, "zero error", size, signed=True)
    drift = amplitude("drift", unit, "what it gains from run to run", 0.1 * size, signed=True)
    return (offset, drift) if drifts else (offset,)


def _error_in_run(signals: Signals, values: Values, drifts: bool) -> Expression:
    return values.offset + values.drift * signals.run if drifts else values.offset


def _zero_starts(size: float, drifts: bool) -> Array:
    return columns((size, 0.0), (0.0, 0.1 * size)) if drifts else columns((size,))


@dataclass(frozen=True)
class _ZeroError(AbstractSensor):
    """A zero error of a sensor: logged = true + offset + drift k in the k-th run, counted from 0.

    Args:
        size: Natural size of the channel, in its unit.
        drifts: Whether the error moves from run to run.
    """

    size: float
    drifts: bool = False

    equation: ClassVar[str] = "sensor"
    drivers: ClassVar[tuple[str, ...]] = ()
    source: ClassVar[str] = _SOURCE
    unit: ClassVar[str]
    tried: ClassVar[float]  # prototype over the natural size

    @property
    def variant(self) -> str:
        """Whether it moves."""
        return _DRIFTING if self.drifts else ""

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """The zero error, and how far it moves."""
        return _zero_error(self.unit, self.size, self.drifts)

    def logged(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        """Logged value, in the unit of the channel."""
        return before + _error_in_run(signals, values, self.drifts)

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """A constant one, and one that moves where there are runs enough to tell."""
        size = float(getattr(survey, cls.channel))
        return [
            Candidate(cls(size, drifts), _zero_starts(cls.tried * size, drifts), joint=1 + drifts)
            for drifts in _forms(survey)
        ]


@dataclass(frozen=True)
class CurrentOffset(_ZeroError):
    """A zero error of the current sensor: logged current = i + offset [A]."""

    name: ClassVar[str] = "current_offset"
    channel: ClassVar[str] = "current"
    unit: ClassVar[str] = "A"
    tried: ClassVar[float] = 0.05


@dataclass(frozen=True)
class SpeedOffset(_ZeroError):
    """A zero error of the speed sensor: logged speed = w + offset [rad/s]."""

    name: ClassVar[str] = "speed_offset"
    channel: ClassVar[str] = "speed"
    unit: ClassVar[str] = "rad/s"
    tried: ClassVar[float] = 0.02


@dataclass(frozen=True)
class VoltageOffset(AbstractSupply):
    """A zero error of the voltage sensor.

        terminal voltage = logged voltage - offset - drift k   in the k-th run, from 0      [V]

    Args:
        size: Natural voltage [V].
        drifts: Whether the error moves from run to run.
    """

    size: float
    drifts: bool = False

    name: ClassVar[str] = "voltage_offset"
    equation: ClassVar[str] = "sensor"
    drivers: ClassVar[tuple[str, ...]] = ()
    source: ClassVar[str] = _SOURCE

    @property
    def variant(self) -> str:
        """Whether it moves."""
        return _DRIFTING if self.drifts else ""

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """The zero error, and how far it moves."""
        return _zero_error("V", self.size, self.drifts)

    def supplied(self, before: Expression, signals: Signals, values: Values) -> Expression:
        """Terminal voltage [V]."""
        return before - _error_in_run(signals, values, self.drifts)

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """A constant one, and one that moves where there are runs enough to tell."""
        size = survey.voltage
        return [
            Candidate(cls(size, drifts), _zero_starts(0.03 * size, drifts), joint=1 + drifts)
            for drifts in _forms(survey)
        ]


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
