"""Backlash: part of the inertia is driven through a dead zone (play).

A gear or coupling with play disengages when the torque reverses: the rotor turns alone until it
has crossed the play.  No curve in any signal has this memory.

Source: Nordin and Gutman, Automatica 38 (2002), 1633-1649 (dead-zone model of backlash).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Final

import casadi as ca
import numpy as np

from identification.effects.effect import CampaignScales, Candidate, columns
from identification.effects.parameters import shape
from identification.effects.second_inertia import (
    AbstractSecondInertia,
    resonances,
    share_of_inertia,
)
from identification.model.parameter import Parameter
from identification.model.term import Expression, Values

__all__ = ["Backlash"]

_ROUNDED: Final = 0.05
"""Width of the rounded corners of the dead zone, over the play."""
_PLAYS: Final = 12
_CONTACTS: Final = 7


@dataclass(frozen=True)
class Backlash(AbstractSecondInertia):
    """Second inertia behind backlash.

        a = w_0^2 d(theta) + 2 z w_0 d'(theta) (w - w_2)

    d is the dead zone: the twist theta beyond the play, with rounded corners.  Its slope d'
    restricts the damping to contact.

    Args:
        slowest: Lowest natural frequency in contact [rad/s].
        fastest: Highest resonance that the sampling resolves [rad/s].
        narrowest: Smallest play that is distinguishable from none [rad].
        widest: Largest play that is crossed within a record [rad].
    """

    slowest: float
    fastest: float
    narrowest: float
    widest: float

    name = "unlisted"
    drivers = ("speed", "position")
    source = "Nordin and Gutman, Automatica 38 (2002), 1633-1649"

    @property
    def variant(self) -> str:
        """The law in words."""
        return "backlash"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Share of the inertia, play, and resonance and damping in contact."""
        return (
            share_of_inertia("fraction of the inertia J behind the backlash"),
            shape("play", "rad", "width of the backlash", self.narrowest, self.widest),
            shape("resonance", "rad/s", "natural frequency in contact", self.slowest, self.fastest),
            shape("damping", "-", "damping ratio in contact", 0.02, 3.0),
        )

    def pull(self, twist: Expression, slip: Expression, values: Values) -> Expression:
        """Acceleration of the second inertia by the contact [rad/s^2]."""
        half, corner = values.play / 2, _ROUNDED * values.play
        above, below = twist - half, twist + half
        far, near = ca.sqrt(above**2 + corner**2), ca.sqrt(below**2 + corner**2)
        beyond = twist + (far - near) / 2
        slope = 1 + (above / far - below / near) / 2
        return values.resonance * (values.resonance * beyond + 2 * values.damping * slope * slip)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate, its play scanned with a contact nearly as stiff as the sampling resolves.

        The motion after an impact is sensitive to all parameters, so a fit converges only from
        nearby: the refit tries a grid of starting points.
        """
        reach = resonances(scales)
        narrowest = 0.1 * scales.speed * scales.interval
        widest = scales.speed * scales.duration
        if reach is None or widest < 100 * narrowest:
            return []
        slowest, fastest = reach
        scanned = np.geomspace(5 * narrowest, widest / 10, 8)
        starts = [(s, play, 0.4 * fastest, 0.5) for s in (0.2, 0.5) for play in scanned]
        plays = np.geomspace(3 * narrowest, widest / 20, _PLAYS)
        contacts = np.geomspace(2 * slowest, 0.5 * fastest, _CONTACTS)
        tried = columns(*product((0.2, 0.4, 0.6), plays, contacts, (0.1, 0.4, 1.2)))
        term = cls(slowest, fastest, narrowest, widest)
        return [Candidate(term, columns(*starts), tried=tried)]
