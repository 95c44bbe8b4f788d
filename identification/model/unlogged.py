"""Unknown run temperatures as model parameters, for runs without a logged temperature.

The armature resistance determines such a temperature, as in the resistance method for winding
temperatures; so does the torque constant.  Both need a reference temperature.  If no run has a
logged temperature, the first run is defined to be at 25 degC.  If the logged temperatures span too
little, the data determine only the products of temperature coefficients and temperature
differences, and a fit with both free would search along a hyperbola; the temperature coefficient
of the resistance is then held by a narrow prior.

No motor keeps its temperature while it is driven, so a second parameter of each such run is a
linear temperature rise.

The bounds are physical: a bench without a thermometer stands in a room, and the thermal class of
the insulation limits self-heating.  Beyond them, something other than heat changes the resistance.

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
"""Total rise of the placeholder ramp for an unknown temperature, small against real rises [K]."""

COLDEST: Final = 0.0
"""Lowest temperature of a winding on a bench in a room [degC]."""

HOTTEST: Final = 155.0
"""Highest temperature of a winding of thermal class F [degC]."""

_SPREAD: Final = 30.0
"""Prior standard deviation of an unlogged temperature [K]."""

WARMING: Final = 10.0
"""Prior standard deviation of the temperature rise over a run [K]."""

_HELD: Final = 1e-2
"""Prior standard deviation of a held coefficient, relative to its scale."""


@dataclass(frozen=True)
class Unlogged:
    """Run temperatures that are parameters of a model."""

    runs: tuple[int, ...] = ()
    """Indices of these runs."""
    expected: float = REFERENCE_TEMPERATURE_DEGC
    """Prior mean of their temperatures [degC]."""
    reference: int | None = None
    """Run whose mid-run temperature is fixed at `expected`; None if any run has a logged
    temperature."""
    is_relative: bool = False
    """True if the logged temperatures, if any, span too little to determine the temperature
    coefficients."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Temperature rise of each run, then mid-run temperature of each run but the reference."""
        warming = [self._warming(run) for run in self.runs]
        return (*warming, *[self._middle(run) for run in self.runs if run != self.reference])

    def of(self, logged: Expression, run: Expression, values: Sequence[Expression]) -> Expression:
        """Temperature of a run by its index [degC], with one value for each of `parameters`.

        Without a logged temperature, `logged` is a ramp by `RAMP` around `expected` [degC].
        """
        middles = iter(values[len(self.runs) :])
        passed = (logged - self.expected) / RAMP
        for own, warming in zip(self.runs, values, strict=False):
            middle = self.expected if own == self.reference else next(middles)
            logged = ca.if_else(ca.fabs(run - own) < 0.5, middle + warming * passed, logged)
        return logged

    def held(self, declared: Sequence[Parameter]) -> tuple[Parameter, ...]:
        """Nominal parameters, with a narrow prior on alpha_Ra if `is_relative`."""
        return tuple(
            replace(p, prior_sd=_HELD) if self.is_relative and p.name == "alpha_Ra" else p
            for p in declared
        )

    def _warming(self, run: int) -> Parameter:
        return Parameter(
            f"warming_of_run_{run + 1}", "K", f"what run {run + 1} warmed by, which was not logged",
            lower=-100.0, upper=200.0, scale=WARMING, prior_sd=1.0,
        )  # fmt: skip

    def _middle(self, run: int) -> Parameter:
        return Parameter(
            f"temperature_of_run_{run + 1}", "degC",
            f"temperature of run {run + 1}, which was not logged",
            lower=min(COLDEST, self.expected - _SPREAD),
            upper=max(HOTTEST, self.expected + _SPREAD), scale=_SPREAD, prior_mean=self.expected,
            prior_sd=1.0,
        )  # fmt: skip
