"""First-order lags between the logged temperature and the temperatures of winding and magnet."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.effects.confusion import RESISTANCE, TORQUE_CONSTANT
from identification.effects.effect import AbstractEffect, CampaignScales, Candidate, register
from identification.effects.parameters import THERMAL_S, amplitude, columns, shape
from identification.model.parameter import Parameter
from identification.model.term import AbstractTemperature, Expression, Signals, State, Values

__all__ = ["MagnetLag", "WindingLag"]

_SOURCE: Final = (
    "Mellor, Roberts and Turner, IEE Proc. B 138 (1991), 205-218 (lumped thermal model)"
)
_LEAST_MOVEMENT: Final = 1.0
"""Least range of the logged temperature within a record that reveals a lag behind it [K]."""
_LEAST_SEEN: Final = 0.05
"""Least range within a run that reveals a lag of the log [K]: several times the error of a smoothed
log.  A log that lags by a dozen runs moves by 0.2 K if the winding warms by 5 K in a run, and by
less in the part of it that is searched."""
_SCANNED: Final = (0.03, 0.1, 0.3, 1.0)
"""Scanned time constants, over the duration of the longest record."""
_BEHIND: Final = "the winding lags the log"
_AHEAD: Final = "the log lags the winding"
_BOTH_AHEAD: Final = "the log lags winding and magnet"
_WORDS: Final = {
    _BEHIND: "winding lags the logged temperature",
    _AHEAD: "logged temperature lags the winding",
    _BOTH_AHEAD: "logged temperature lags winding and magnet",
}
"""Variant by direction; the direction is a setting in results and keeps its text."""
_WITH_ERROR: Final = ", error of the log"
_LEAST_STEP: Final = 0.01
"""Least step of a log that causes its error [K].  The smoothing of a finer one has an error too,
whose size is that in the runs."""
_HARMONICS: Final = 5
"""Sine and cosine pairs of the error of a log in coarse steps."""
_ERRORS: Final = (
    "error",
    *(f"{wave}_{k}" for k in range(1, _HARMONICS + 1) for wave in ("cosine", "sine")),
)


def _waves(fraction: Array) -> Array:
    """(n, n_error) error by a unit of each amplitude, at fractions (n,) of the longest run."""
    phases = np.outer(fraction, np.pi * np.arange(1, _HARMONICS + 1))
    pairs = np.stack([np.cos(phases), np.sin(phases)], axis=2)
    return np.column_stack([np.ones(fraction.size), pairs.reshape(fraction.size, -1)])


_POINTS: Final = (np.arange(2000) + 0.5) / 2000
_ROOT: Final = np.linalg.qr(_waves(_POINTS) / np.sqrt(_POINTS.size)).R
"""Matrix whose product with the amplitudes has the mean square of the error as its square."""


def _movement_of_runs(scales: CampaignScales) -> float:
    """Largest range of the logged temperature within a run, of which a record may be a part [K]."""
    logs = [(record.run, record.column("temperature")) for record in scales.records]
    return max(
        float(np.ptp(np.concatenate([log for own, log in logs if own == run])))
        for run in scales.runs
    )


@dataclass(frozen=True)
class _Lag(AbstractEffect, AbstractTemperature):
    """First-order lag of a body's temperature behind the logged temperature."""

    fastest: float
    """Shortest time constant [s]."""
    slowest: float
    """Longest time constant [s]."""

    drivers = ("temperature",)
    source = _SOURCE

    @property
    def states(self) -> tuple[State, ...]:
        return (State("temperature", "degC", "temperature"),)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (self._time_constant("time constant of the magnet temperature"),)

    def _time_constant(self, meaning: str) -> Parameter:
        return shape("time_constant", "s", meaning, self.fastest, self.slowest)

    def felt(
        self, body: str, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        """Temperature of the body, with the rises by other terms added without lag [degC]."""
        return before + states.temperature - signals.temperature

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        return [(signals.temperature - states.temperature) / values.time_constant]

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        if max(np.ptp(record.column("temperature")) for record in scales.records) < _LEAST_MOVEMENT:
            return []
        term = cls(scales.duration / 200, max(scales.run_duration * 5, THERMAL_S))
        return [Candidate(term, columns(*[(f * scales.duration,) for f in _SCANNED]))]


@register
@dataclass(frozen=True)
class WindingLag(_Lag):
    """First-order lag between winding temperature and logged temperature T, in either direction.

        dT_w/dt = (T - T_w) / tau            winding lags T                    [K/s]
        T_w = T + tau dT/dt                  T lags the winding                [degC]
        T_w = T + e + tau d(T + e)/dt        the same, T with an error e       [degC]

        e = e_0 + sum_k c_k cos(k pi t / D) + s_k sin(k pi t / D),   k <= 5    [K]

    The second law inverts the lag of a thermometer, such as a thermocouple on the case.  It holds
    for any course of the temperature.  dT/dt is the derivative of a smoothing spline through the
    log; noise and resolution of the thermometer hardly affect it.  If the thermometer lags all
    parts of the motor, the law applies to the magnet as well.

    If the log has coarse steps without noise to dither them, the temperature is unknown within half
    a step, and its derivative with it.  Smoothing has an error too, which tau multiplies if the
    thermometer lags by several runs.  The third law, an extended variant, therefore adds an error
    e, free in each record; D is the duration of the longest run.  The prior is that of eleven
    orthonormal combinations of the waves over D, whose variances sum to that of rounding,
    step^2 / 12, or are those in the runs if they are larger.  The step is at least 0.01 K, and
    smaller than that of the log if noise dithers it in part.  Without noise, the mean of T + e over
    a constant stretch of the log is its level, with the standard deviation of rounding.
    """

    direction: str = _BEHIND
    """Direction of the lag."""
    duration: float = 1.0
    """Duration D of the longest run [s]."""
    step: float = 0.0
    """Step of the log that causes its error, zero for a winding that lags the log [K]."""
    size: float = 0.0
    """Prior standard deviation of each orthonormal combination in e; zero without e [K]."""

    name = "winding_lag"
    confusions = (RESISTANCE,)

    @property
    def bodies_felt(self) -> tuple[str, ...]:
        """The winding, and the magnet if the log lags it as well."""
        return ("winding", "magnet") if self.direction == _BOTH_AHEAD else ("winding",)

    @property
    def variant(self) -> str:
        """Direction of the lag, and whether the log has an error."""
        return _WORDS.get(self.direction, self.direction) + (_WITH_ERROR if self.size else "")

    @property
    def richer(self) -> tuple[WindingLag, ...]:
        """The variant with an error of the log, if the log lags."""
        return () if self.size or not self.step else (self.expecting(0.0),)

    def _in_steps(self) -> Candidate:
        """Candidate of the variant with an error of the log."""
        lag = (_SCANNED[2] * self.duration,)
        starts = columns(*[(*lag, *errors) for errors in self.step * np.eye(len(_ERRORS))])
        values = (getattr(self, field.name) for field in fields(self))
        scored = _ScoredError(*values)
        return Candidate(scored, starts, len(_ERRORS), self.expecting(0.0), columns(lag))

    def expecting(self, size: float) -> WindingLag:
        """The term with an error whose combinations have this standard deviation or more [K]."""
        return replace(self, size=max(size, self.step / math.sqrt(12.0 * len(_ERRORS))))

    @property
    def states(self) -> tuple[State, ...]:
        """Temperature of a lagging winding, or amplitudes of the error of a record."""
        if self.direction == _BEHIND:
            return super().states
        errors = _ERRORS if self.size else ()
        return tuple(State(name, "K", scale=self.size, is_own=True) for name in errors)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            self._time_constant(
                f"time constant of the lag ({_WORDS.get(self.direction, self.direction)})"
            ),
        )

    def felt(
        self, body: str, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        """Temperature of the body [degC]."""
        if self.direction == _BEHIND:
            return super().felt(body, before, signals, states, values)
        ahead = before + values.time_constant * signals.temperature_rate
        return ahead + self._error(signals, states, values) if self.size else ahead

    @property
    def log_step(self) -> float:
        return self.step

    def log_error(self, time: Array) -> Array | None:
        """Error of the log, without its derivative [K]."""
        return _waves(time / self.duration) if self.own_root is not None else None

    @property
    def own_root(self) -> Array | None:
        """The prior is one of the error, whose half periods are nearly linearly dependent."""
        return _ROOT if self.size and self.direction != _BEHIND else None

    def _error(self, signals: Signals, amplitudes: Values, values: Values) -> Expression:
        """Error of the log and its derivative, as the body feels them [K]."""
        felt = amplitudes.error
        for k in range(1, _HARMONICS + 1):
            rate = k * np.pi / self.duration
            cosine, sine = ca.cos(rate * signals.time), ca.sin(rate * signals.time)
            lead = values.time_constant * rate
            felt += getattr(amplitudes, f"cosine_{k}") * (cosine - lead * sine)
            felt += getattr(amplitudes, f"sine_{k}") * (sine + lead * cosine)
        return felt

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Rate of the winding's temperature, or none of the constant amplitudes [K/s]."""
        if self.direction == _BEHIND:
            return super().rates(signals, states, values)
        return [ca.SX(0)] * len(self.states)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate per direction of the lag, if the temperature varies within a record.

        A log in coarse steps can hide such a variation.  The log may lag by more than a record, of
        which it then shows a part.
        """
        # The temperature of a segment comes from the whole record.
        duration = max(record.duration for record in scales.records)
        shortest, longest = duration / 200, max(scales.run_duration * 5, THERMAL_S)
        step = max(record.resolution for record in scales.records)
        directions = (_AHEAD, _BOTH_AHEAD)
        error = max(step, _LEAST_STEP)
        ahead = [cls(shortest, longest, each, duration, error) for each in directions]
        coarse = [term._in_steps() for term in ahead] if step else []
        found = super().candidates(scales)
        if _movement_of_runs(scales) >= max(_LEAST_SEEN, step):
            starts = columns(*[(f * duration,) for f in (*_SCANNED[:-1], 3.0)])
            found += [Candidate(term, starts) for term in ahead]
        return [*found, *coarse]


class _ScoredError(WindingLag):
    """Prototype of an error of the log, as a lagging body feels it, with scored amplitudes."""

    @property
    def states(self) -> tuple[State, ...]:
        return ()

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        size = self.step
        errors = (amplitude(name, "K", name, size, signed=True) for name in _ERRORS)
        return (*super().parameters, *errors)

    def felt(
        self, body: str, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        return before + self._error(signals, values, values)


@register
@dataclass(frozen=True)
class MagnetLag(_Lag):
    """First-order lag of the magnet temperature T_m behind the logged temperature T.

    dT_m/dt = (T - T_m) / tau                                           [K/s]
    """

    name = "magnet_lag"
    confusions = (TORQUE_CONSTANT,)
    bodies_felt = ("magnet",)
