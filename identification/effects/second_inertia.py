"""Part of the inertia behind something that lets it twist against the rotor.

What lies between the two is what the subclasses know: a springy shaft, or a contact with play.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, Final

from identification.effects.effect import Survey, shape
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


class AbstractSecondInertia(AbstractTorque, AbstractCoefficient):
    """A second inertia that the rotor pulls along.

        J -> J (1 - s),   J_2 = s J,   tau = -J_2 a
        dtheta/dt = w - w_2,   dw_2/dt = a(theta, w - w_2)

    J stays what slow motions show, all of it.
    """

    equation: ClassVar[str] = "mechanical"
    coefficient: ClassVar[str] = "J"
    states: ClassVar[tuple[State, ...]] = (
        State("twist", "rad", fades=True),
        State("speed", "rad/s", "speed", fades=True),
    )

    @abstractmethod
    def pull(self, twist: Expression, slip: Expression, values: Values) -> Expression:
        """Acceleration a of the second inertia by what joins the two [rad/s^2].

        Args:
            twist: Angle of the rotor before the second inertia [rad].
            slip: Speed of the rotor over that of the second inertia [rad/s].
            values: Parameters.
        """

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Share of J that turns with the rotor [-]."""
        return 1 - values.share

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque of the second inertia on the rotor [N m]."""
        slip = signals.speed - states.speed
        return -values.share * values.J * self.pull(states.twist, slip, values)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Rates of the twist and of the second speed."""
        slip = signals.speed - states.speed
        return [slip, self.pull(states.twist, slip, values)]


def share_of_inertia(meaning: str) -> Parameter:
    """The share s of the inertia that the rotor pulls along."""
    return shape("share", "-", meaning, 0.003, 0.99)


def resonances(survey: Survey) -> tuple[float, float] | None:
    """Lowest and highest resonance that show [rad/s]; None where none would.

    The lowest differs from a rigid joint within the longest run, the highest within a sample.
    """
    slowest, fastest = 20.0 / survey.duration, 2.5 / survey.interval
    return None if fastest < _LEAST_RANGE * slowest else (slowest, fastest)
