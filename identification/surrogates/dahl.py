"""Dahl friction: hysteresis of dry friction after a reversal (presliding).

Contacts bend before they slide, so friction reverses over a distance instead of at once.  No
function of speed or of another signal has this memory.

Source: Dahl, AIAA Journal 14 (1976), 1675-1682 (solid friction damping of mechanical vibrations).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from identification.effects.effect import CampaignScales, Candidate, amplitude, columns, shape
from identification.model.parameter import Parameter
from identification.model.term import AbstractTorque, Expression, Signals, State, Values

__all__ = ["DahlFriction"]

_ROUNDED = 1e-3


@dataclass(frozen=True)
class DahlFriction(AbstractTorque):
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

    name: ClassVar[str] = "unlisted"
    equation: ClassVar[str] = "mechanical"
    drivers: ClassVar[tuple[str, ...]] = ("speed",)
    source: ClassVar[str] = "Dahl, AIAA Journal 14 (1976), 1675-1682"
    states: ClassVar[tuple[State, ...]] = (State("deflection", "-", scale=1.0, fades=True),)

    @property
    def variant(self) -> str:
        """The law in words."""
        return "Dahl friction"

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
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
