"""Runs whose temperature was not logged: each has one of its own, a parameter of the model.

What tells it is the resistance, as where a winding's temperature is measured by its resistance,
and the torque constant.  It takes another temperature to compare with; where none was logged that
of the first run is called 25 degC.  Then nothing tells how much warmer the others were, but by the
coefficient that resistances have: it is held there, so that a temperature and a coefficient that
only have a known product do not have to be searched along a hyperbola.

No motor keeps its temperature while it is driven, so each such run warms evenly by a second
parameter.

A bench without a thermometer stands in a room, and self-heating ends where the insulation does:
beyond these limits it is not heat that changes the resistance.

Source: IEC 60034-1, clause 6 (ambient air of 0 to 40 degC); IEC 60085 (thermal class F, 155 degC).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import casadi as ca

from identification.model.parameter import Parameter
from identification.model.term import Expression
from identification.quantities import REFERENCE_TEMPERATURE_DEGC

__all__ = ["COLDEST", "HOTTEST", "RAMP", "WARMING", "Unlogged"]

RAMP: Final = 0.5
"""Rise over a run that stands for an unknown temperature, small against any that is known [K]."""

COLDEST: Final = 0.0
"""Lowest temperature of a winding on a bench in a room [degC]."""

HOTTEST: Final = 155.0
"""Highest temperature of a winding of thermal class F [degC]."""

_SPREAD: Final = 30.0
"""Standard deviation of a temperature that nobody logged [K]."""

WARMING: Final = 10.0
"""Standard deviation of what a run warms by [K]."""

_HELD: Final = 1e-2
"""Standard deviation of a coefficient that is held, over its scale."""


@dataclass(frozen=True)
class Unlogged:
    """Temperatures that are parameters of a model.

    Args:
        runs: Numbers of the runs that have one.
        expected: Temperature around which they are expected [degC].
        reference: Which of them is called to have that one in its middle; None where others tell.
        is_relative: Whether no two logged temperatures tell what a kelvin does.
    """

    runs: tuple[int, ...] = ()
    expected: float = REFERENCE_TEMPERATURE_DEGC
    reference: int | None = None
    is_relative: bool = False

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """What each run warms by, and its temperature in the middle, but that of the reference."""
        warming = [self._warming(run) for run in self.runs]
        return (*warming, *[self._middle(run) for run in self.runs if run != self.reference])

    def of(self, logged: Expression, run: Expression, values: Sequence[Expression]) -> Expression:
        """Temperature of a run [degC].

        Args:
            logged: The logged one or, where none was, a rise by `RAMP` around the expected [degC].
            run: Number of the run.
            values: One for each of `parameters`.
        """
        middles = iter(values[len(self.runs) :])
        passed = (logged - self.expected) / RAMP
        for own, warming in zip(self.runs, values, strict=False):
            middle = self.expected if own == self.reference else next(middles)
            logged = ca.if_else(ca.fabs(run - own) < 0.5, middle + warming * passed, logged)
        return logged

    def held(self, declared: Sequence[Parameter]) -> tuple[Parameter, ...]:
        """The declared parameters, with the coefficient held that makes temperatures of ratios."""
        return tuple(
            replace(p, prior_sd=_HELD) if self.is_relative and p.name == "alpha_Ra" else p
            for p in declared
        )

    def _warming(self, run: int) -> Parameter:
        return Parameter(
            f"warming_of_run_{run + 1}",
            "K",
            f"what run {run + 1} warmed by, which was not logged",
            lower=-100.0,
            upper=200.0,
            scale=WARMING,
            prior_sd=1.0,
        )

    def _middle(self, run: int) -> Parameter:
        return Parameter(
            f"temperature_of_run_{run + 1}",
            "degC",
            f"temperature of run {run + 1}, which was not logged",
            lower=min(COLDEST, self.expected - _SPREAD),
            upper=max(HOTTEST, self.expected + _SPREAD),
            scale=_SPREAD,
            prior_mean=self.expected,
            prior_sd=1.0,
        )
