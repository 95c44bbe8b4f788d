"""Resistance or torque constant that is another one in some runs, or in each.

A longer cable or worn brushes change the resistance, a weaker magnet the torque constant.  A torque
constant (1 + g) times as large is the same motor as a speed sensor that reads 1 / (1 + g) times and
an inertia and friction of 1 / (1 + g)^2 times, and a temperature dependence that no law describes
looks the same in runs at a constant temperature.  Without this term, the search explains one cause
by two that are absent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from identification.effects.effect import CampaignScales, Candidate
from identification.effects.runs import first_of_several
from identification.model.term import AbstractCoefficient, Expression, Signals, Values
from identification.surrogates.gain import CHANGE, InEachRun, InSomeRuns, RelativeChange

__all__ = [
    "CoefficientChange",
    "ResistanceChange",
    "ResistanceOfRuns",
    "TorqueConstantChange",
    "TorqueConstantOfRuns",
]


class CoefficientChange(RelativeChange, AbstractCoefficient):
    """Factor on a coefficient of the nominal equations."""

    source = "Krishnan, Electric Motor Drives (2001), section 2.3"

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        return 1 + self.change(signals, states, values)


class _Resistance(CoefficientChange):
    equation = "electrical"
    drivers = ("current", "time")
    powers = {"Ra25": 1.0}  # noqa: RUF012  a constant


class _TorqueConstant(CoefficientChange):
    equation = "mechanical"
    drivers = ("current", "speed", "time")
    powers = {"Kt25": 1.0}  # noqa: RUF012  a constant


@dataclass(frozen=True)
class ResistanceChange(_Resistance, InSomeRuns):
    """Another resistance in some runs.

    Ra -> Ra (1 + g)   in these runs                                    [ohm]
    """

    coefficient: Literal["Ra"] = "Ra"

    @property
    def variant(self) -> str:
        return self.in_variant("another resistance")

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return cls.of(scales, cls(None))


@dataclass(frozen=True)
class TorqueConstantChange(_TorqueConstant, InSomeRuns):
    """Another torque constant in some runs.

    Kt -> Kt (1 + g)   in these runs                                    [N m/A]
    """

    coefficient: Literal["Kt"] = "Kt"

    @property
    def variant(self) -> str:
        return self.in_variant("another torque constant")

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return cls.of(scales, cls(None))


@dataclass(frozen=True)
class ResistanceOfRuns(_Resistance, InEachRun):
    """Another resistance in each run.

    Ra -> Ra (1 + g)   g free in each record, as a constant state       [ohm]

    g is zero in the first run.
    """

    coefficient: Literal["Ra"] = "Ra"

    @property
    def variant(self) -> str:
        return self.in_variant("another resistance")

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate if there are at least three runs."""
        return _of_each(cls, ResistanceChange.candidates(scales), scales)


@dataclass(frozen=True)
class TorqueConstantOfRuns(_TorqueConstant, InEachRun):
    """Another torque constant in each run.

    Kt -> Kt (1 + g)   g free in each record, as a constant state       [N m/A]

    g is zero in the first run.
    """

    coefficient: Literal["Kt"] = "Kt"

    @property
    def variant(self) -> str:
        return self.in_variant("another torque constant")

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate if there are at least three runs."""
        return _of_each(cls, TorqueConstantChange.candidates(scales), scales)


def _of_each(
    law: type[ResistanceOfRuns | TorqueConstantOfRuns],
    some: list[Candidate],
    scales: CampaignScales,
) -> list[Candidate]:
    first = first_of_several(scales)
    if first is None:
        return []
    return [replace(one, fitted=law(CHANGE, first=first)) for one in some]
