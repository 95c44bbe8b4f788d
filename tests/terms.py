"""Terms for tests of the model without the catalogue of effects."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractTerm,
    AbstractTorque,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = ["Lag", "MagneticDrag"]


@dataclass(frozen=True)
class MagneticDrag(AbstractTorque):
    """Smooth torque -c w |w| against the motion, with |w| rounded below a milliradian/s."""

    name = "magnetic_drag"
    equation = "mechanical"
    drivers = ("speed",)
    parameters = (Parameter("c", "N m s^2/rad^2", "size of the drag"),)

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque on the shaft [N m]."""
        return -values.c * signals.speed * ca.sqrt(signals.speed**2 + 1e-6)


@dataclass(frozen=True)
class Lag(AbstractTerm):
    """State that follows the speed with time constant `tau` and acts on nothing."""

    name = "lag"
    equation = "sensor"
    drivers = ("speed",)
    parameters = (Parameter("tau", "s", "time constant"),)
    states = (State("follower", "rad/s", "speed"),)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Rate of the following state [rad/s^2]."""
        return [(signals.speed - states.follower) / values.tau]
