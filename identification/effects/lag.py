"""First-order lags between the logged temperature and those of winding and magnet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Final

import casadi as ca
import numpy as np

from identification.effects.effect import Candidate, Survey, columns, shape
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractTemperature,
    Expression,
    Signals,
    State,
    Values,
)
from identification.model.unlogged import WARMING

__all__ = ["MagnetLag", "WindingLag"]

_SOURCE: Final = (
    "Mellor, Roberts and Turner, IEE Proc. B 138 (1991), 205-218 (lumped thermal model)"
)
_LEAST_MOVEMENT: Final = 1.0
"""Movement of the temperature within a run that tells a lag from nothing [K]."""
_SCANNED: Final = (0.03, 0.1, 0.3, 1.0)
"""Time constants that are scanned, over the longest run."""
_BEHIND: Final = "the winding lags the log"
_AHEAD: Final = "the log lags the winding"
_BOTH_AHEAD: Final = "the log lags winding and magnet"
_IN_STEPS: Final = ", which its steps tell only roughly"


def _moves(survey: Survey) -> bool:
    """Whether the logged temperature changes within a run by more than noise."""
    movement = (float(np.ptp(record.column("temperature"))) for record in survey.records)
    return max(movement) >= _LEAST_MOVEMENT


@dataclass(frozen=True)
class _Lag(AbstractTemperature):
    """A body that follows the logged temperature with a lag of first order.

    Args:
        fastest: Shortest time constant [s].
        slowest: Longest time constant [s].
    """

    fastest: float
    slowest: float

    equation: ClassVar[str] = "thermal"
    drivers: ClassVar[tuple[str, ...]] = ("temperature",)
    source: ClassVar[str] = _SOURCE

    @property
    def states(self) -> tuple[State, ...]:  # type: ignore[override]
        """Temperature of the body."""
        return (State("temperature", "degC", "temperature"),)

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """Time constant."""
        return (self._time_constant("time constant of the lag"),)

    def _time_constant(self, meaning: str) -> Parameter:
        return shape("time_constant", "s", meaning, self.fastest, self.slowest)

    def felt(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        """Temperature of the body [degC]: what else warms it stays on top of the lag."""
        return before + states.temperature - signals.temperature

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Rate of the body's temperature [K/s]."""
        return [(signals.temperature - states.temperature) / values.time_constant]

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure, its time constant scanned, where the temperature moves within runs."""
        if not _moves(survey):
            return []
        term = cls(survey.duration / 200, survey.duration * 5)
        return [Candidate(term, columns(*[(f * survey.duration,) for f in _SCANNED]))]


@dataclass(frozen=True)
class WindingLag(_Lag):
    """The winding lags the logged temperature T, or T lags the winding.

        dT_w/dt = (T - T_w) / tau            the winding lags the log          [K/s]
        T_w = T + tau dT/dt                  the log lags the winding          [degC]
        T_w = T + tau dT/dt + departure      and has coarse steps              [degC]

        D d(departure)/dt = warming,   D d(warming)/dt = bend                  [K]

    The second is the inverse of the lag of a thermocouple on the case, exact for any movement, with
    the derivative of the smoothing spline of the log, which noise and resolution of the thermometer
    hardly reach.  Where the thermometer lags everything in the motor, the magnet is ahead of the
    log as the winding is.

    A log in steps that no noise dithers tells no derivative within a step.  In a richer form the
    winding's temperature departs from it by a parabola over time, another one in each record of
    length D.  Departure, warming and bend are expected to be as large as what a run warms by whose
    temperature nobody logged.

    Args:
        direction: Direction of the lag.
        duration: Length D of the longest record [s].
        step: Step of the log where no noise dithers it, else zero [K].
        size: Expected size of the departure, zero where there is none [K].
    """

    direction: str = _BEHIND
    duration: float = 1.0
    step: float = 0.0
    size: float = 0.0

    name: ClassVar[str] = "winding_lag"

    @property
    def bodies_felt(self) -> tuple[str, ...]:  # type: ignore[override]
        """The winding, and the magnet where it is ahead of the log as well."""
        return ("winding", "magnet") if self.direction == _BOTH_AHEAD else ("winding",)

    @property
    def variant(self) -> str:
        """Direction of the lag, and whether the temperature departs from what the log tells."""
        return self.direction + (_IN_STEPS if self.size else "")

    @property
    def richer(self) -> tuple[WindingLag, ...]:
        """A departure in each record, where the log lags in steps."""
        return () if self.size or not self.step else (self.expecting(WARMING),)

    def expecting(self, size: float) -> WindingLag:
        """The term with departures expected to be of this size [K]."""
        return replace(self, size=size)

    @property
    def states(self) -> tuple[State, ...]:  # type: ignore[override]
        """Temperature of the winding where it lags; the departure of a record and its course."""
        if self.direction == _BEHIND:
            return super().states
        course = ("departure", "warming", "bend") if self.size else ()
        return tuple(State(name, "K", scale=self.size, is_own=True) for name in course)

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """Time constant, with what lags what."""
        return (self._time_constant(f"time constant with which {self.direction}"),)

    def felt(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        """Temperature of the body [degC]."""
        if self.direction == _BEHIND:
            return super().felt(before, signals, states, values)
        ahead = before + values.time_constant * signals.temperature_rate
        return ahead + states.departure if self.size else ahead

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Rates of the winding's temperature, or of what departs from the log's [K/s]."""
        if self.direction == _BEHIND:
            return super().rates(signals, states, values)
        if not self.size:
            return []
        return [states.warming / self.duration, states.bend / self.duration, ca.SX(0)]

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure for each direction, where the temperature moves within runs."""
        if not _moves(survey):
            return []
        shortest, longest = survey.duration / 200, survey.duration
        # No run shows the derivative of a temperature over more than itself.
        starts = columns(*[(f * survey.duration,) for f in _SCANNED[:-1]])
        step = max(record.resolution for record in survey.records)
        ahead = [
            Candidate(cls(shortest, longest, d, survey.duration, step), starts)
            for d in (_AHEAD, _BOTH_AHEAD)
        ]
        return [*super().candidates(survey), *ahead]


@dataclass(frozen=True)
class MagnetLag(_Lag):
    """The magnet follows the logged temperature slowly.

    dT_m/dt = (T - T_m) / tau                                           [K/s]
    """

    name: ClassVar[str] = "magnet_lag"
    bodies_felt: ClassVar[tuple[str, ...]] = ("magnet",)
