"""Two-mass system: part of the inertia can twist against the rotor.

The subclasses define the joint of the two: an elastic shaft, or a contact with play.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Final

from identification.effects.effect import AbstractEffect, CampaignScales
from identification.effects.parameters import shape
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractCoefficient,
    AbstractTorque,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = ["AbstractSecondInertia", "resonances", "share_of_inertia"]

_LEAST_RANGE: Final = 2.0


class AbstractSecondInertia(AbstractEffect, AbstractTorque, AbstractCoefficient):
    """Second inertia that the rotor drives through a joint.

        J -> J (1 - s),   J_2 = s J,   tau = -J_2 a
        dtheta/dt = w - w_2,   dw_2/dt = a(theta, w - w_2)

    Here s is the fraction of the inertia behind the joint, theta the twist and w_2 the speed of the
    second inertia.  J remains the total inertia, which determines slow motions.
    """

    equation = "mechanical"
    coefficient = "J"
    states = (State("twist", "rad", fades=True), State("speed", "rad/s", "speed", fades=True))

    @abstractmethod
    def pull(self, twist: Expression, slip: Expression, values: Values) -> Expression:
        """Acceleration of the second inertia by the joint [rad/s^2].

        Twist [rad] and slip [rad/s] are the angle and the speed of the rotor minus those of the
        second inertia; the values are the parameters of the term and the nominal ones.
        """

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        return 1 - values.share

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        slip = signals.speed - states.speed
        return -values.share * values.J * self.pull(states.twist, slip, values)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        slip = signals.speed - states.speed
        return [slip, self.pull(states.twist, slip, values)]


def share_of_inertia(meaning: str) -> Parameter:
    """Parameter of the fraction s of the inertia behind the joint."""
    return shape("share", "-", meaning, 0.003, 0.99)


def resonances(scales: CampaignScales) -> tuple[float, float] | None:
    """Lowest and highest identifiable resonance [rad/s]; None if their ratio is below two.

    The duration of the longest record limits the lowest, the sample interval the highest.
    """
    slowest, fastest = 20.0 / scales.duration, 2.5 / scales.interval
    return None if fastest < _LEAST_RANGE * slowest else (slowest, fastest)
