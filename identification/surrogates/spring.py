"""Return spring, as of a throttle valve, a damper flap or a pedal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.effects.effect import AbstractEffect, CampaignScales, Candidate
from identification.effects.parameters import amplitude, columns
from identification.model.parameter import Parameter
from identification.model.term import AbstractTorque, Expression, Signals, State, Values

__all__ = ["ReturnSpring"]

_LEAST_PATH: Final = 2.0
"""Least path of the shaft over the range of its angle, that of one way and back."""


@dataclass(frozen=True)
class ReturnSpring(AbstractEffect, AbstractTorque):
    """Torque of a linear spring on the shaft.

    tau = -k phi,   dphi/dt = w                                         [N m]

    The angle phi counts from the position of rest of the spring, so that a preload is a part of it;
    its initial value is free in each record.  The angle is simulated, because that of the logged
    speed drifts.
    """

    torque_size: float
    """Torque scale [N m]."""
    angle_size: float
    """Largest range of the shaft angle in a record [rad]."""

    name = "unlisted"
    variant = "return spring"
    drivers = ("position",)
    source = "Eriksson and Nielsen, Modeling and Control of Engines and Drivelines, chapter 7"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        size = self.torque_size / self.angle_size
        return (amplitude("stiffness", "N m/rad", "stiffness of the spring", size),)

    @property
    def states(self) -> tuple[State, ...]:
        return (State("angle", "rad", scale=self.angle_size),)

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return -values.stiffness * states.angle

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        return [signals.speed]

    @classmethod
    def is_excluded(cls, scales: CampaignScales) -> bool:
        """True if the shaft does not turn back in all records, as a spring makes it."""
        angles = [record.column("angle") for record in scales.records]
        paths = [float(np.sum(np.abs(np.diff(angle)))) for angle in angles]
        return any(
            path < _LEAST_PATH * float(np.ptp(angle))
            for path, angle in zip(paths, angles, strict=True)
        )

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate, if the shaft turns at all."""
        size = max(float(np.ptp(record.column("angle"))) for record in scales.records)
        if not size > 0.0:
            return []
        stiffness = scales.torque / size
        return [Candidate(cls(scales.torque, size), columns((0.05 * stiffness,), (stiffness,)))]
