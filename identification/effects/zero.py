"""Zero errors (offsets) of the sensors: constant, with drift over the runs, or free per record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Final

from identification.effects.confusion import CONSTANT_TORQUE, CONSTANT_VOLTAGE
from identification.effects.effect import AbstractEffect, CampaignScales, Candidate, register
from identification.effects.parameters import amplitude, columns
from identification.effects.runs import EACH_RUN
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractSensor,
    AbstractSupply,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = ["CurrentOffset", "SpeedOffset", "VoltageOffset"]

_DRIFTING: Final = "drift from run to run"
_FEWEST_RUNS: Final = 3
"""Least number of runs that reveal a drift from run to run."""


@dataclass(frozen=True)
class _ZeroError(AbstractEffect):
    """Zero error of a sensor: offset + drift k in the k-th run, counted from 0."""

    size: float
    """Scale of the channel, in its unit."""
    drifts: bool = False
    """True if the error changes linearly with the run number."""

    drivers = ()
    source = (
        "Doebelin, Measurement Systems, 5th edition, chapter 3 (zero-, first- and second-order)"
    )
    unit: ClassVar[str]
    tried: ClassVar[float]  # zero error of the prototype over the scale of the channel

    @property
    def variant(self) -> str:
        return _DRIFTING if self.drifts else ""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        unit, step = self.unit, 0.1 * self.size
        offset = amplitude("offset", unit, "zero error", self.size, signed=True)
        drift = amplitude("drift", unit, "change of the zero error per run", step, signed=True)
        return (offset, drift) if self.drifts else (offset,)

    def flaw(self, values: Mapping[str, float]) -> str:
        """Reason to reject a zero error above the RMS value of the logged channel; else empty.

        The true signal would then have the other sign than its log.
        """
        error = abs(values.get("offset", 0.0))
        if error <= self.size:
            return ""
        return (
            f"implausible: zero error {error:.3g} {self.unit}, expected at most the RMS value of "
            f"the channel ({self.size:.3g} {self.unit}); the term acts as another law"
        )

    def _error(self, signals: Signals, values: Values) -> Expression:
        return values.offset + values.drift * signals.run if self.drifts else values.offset

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        size = {"A": scales.current, "rad/s": scales.speed, "V": scales.voltage}[cls.unit]
        tried = cls.tried * size
        constant = Candidate(cls(size), columns((tried,)))
        drifting = Candidate(cls(size, True), columns((tried, 0.0), (0.0, 0.1 * tried)), joint=2)
        return [constant, drifting] if len(scales.runs) >= _FEWEST_RUNS else [constant]


@dataclass(frozen=True)
class _SensorZero(_ZeroError, AbstractSensor):
    """Zero error of a logged channel, added to its reading."""

    def reading(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        return before + self._error(signals, values)


@register
@dataclass(frozen=True)
class CurrentOffset(_SensorZero):
    """Zero error of the current sensor: logged current = i + offset [A].

    The zero of a Hall sensor drifts with its temperature and its magnetic history.  If the error
    changes irregularly from run to run, it is free in each record, as a constant state.  The
    setting `size` in a result is then the root mean square of these errors [A].
    """

    own: bool = False
    """True if the error is free in each record."""

    name = "current_offset"
    amplitude_scale = "size"
    confusions = (CONSTANT_TORQUE,)
    channel = "current"
    unit = "A"
    tried = 0.05

    @property
    def variant(self) -> str:
        return EACH_RUN if self.own else super().variant

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return () if self.own else super().parameters

    @property
    def varies(self) -> bool:
        return self.own

    @property
    def states(self) -> tuple[State, ...]:
        return (State("offset", "A", scale=self.size, is_own=True),) if self.own else ()

    @property
    def richer(self) -> tuple[CurrentOffset, ...]:
        """The variant with an error free in each record, unless it is that already."""
        return () if self.own else (CurrentOffset(self.size, own=True),)

    def reading(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        if self.own:
            return before + states.offset
        return super().reading(before, signals, states, values)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """A constant error and, with several runs, one free in each record: it covers any drift."""
        constant, *_ = super().candidates(scales)
        own = replace(constant, fitted=cls(scales.current, own=True))
        return [constant, own] if len(scales.runs) > 1 else [constant]


@register
@dataclass(frozen=True)
class SpeedOffset(_SensorZero):
    """Zero error of the speed sensor: logged speed = w + offset [rad/s]."""

    name = "speed_offset"
    confusions = (CONSTANT_VOLTAGE,)
    channel = "speed"
    unit = "rad/s"
    tried = 0.02


@register
@dataclass(frozen=True)
class VoltageOffset(_ZeroError, AbstractSupply):
    """Zero error of the voltage sensor.

    terminal voltage = logged voltage - offset - drift k   in run k = 0, 1, ...         [V]
    """

    name = "voltage_offset"
    confusions = (CONSTANT_VOLTAGE,)
    unit = "V"
    tried = 0.03

    def supplied(self, before: Expression, signals: Signals, values: Values) -> Expression:
        return before - self._error(signals, values)
