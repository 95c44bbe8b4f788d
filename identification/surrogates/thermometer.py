"""Error of the thermometer that differs from run to run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca

from identification.effects.effect import AbstractEffect, CampaignScales, Candidate
from identification.effects.parameters import amplitude, columns
from identification.model.parameter import Parameter
from identification.model.term import AbstractTemperature, Expression, Signals, State, Values

__all__ = ["ThermometerError"]

_TRIED = 5.0
"""Error of the prototype [K]."""
_FEWEST_RUNS = 3
"""Least number of runs: two errors are as many unknowns as two temperature coefficients."""


@dataclass(frozen=True)
class ThermometerError(AbstractEffect, AbstractTemperature):
    """Error of the logged temperature, constant within a run and different in each.

        T_w = T_m = T + e_k                     in run k                     [degC]

    A thermometer on the housing shows neither winding nor magnet while a motor warms up in an oven,
    or cools after a run.  In runs that are short beside the thermal time constants the difference
    is constant.  A part of the errors in proportion to T - 25 degC scales both temperature
    coefficients and cannot be seen.  The setting `size` in a result is the root mean square of the
    errors [K].
    """

    size: float
    """Standard deviation of the errors [K]."""
    own: bool = True
    """True if the error is free in each record; false for the prototype."""

    name = "unlisted"
    variant = "error of the logged temperature, separate value for each run"
    amplitude_scale = "size"
    equation = "thermal"
    drivers = ("temperature",)
    varies = True
    bodies_felt = ("winding", "magnet")
    source = (
        "Michalski et al., Temperature Measurement, 2nd edition (2001), chapter 16 (contact "
        "thermometers on surfaces)"
    )

    @property
    def states(self) -> tuple[State, ...]:
        return (State("error", "K", scale=self.size, is_own=True),) if self.own else ()

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        if self.own:
            return ()
        return (amplitude("error", "K", "error of the logged temperature", self.size, signed=True),)

    def felt(
        self, body: str, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        return before + (states.error if self.own else values.error)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """No rate of the constant errors [K/s]."""
        return [ca.SX(0)] * len(self.states)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        is_logged = all(record.expected is None for record in scales.records)
        if len(scales.runs) < _FEWEST_RUNS or not is_logged:
            return []
        fitted = cls(_TRIED)
        return [Candidate(replace(fitted, own=False), columns((_TRIED,)), fitted=fitted)]
