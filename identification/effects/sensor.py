"""What the channels do to what they measure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from identification.effects.effect import Candidate, Survey, amplitude, columns, shape
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractDelay,
    AbstractHold,
    AbstractSensor,
    AbstractSupply,
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


@dataclass(frozen=True)
class _ZeroError(AbstractSensor):
    """A zero error of a sensor: logged = true + offset.

    Args:
        size: Natural size of the channel, in its unit.
    """

    size: float

    equation: ClassVar[str] = "sensor"
    drivers: ClassVar[tuple[str, ...]] = ()
    source: ClassVar[str] = _SOURCE
    unit: ClassVar[str]
    tried: ClassVar[float]  # prototype over the natural size

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """The zero error."""
        return (amplitude("offset", self.unit, "zero error", self.size, signed=True),)

    def logged(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        """Logged value, in the unit of the channel."""
        return before + values.offset

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure."""
        size = float(getattr(survey, cls.channel))
        return [Candidate(cls(size), columns((cls.tried * size,)))]


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
    """A zero error of the voltage sensor: terminal voltage = logged voltage - offset [V].

    Args:
        size: Natural voltage [V].
    """

    size: float

    name: ClassVar[str] = "voltage_offset"
    equation: ClassVar[str] = "sensor"
    drivers: ClassVar[tuple[str, ...]] = ()
    source: ClassVar[str] = _SOURCE

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """The zero error."""
        return (amplitude("offset", "V", "zero error", self.size, signed=True),)

    def supplied(self, before: Expression, signals: Signals, values: Values) -> Expression:
        """Terminal voltage [V]."""
        return before - values.offset

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure."""
        return [Candidate(cls(survey.voltage), columns((0.03 * survey.voltage,)))]


@dataclass(frozen=True)
class _Filter(AbstractSensor):
    """A low-pass of first order between the quantity and the log.

        dy/dt = (x - y) / tau,   logged = y

    Args:
        fastest: Shortest time constant the sampling shows [s].
        slowest: Longest [s].
    """

    fastest: float
    slowest: float

    equation: ClassVar[str] = "sensor"
    source: ClassVar[str] = _SOURCE

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """The time constant."""
        return (shape("time_constant", "s", "time constant", self.fastest, self.slowest),)

    def logged(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        """Logged value."""
        return states.filtered + 0 * before

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure, its time constant scanned."""
        term = cls(0.1 * survey.interval, 300 * survey.interval)
        scanned = (0.7, 3.0, 12.0, 50.0)
        return [Candidate(term, columns(*[(f * survey.interval,) for f in scanned]))]


@dataclass(frozen=True)
class SpeedFilter(_Filter):
    """The logged speed went through a low-pass, dy/dt = (w - y) / tau."""

    name: ClassVar[str] = "speed_filter"
    drivers: ClassVar[tuple[str, ...]] = ("speed",)
    channel: ClassVar[str] = "speed"
    states: ClassVar[tuple[State, ...]] = (State("filtered", "rad/s", "speed"),)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Rate of the filtered speed [rad/s^2]."""
        return [(signals.speed - states.filtered) / values.time_constant]


@dataclass(frozen=True)
class CurrentFilter(_Filter):
    """The logged current went through a low-pass, dy/dt = (i - y) / tau."""

    name: ClassVar[str] = "current_filter"
    drivers: ClassVar[tuple[str, ...]] = ("current",)
    channel: ClassVar[str] = "current"
    states: ClassVar[tuple[State, ...]] = (State("filtered", "A", "current"),)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Rate of the filtered current [A/s]."""
        return [(signals.current - states.filtered) / values.time_constant]


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
        return [
            Candidate(cls(channel, depth, survey.interval), starts)
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
