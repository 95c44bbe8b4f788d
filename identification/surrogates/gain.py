"""Gain of a channel that is another one in some runs, after a change of range, sensor or supply.

One gain of a channel in all runs is not identifiable: with Kt from voltage and speed, a current
that reads g times gives Ra / g, L / g, J g and b g.  The ratio between runs is, because resistance
and inertia both show it.  `fit.gains` scales the currents before the search if the ratio is so
large that nothing else explains it; a smaller one competes with the effects of the catalogue.
"""

from __future__ import annotations

from dataclasses import dataclass

from identification.effects.effect import AbstractRunEffect, CampaignScales, Candidate, runs_text
from identification.effects.parameters import columns
from identification.effects.runs import in_runs
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractSensor,
    AbstractVoltage,
    Expression,
    Signals,
    Values,
)

__all__ = ["CurrentGain", "VoltageGain"]


@dataclass(frozen=True)
class _Gain(AbstractRunEffect):
    """Gain of a channel in one run or several runs, relative to that in the others."""

    name = "unlisted"
    scope = "some runs"
    source = (
        "Doebelin, Measurement Systems, 5th edition, chapter 3 (static sensitivity, scale factor)"
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = f"relative change of the gain in {runs_text(self.runs)}"
        return (Parameter("change", "-", meaning, scale=0.1, lower=-0.9, upper=9.0, prior_sd=3.0),)

    def _change(self, signals: Signals, values: Values) -> Expression:
        return values.change * in_runs(signals, self.runs)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate for single runs and groups of runs, if there are several runs."""
        return [Candidate(cls(None), columns((0.05,)))] if len(scales.runs) > 1 else []


@dataclass(frozen=True)
class CurrentGain(_Gain, AbstractSensor):
    """Another gain of the current sensor in some runs.

    logged current = i (1 + g)   in these runs                          [A]
    """

    drivers = ("current", "time")
    channel = "current"

    @property
    def variant(self) -> str:
        return " ".join(("another gain of the current sensor", super().variant)).strip()

    def reading(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        return before + self._change(signals, values) * signals.current


@dataclass(frozen=True)
class VoltageGain(_Gain, AbstractVoltage):
    """Another gain of the voltage in some runs, as by another supply of a commanded voltage.

    voltage = g v   in these runs                                       [V]
    """

    drivers = ("voltage", "time")

    @property
    def variant(self) -> str:
        return " ".join(("another gain of the voltage", super().variant)).strip()

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        return self._change(signals, values) * signals.voltage
