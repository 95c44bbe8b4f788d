"""Gain of a channel that is another one in some runs, after a change of range, sensor or supply.

One gain of a channel in all runs is not identifiable: with Kt from voltage and speed, a current
that reads g times gives Ra / g, L / g, J g and b g, a speed that reads g times gives Kt / g,
J / g^2 and b / g^2, and a voltage g times as large as logged gives g times every parameter.  The
ratio between runs is, because both balances show it.  `fit.gains` scales the currents before the
search if the ratio is so large that nothing else explains it; a smaller one competes with the
effects of the catalogue.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from identification.effects.effect import (
    AbstractEffect,
    AbstractRunEffect,
    CampaignScales,
    Candidate,
    runs_text,
)
from identification.effects.parameters import columns
from identification.effects.runs import EACH_RUN, AbstractRelativeRuns, first_of_several, in_runs
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractSensor,
    AbstractVoltage,
    Channel,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = [
    "CHANGE",
    "InEachRun",
    "InSomeRuns",
    "RelativeChange",
    "SensorGain",
    "SensorGainOfRuns",
    "VoltageGain",
    "VoltageGainOfRuns",
]

CHANGE: Final = 0.05
"""First guess of a relative change."""

_OF_CURRENT: Final = {"Ra25": -1.0, "L": -1.0, "J": 1.0, "b": 1.0}
_OF_SPEED: Final = {"Kt25": -1.0, "J": -2.0, "b": -2.0}
_OF_VOLTAGE: Final = {"Ra25": 1.0, "L": 1.0, "Kt25": 1.0, "J": 1.0, "b": 1.0}
"""Powers of a gain that multiply the parameters; see above."""


class RelativeChange(AbstractEffect):
    """Gain of a channel or coefficient of the motor, relative to that in other runs."""

    name = "unlisted"

    @property
    @abstractmethod
    def powers(self) -> Mapping[str, float]:
        """Powers of 1 + g by which parameters are larger if all runs have the change g."""

    @abstractmethod
    def change(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Relative change in the run of the signals [-]."""


@dataclass(frozen=True)
class InSomeRuns(AbstractRunEffect, RelativeChange):
    """Another value in one run or several runs."""

    scope = "some runs"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = f"relative change in {runs_text(self.runs)}"
        return (Parameter("change", "-", meaning, scale=0.1, lower=-0.9, upper=9.0, prior_sd=3.0),)

    def change(self, signals: Signals, states: Values, values: Values) -> Expression:
        return values.change * in_runs(signals, self.runs)

    def in_variant(self, words: str) -> str:
        """The words of a variant, and the runs."""
        return " ".join((words, super().variant)).strip()

    @staticmethod
    def of(scales: CampaignScales, *terms: InSomeRuns) -> list[Candidate]:
        """Candidates of terms for single runs and groups of runs, if there are several runs."""
        several = len(scales.runs) > 1
        return [Candidate(term, columns((CHANGE,))) for term in terms] if several else []


@dataclass(frozen=True)
class InEachRun(AbstractRelativeRuns, RelativeChange):
    """Another value in each run than in the first one."""

    gain_size: float
    """Standard deviation of the relative changes [-]."""

    amplitude_scale = "gain_size"

    @property
    def states(self) -> tuple[State, ...]:
        return (State("change", "-", scale=self.gain_size, is_own=True),)

    def change(self, signals: Signals, states: Values, values: Values) -> Expression:
        return self.relative(states.change, signals)

    def in_variant(self, words: str) -> str:
        """The words of a variant, and that of its values."""
        return f"{words}, {EACH_RUN}"


class _Gain(RelativeChange):
    """Gain of a channel."""

    source = (
        "Doebelin, Measurement Systems, 5th edition, chapter 3 (static sensitivity, scale factor)"
    )


@dataclass(frozen=True)
class _OfSensor(_Gain, AbstractSensor):
    """Gain of the current or the speed sensor."""

    channel: Channel
    """Channel of the sensor."""

    @property
    def drivers(self) -> tuple[str, ...]:
        return (self.channel, "time")

    @property
    def powers(self) -> Mapping[str, float]:
        return _OF_CURRENT if self.channel == "current" else _OF_SPEED

    def reading(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        return before + self.change(signals, states, values) * getattr(signals, self.channel)


class _OfVoltage(_Gain, AbstractVoltage):
    """Gain of the voltage."""

    drivers = ("voltage", "time")
    powers = _OF_VOLTAGE

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        return self.change(signals, states, values) * signals.voltage


@dataclass(frozen=True)
class SensorGain(_OfSensor, InSomeRuns):
    """Another gain of the current or the speed sensor in some runs.

    logged current = i (1 + g)   in these runs                          [A]
    logged speed   = w (1 + g)   in these runs                          [rad/s]
    """

    @property
    def variant(self) -> str:
        return self.in_variant(f"another gain of the {self.channel} sensor")

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return cls.of(scales, cls(None, "current"), cls(None, "speed"))


@dataclass(frozen=True)
class VoltageGain(_OfVoltage, InSomeRuns):
    """Another gain of the voltage in some runs, as by another supply of a commanded voltage.

    voltage = g v   in these runs                                       [V]
    """

    @property
    def variant(self) -> str:
        return self.in_variant("another gain of the voltage")

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return cls.of(scales, cls(None))


@dataclass(frozen=True)
class SensorGainOfRuns(_OfSensor, InEachRun):
    """Another gain of the current or the speed sensor in each run.

    logged current = i (1 + g)   g free in each record, as a constant state   [A]
    logged speed   = w (1 + g)                                                [rad/s]

    g is zero in the first run.
    """

    @property
    def variant(self) -> str:
        return self.in_variant(f"another gain of the {self.channel} sensor")

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate for each sensor if there are at least three runs."""
        first = first_of_several(scales)
        if first is None:
            return []
        return [
            replace(one, fitted=cls(CHANGE, one.term.channel, first=first))
            for one in SensorGain.candidates(scales)
            if isinstance(one.term, SensorGain)
        ]


@dataclass(frozen=True)
class VoltageGainOfRuns(_OfVoltage, InEachRun):
    """Another gain of the voltage in each run, as by batteries of another charge.

    voltage = g v, g free in each record, as a constant state           [V]

    g is zero in the first run.
    """

    @property
    def variant(self) -> str:
        return self.in_variant("another gain of the voltage")

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate if there are at least three runs."""
        first = first_of_several(scales)
        if first is None:
            return []
        found = VoltageGain.candidates(scales)
        return [replace(one, fitted=cls(CHANGE, first=first)) for one in found]
