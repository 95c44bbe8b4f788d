"""Ripples: torque or voltage that is periodic in time, and ripple of a speed sensor over the angle.

The amplitudes of a ripple in time are free in each record, since the phase at the start of a run is
unknown.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.effects.effect import AbstractForced, CampaignScales, Candidate
from identification.effects.parameters import amplitude, columns
from identification.effects.periodic import AbstractPeriodic
from identification.model.excitation import Record
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractSensor,
    AbstractTorque,
    AbstractVoltage,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = ["MissingTorqueRipple", "MissingVoltageRipple", "SpeedRipple"]

_HARMONICS: Final = 3
_WAVES: Final = tuple(
    f"{wave}_{order}" for order in range(1, _HARMONICS + 1) for wave in ("sine", "cosine")
)
"""Amplitudes of a ripple in time."""


@dataclass(frozen=True)
class _Ripple(AbstractForced):
    """Fourier series in time with a linearly drifting frequency, amplitudes free in each record.

    term = sum_k a_k sin(2 pi k u) + b_k cos(2 pi k u),   u = f t + d t^2 / (2 T)
    """

    size: float
    """Scale of the term [N m] or [V]."""
    lowest: float
    """Lowest frequency, with one period in the longest record [Hz]."""
    highest: float
    """Highest frequency that the sampling resolves [Hz]."""
    duration: float
    """Duration T of the longest record [s]."""
    free: bool = True
    """True if the amplitudes are per-record states; if not, they are parameters, as the score test
    requires."""

    name = "unlisted"
    amplitude_scale = "size"
    drivers = ("time",)
    unit: ClassVar[str]
    source = "Priestley, Spectral Analysis and Time Series (1981), section 6.1"

    @property
    def variant(self) -> str:
        return f"periodic in time, in the {self.equation} equation"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        shared = (
            Parameter(
                "frequency", "Hz", "frequency at the start of a run", scale=0.1 / self.duration,
                lower=self.lowest, upper=self.highest,
                prior_mean=0.5 * (self.lowest + self.highest),
                prior_sd=10.0 * self.highest * self.duration
            ),
            Parameter(
                "drift", "Hz", "change of the frequency over the duration of the longest run",
                scale=0.1 / self.duration, lower=-self.highest, upper=self.highest,
                prior_sd=10.0 * self.highest * self.duration,
            ),
        )  # fmt: skip
        if self.free:
            return shared
        return shared + tuple(
            amplitude(name, self.unit, name, self.size, signed=True) for name in _WAVES
        )

    @property
    def states(self) -> tuple[State, ...]:
        names = _WAVES if self.free else ()
        return tuple(State(name, self.unit, scale=self.size, is_own=True) for name in names)

    def forces(self, record: Record, current: Array, speed: Array, starts: Array) -> Array:
        time = record.time[:, None]
        turns = starts[0] * time + starts[1] * time**2 / (2 * self.duration)
        orders = np.repeat(np.arange(1, _HARMONICS + 1), 2)
        found = np.zeros((record.rows, starts.shape[1]))
        for row, order in enumerate(orders):
            wave = np.cos if row % 2 else np.sin
            found += starts[2 + row] * wave(2 * np.pi * order * turns)
        return found

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate, its amplitudes free in each record; its frequency starts at each peak."""
        size = scales.torque if cls.equation == "mechanical" else scales.voltage
        shared = (size, 1.0 / scales.duration, 0.4 / scales.interval, scales.duration)
        amplitudes = 0.05 * size * np.eye(2 * _HARMONICS)[:2]
        starts = [(f, 0.0, *row) for f in scales.frequencies for row in amplitudes]
        scanned, fitted = cls(*shared, False), cls(*shared)
        return [Candidate(scanned, columns(*starts), joint=2, fitted=fitted)] if starts else []

    def _missing(self, signals: Signals, states: Values, values: Values) -> Expression:
        time = signals.time
        turns = values.frequency * time + values.drift * time * time / (2 * self.duration)
        own = states if self.free else values
        total = ca.SX(0)
        for order in range(1, _HARMONICS + 1):
            angle = 2 * np.pi * order * turns
            total = total + getattr(own, f"sine_{order}") * ca.sin(angle)
            total = total + getattr(own, f"cosine_{order}") * ca.cos(angle)
        return total


@dataclass(frozen=True)
class MissingTorqueRipple(_Ripple, AbstractTorque):
    """Torque that is periodic in time and that no effect of the catalogue explains."""

    unit = "N m"

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return self._missing(signals, states, values)


@dataclass(frozen=True)
class MissingVoltageRipple(_Ripple, AbstractVoltage):
    """Voltage that is periodic in time and that no effect of the catalogue explains."""

    unit = "V"

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        return self._missing(signals, states, values)


@dataclass(frozen=True)
class SpeedRipple(AbstractPeriodic, AbstractSensor):
    """Gain of the speed sensor that is periodic in the shaft angle phi.

        logged speed = w (1 + sum_h A_h sin(h k phi) + B_h cos(h k phi))    [rad/s]

    The commutator of a tachogenerator has as many periods per revolution as segments, an eccentric
    encoder disc has one.  The ripple grows with the speed, and the current has no part in it; that
    of a torque falls with the speed, because the inertia filters it.
    """

    ratio: float
    """Scale of the amplitudes [-]."""

    name = "unlisted"
    amplitude_scale = "ratio"
    unit = "-"
    drivers = ("speed", "position")
    channel = "speed"
    source = (
        "Doebelin, Measurement Systems, 5th edition, section 4.8 (ripple of a tachometer generator)"
    )

    @property
    def size(self) -> float:
        return self.ratio

    @property
    def variant(self) -> str:
        return f"ripple of the speed sensor over the shaft angle, {super().variant}"

    def reading(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        return before + signals.speed * self.wave(signals, states, values)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return cls._scanned(scales, cls(1.0))
