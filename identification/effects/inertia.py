"""Inertia that is another one in some runs, or in each run, as on a bench with several discs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import casadi as ca

from identification.effects.confusion import SINGLE_RUN
from identification.effects.effect import (
    AbstractEffect,
    AbstractRunEffect,
    CampaignScales,
    Candidate,
    register,
    runs_text,
)
from identification.effects.parameters import columns
from identification.effects.runs import (
    EACH_RUN,
    AbstractRelativeRuns,
    first_of_several,
    in_runs,
)
from identification.model.parameter import Parameter
from identification.model.term import AbstractCoefficient, Expression, Signals, State, Values

__all__ = ["InertiaChange", "InertiaOfRuns"]

_SPREAD: Final = 0.2
"""First guess of the logarithms of the inertias over J."""


class _Inertia(AbstractEffect, AbstractCoefficient):
    """Factor on J."""

    name = "inertia_change"
    equation = "mechanical"
    drivers = ("time",)
    source = "Krishnan, Electric Motor Drives (2001), section 2.3"
    coefficient = "J"


@dataclass(frozen=True)
class InertiaOfRuns(AbstractRelativeRuns, _Inertia):
    """Inertia that differs from run to run.

    J -> J exp(c), c free in each record, as a constant state           [kg m^2]

    The logarithm has no bounds.  It is zero in the first run, of which J is the inertia.  The
    setting `log_ratio_size` in a result is the root mean square of c in the other runs.
    """

    log_ratio_size: float
    """Standard deviation of c [-]."""

    amplitude_scale = "log_ratio_size"
    variant = EACH_RUN

    @property
    def states(self) -> tuple[State, ...]:
        return (State("log_ratio", "-", scale=self.log_ratio_size, is_own=True),)

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        return ca.exp(self.relative(states.log_ratio, signals))

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate if there are at least three runs."""
        first = first_of_several(scales)
        if first is None:
            return []
        scored, fitted = InertiaChange(None), cls(_SPREAD, first=first)
        return [Candidate(scored, columns((_SPREAD,)), fitted=fitted)]


@register
@dataclass(frozen=True)
class InertiaChange(AbstractRunEffect, _Inertia):
    """Different inertia in one run or several runs, after a change of coupling or load.

        J -> J (1 + d)   in these runs                                      [kg m^2]

    If the inertia is another one in each run, as with several discs, the factor on J is exp(c) with
    a `log_ratio` c that is free in each record, as a constant state; it is zero in the first run,
    of which J is the inertia.  The setting `log_ratio_size` in a result is then the root mean
    square of c.

    With a second inertia behind an elastic shaft, both change by this factor.
    """

    confusions = (SINGLE_RUN,)
    scope = "some runs"
    laws = (InertiaOfRuns,)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = f"relative change of the inertia in {runs_text(self.runs)}"
        return (
            Parameter("change", "-", meaning, scale=0.1, lower=-0.9, upper=20.0, prior_sd=10.0),
        )

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        return 1 + values.change * in_runs(signals, self.runs)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        if len(scales.runs) < 2:
            return []
        some = Candidate(cls(None), columns((0.2,), (-0.15,)))
        return [some, *InertiaOfRuns.candidates(scales)]
