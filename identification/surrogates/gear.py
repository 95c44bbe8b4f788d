"""Friction of a gear or bearing in proportion to the torque that it transmits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import casadi as ca

from identification.effects.effect import AbstractEffect, CampaignScales, Candidate
from identification.effects.parameters import amplitude, columns
from identification.model.parameter import Parameter
from identification.model.term import AbstractTransmission, Expression, Signals, Values

__all__ = ["GearFriction"]

_WIDTH: Final = 1e-3
"""Width of the smoothed sign of the speed and magnitude of the torque, over their scales."""
_MOST: Final = 0.9
"""Largest friction over transmitted torque; a gear with a ratio of 1 locks itself."""


@dataclass(frozen=True)
class GearFriction(AbstractEffect, AbstractTransmission):
    """Friction of a gear or bearing in proportion to the torque that accelerates the load.

        tau = -c |J dw/dt| sgn w                                            [N m]

        tau = -c |Kt i| sgn w                                               [N m]

    With the first law, the motor accelerates an inertia J (1 + c) and brakes one of J (1 - c).  If
    a share of J turns before the gear, c is the coefficient of the gear times the share behind it.
    With the second law, the gear also transmits what overcomes the friction.
    """

    torque_size: float
    """Torque scale [N m]."""
    speed_size: float
    """Speed scale [rad/s]."""
    of_motor: bool = False
    """True for the second law."""

    name = "unlisted"
    drivers = ("speed", "current")
    is_approximate = True
    source = (
        "Pelchen, Schweiger and Otter, Proc. 2nd International Modelica Conference (2002), 257-266 "
        "(mesh friction)"
    )

    @property
    def variant(self) -> str:
        """The torque that the gear transmits."""
        torque = "torque of the motor" if self.of_motor else "load of a gear"
        return f"friction in proportion to the {torque}"

    @property
    def rival_laws(self) -> tuple[GearFriction]:
        """The other law."""
        return (replace(self, of_motor=not self.of_motor),)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = "friction torque over the torque that the gear transmits, c in the formula"
        return (replace(amplitude("share", "-", meaning, 1.0), upper=_MOST),)

    def loss(self, net: Expression, signals: Signals, values: Values) -> Expression:
        speed, torque = signals.speed, signals.motor_torque if self.of_motor else net
        sign = speed / ca.sqrt(speed * speed + (_WIDTH * self.speed_size) ** 2)
        size = ca.sqrt(torque * torque + (_WIDTH * self.torque_size) ** 2)
        part = values.share * sign
        if self.of_motor:
            return -part * size
        return part * (part * net - size) / (1 - part * part)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return [Candidate(cls(scales.torque, scales.speed), columns((0.05,)))]
