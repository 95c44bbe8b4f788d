"""What is missing as a part that turns along with play.

A gear or a coupling with play lets go of what it drives wherever the torque reverses: for a while
the rotor turns alone, then it meets the rest again.  No curve in any signal has that memory.

Source: Nordin and Gutman, Automatica 38 (2002), 1633-1649 (dead-zone model of backlash).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import casadi as ca
import numpy as np

from identification.effects.effect import Candidate, Survey, columns, shape
from identification.model.parameter import Parameter
from identification.model.term import (
    AbstractCoefficient,
    AbstractTorque,
    Expression,
    Signals,
    State,
    Values,
)

__all__ = ["LoosePart"]

_ROUNDED: Final = 0.05
"""Share of the play over which contact is made."""


@dataclass(frozen=True)
class LoosePart(AbstractTorque, AbstractCoefficient):
    """Part of the inertia behind a play.

        J -> J (1 - s) + J_2 behind the play,   J_2 = s J
        tau = -J_2 (w_0^2 d(theta) + 2 z w_0 d'(theta) (w - w_2)),   dtheta/dt = w - w_2

    with d the twist beyond the play, rounded at its corners, and the damping in contact only.

    Args:
        slowest: Lowest resonance of the contact [rad/s].
        fastest: Highest that the sampling shows [rad/s].
        narrowest: Smallest play that is told from none [rad].
        widest: Largest that is crossed within a run [rad].
    """

    slowest: float
    fastest: float
    narrowest: float
    widest: float

    name: ClassVar[str] = "unlisted"
    equation: ClassVar[str] = "mechanical"
    drivers: ClassVar[tuple[str, ...]] = ("speed", "position")
    source: ClassVar[str] = "Nordin and Gutman, Automatica 38 (2002), 1633-1649"
    coefficient: ClassVar[str] = "J"
    states: ClassVar[tuple[State, ...]] = (
        State("twist", "rad", fades=True),
        State("speed", "rad/s", "speed", fades=True),
    )

    @property
    def variant(self) -> str:
        """What it follows."""
        return "reversals of the torque in the mechanical equation"

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """Share of the inertia, play, and the contact."""
        return (
            shape("share", "-", "share of the inertia that is loose", 0.003, 0.99),
            shape("play", "rad", "angle that it can turn freely", self.narrowest, self.widest),
            shape("resonance", "rad/s", "resonance in contact", self.slowest, self.fastest),
            shape("damping", "-", "damping ratio in contact", 0.02, 3.0),
        )

    def _contact(self, states: Values, values: Values) -> tuple[Expression, Expression]:
        """Twist beyond the play [rad], and its slope [-]."""
        half, corner = values.play / 2, _ROUNDED * values.play
        above, below = states.twist - half, states.twist + half
        far, near = ca.sqrt(above**2 + corner**2), ca.sqrt(below**2 + corner**2)
        return states.twist + (far - near) / 2, 1 + (above / far - below / near) / 2

    def _pull(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque of the contact over the loose inertia [rad/s^2]."""
        beyond, slope = self._contact(states, values)
        slip = signals.speed - states.speed
        damping = 2 * values.damping * values.resonance
        return values.resonance**2 * beyond + damping * slope * slip

    def factor(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Share of J that turns with the rotor [-]."""
        return 1 - values.share

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque of the contact on the rotor [N m]."""
        return -values.share * values.J * self._pull(signals, states, values)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        """Rates of the twist and of the second speed."""
        return [signals.speed - states.speed, self._pull(signals, states, values)]

    @classmethod
    def candidates(cls, survey: Survey) -> list[Candidate]:
        """One structure, its play scanned with a contact as stiff as the sampling shows."""
        slowest, fastest = 20.0 / survey.duration, 2.5 / survey.interval
        narrowest = 0.1 * survey.speed * survey.interval
        widest = survey.speed * survey.duration
        if fastest < 2 * slowest or widest < 100 * narrowest:
            return []
        scanned = np.geomspace(5 * narrowest, widest / 10, 8)
        starts = [(s, play, 0.4 * fastest, 0.5) for s in (0.2, 0.5) for play in scanned]
        return [Candidate(cls(slowest, fastest, narrowest, widest), columns(*starts))]
