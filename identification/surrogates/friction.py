"""Dry friction with a memory or with a phase, which no curve in a signal has.

Contacts bend before they slide, so friction reverses over a distance instead of at once.  A bent
shaft rubs in one part of the revolution.  The angle may be counted from wherever a run began, or be
integrated from the speed; the phase of this friction is then unknown, so its amplitudes are free in
each record.

Source: Dahl, AIAA Journal 14 (1976), 1675-1682 (solid friction damping of mechanical vibrations).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identification.effects.effect import (
    AbstractEffect,
    AbstractForced,
    CampaignScales,
    Candidate,
    columns,
)
from identification.effects.parameters import amplitude, shape
from identification.model.excitation import Record
from identification.model.parameter import Parameter
from identification.model.term import AbstractTorque, Expression, Signals, State, Values

__all__ = ["AngularFriction", "DahlFriction"]

Array = NDArray[np.float64]

_HARMONICS: Final = 4
_LEAST_TURNS: Final = 1.0
_STEEP: Final = 3e-3
"""Width of the smoothed sign of the speed, over the speed scale."""
_ROUNDED: Final = 1e-3
"""Width of the smoothed magnitude of the speed, over the speed scale."""


@dataclass(frozen=True)
class AngularFriction(AbstractForced, AbstractTorque):
    """Dry friction whose level is periodic in the shaft angle phi.

        tau = -sign(w) (a_0 + sum_k a_k sin(k phi) + b_k cos(k phi))         [N m]

    Args:
        torque_size: Torque scale [N m].
        turning: Speed scale [rad/s].
        free: Whether the amplitudes are per-record states; if not, they are parameters, as the
            score test requires.
    """

    torque_size: float
    turning: float
    free: bool = True

    name = "unlisted"
    equation = "mechanical"
    drivers = ("position", "speed")
    source = "Priestley, Spectral Analysis and Time Series (1981), section 6.1"

    @property
    def variant(self) -> str:
        """The law in words."""
        return "Coulomb friction periodic in the shaft angle"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The amplitudes, unless they are per-record states."""
        if self.free:
            return ()
        return tuple(
            amplitude(name, "N m", name, self.torque_size, signed=True) for name in _names()
        )

    @property
    def states(self) -> tuple[State, ...]:
        """The amplitudes, if they are free in each record."""
        names = _names() if self.free else []
        return tuple(State(name, "N m", scale=self.torque_size, is_own=True) for name in names)

    def expecting(self, size: float) -> AngularFriction:
        """The term with this prior standard deviation of the per-record amplitudes [N m]."""
        return replace(self, torque_size=size)

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """The torque [N m]."""
        own = states if self.free else values
        level = own.level
        for k in range(1, _HARMONICS + 1):
            level = level + getattr(own, f"sine_{k}") * ca.sin(k * signals.angle)
            level = level + getattr(own, f"cosine_{k}") * ca.cos(k * signals.angle)
        return -level * signals.speed / ca.sqrt(signals.speed**2 + (_STEEP * self.turning) ** 2)

    def forces(self, record: Record, current: Array, speed: Array, starts: Array) -> Array:
        """Torque of each start along a trajectory, (n_sample, n_start) [N m]."""
        angle = record.column("angle")
        waves = [np.ones(record.rows)]
        for k in range(1, _HARMONICS + 1):
            waves += [np.sin(k * angle), np.cos(k * angle)]
        direction = speed / np.sqrt(speed**2 + (_STEEP * self.turning) ** 2)
        return np.asarray(-(np.column_stack(waves) * direction[:, None]) @ starts)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate, its amplitudes scored together, if the shaft makes a full revolution."""
        turned = max(float(np.ptp(r.column("angle"))) for r in scales.records) / (2 * np.pi)
        if turned < _LEAST_TURNS:
            return []
        shared = (scales.torque, scales.speed)
        starts = 0.05 * scales.torque * np.eye(len(_names()))
        return [Candidate(cls(*shared, False), starts, joint=len(_names()), fitted=cls(*shared))]


@dataclass(frozen=True)
class DahlFriction(AbstractEffect, AbstractTorque):
    """Dahl friction: a torque that follows the direction of the motion over a distance d.

        tau = -T z,   dz/dt = (w - |w| z) / d                               [N m]

    Args:
        torque_size: Torque scale [N m].
        speed_size: Speed scale [rad/s].
        nearest: Shortest distance that the sampling resolves [rad].
        farthest: Longest distance that a record resolves [rad].
    """

    torque_size: float
    speed_size: float
    nearest: float
    farthest: float

    name = "unlisted"
    equation = "mechanical"
    drivers = ("speed",)
    source = "Dahl, AIAA Journal 14 (1976), 1675-1682"
    states = (State("deflection", "-", scale=1.0, fades=True),)

    @property
    def variant(self) -> str:
        """The law in words."""
        return "Dahl friction"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Torque and distance."""
        return (
            amplitude("torque", "N m", "friction torque in sliding", self.torque_size),
            shape(
                "distance",
                "rad",
                "presliding distance d in the formula",
                self.nearest,
                self.farthest,
            ),
        )

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque opposite to the relative deflection z [N m]."""
        return -values.torque * states.deflection

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Rate of the relative deflection z [1/s]."""
        speed = signals.speed
        size = ca.sqrt(speed * speed + (_ROUNDED * self.speed_size) ** 2)
        return [(speed - size * states.deflection) / values.distance]

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate, its distance scanned."""
        nearest = 0.3 * scales.speed * scales.interval
        farthest = 0.3 * scales.speed * scales.duration
        if farthest < 10 * nearest:
            return []
        scanned = np.geomspace(2 * nearest, farthest / 3, 5)
        starts = [(0.05 * scales.torque, float(d)) for d in scanned]
        return [Candidate(cls(scales.torque, scales.speed, nearest, farthest), columns(*starts))]


def _names() -> list[str]:
    waves = [f"{wave}_{k}" for k in range(1, _HARMONICS + 1) for wave in ("sine", "cosine")]
    return ["level", *waves]
