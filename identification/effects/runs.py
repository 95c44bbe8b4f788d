"""Laws that hold in some runs of a campaign, or whose size differs from run to run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

import casadi as ca

from identification.effects.effect import AbstractEffect, CampaignScales
from identification.model.parameter import Parameter
from identification.model.term import Expression, Signals, State, Values

__all__ = ["EACH_RUN", "AbstractExcess", "AbstractRelativeRuns", "first_of_several", "in_runs"]

EACH_RUN: Final = "separate value for each run"
"""Variant of an effect whose size is free in each record."""

_FEWEST_RUNS: Final = 3
"""Least number of runs of which each may differ from the others."""


@dataclass(frozen=True, kw_only=True)
class AbstractExcess(AbstractEffect):
    """Effect whose size in a variant has an `excess`, free in each record, over a common value."""

    unit: ClassVar[str]
    """Unit of the size."""
    common: ClassVar[str]
    """Parameter with the value of all runs, which is positive."""

    several: bool = False
    """True if there are several runs, which may differ."""
    spread: float = 0.0
    """Standard deviation of the excess of a run, in its unit; zero if all runs have one size."""

    amplitude_scale = "spread"

    @property
    def varies(self) -> bool:
        return self.spread > 0.0

    @property
    def states(self) -> tuple[State, ...]:
        return (State("excess", self.unit, scale=self.spread, is_own=True),) if self.varies else ()

    def flaw(self, values: Mapping[str, float]) -> str:
        """Reason to reject sizes that would be negative in some runs; else empty.

        A normal distribution with a standard deviation above its mean has a sixth of its values
        below zero.
        """
        spread, common = values.get("spread", 0.0), values[self.common]
        if not self.varies or common >= spread:
            return ""
        return (
            f"implausible: differences of {spread:.3g} {self.unit} between the runs, expected at "
            f"most the common value ({common:.3g} {self.unit}), as no size is negative; the term "
            "acts as another law"
        )

    def in_variant(self, words: str) -> str:
        """The words of another variant, if any, and that of the excess, if it has one."""
        return ", ".join(word for word in (words, EACH_RUN if self.varies else "") if word)

    def of_run(self, common: Expression, states: Values) -> Expression:
        """Size in a run, of which `common` is the value of all runs."""
        return common + states.excess if self.varies else common


@dataclass(frozen=True, kw_only=True)
class AbstractRelativeRuns(AbstractEffect):
    """Effect with a size in each run relative to the first one, where it is zero by definition.

    A size that all runs have in common would be the same as other nominal parameters.
    """

    first: int
    """Number of the first run."""

    varies = True

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return ()

    @property
    def reference_run(self) -> int:
        return self.first

    def relative(self, size: Expression, signals: Signals) -> Expression:
        """Size in a run: the state `size`, or zero in the first one."""
        return size * (1 - in_runs(signals, (self.first,)))


def first_of_several(scales: CampaignScales) -> int | None:
    """Number of the first run; None if there are fewer than three.

    Of two runs, one has another size than the other.
    """
    return min(scales.runs) if len(scales.runs) >= _FEWEST_RUNS else None


def in_runs(signals: Signals, runs: Sequence[int]) -> Expression:
    """Factor that is one in these runs and zero elsewhere; one everywhere without runs [-]."""
    if not runs:
        return ca.SX(1)
    return sum((ca.fabs(signals.run - one) < 0.5 for one in runs), ca.SX(0))
