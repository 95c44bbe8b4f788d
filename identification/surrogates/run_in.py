"""Friction that differs from run to run, as bearings and brushes run in and grease spreads.

If all runs have a dry friction as well, its differences are a variant of Coulomb friction, which is
in the catalogue.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, Final

import casadi as ca

from identification.effects.effect import AbstractEffect, CampaignScales, Candidate
from identification.effects.friction import SHARPER, SIGN_WIDTH
from identification.effects.parameters import amplitude, columns
from identification.effects.runs import EACH_RUN
from identification.model.parameter import Parameter
from identification.model.term import AbstractTorque, Expression, Signals, State, Values

__all__ = ["DryFrictionOfRuns", "ViscousFrictionOfRuns"]

_SIZE: Final = 0.05
"""First guess of the friction at the RMS speed, over the torque scale."""


class _FrictionOfRuns(AbstractEffect, AbstractTorque):
    """Friction whose coefficient c is free in each record, as a constant state."""

    unit: ClassVar[str]
    """Unit of the coefficient."""

    name = "unlisted"
    drivers = ("time", "speed")
    source = "Harris and Kotzalas, Rolling Bearing Analysis, 5th edition, chapter 10 (friction)"

    @property
    @abstractmethod
    def size(self) -> float:
        """Standard deviation of the coefficients, in their unit."""

    @abstractmethod
    def along(self, signals: Signals) -> Expression:
        """Torque against the motion for a coefficient of one."""

    @property
    def varies(self) -> bool:
        return True

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return ()

    @property
    def states(self) -> tuple[State, ...]:
        return (State("friction", self.unit, scale=self.size, is_own=True),)

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return -states.friction * self.along(signals)


class _Scored(_FrictionOfRuns):
    """The friction with one coefficient for all runs, which is scored for each record."""

    @property
    def varies(self) -> bool:
        return False

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (amplitude("friction", self.unit, "friction of a run", self.size, signed=True),)

    @property
    def states(self) -> tuple[State, ...]:
        return ()

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return -values.friction * self.along(signals)


@dataclass(frozen=True)
class ViscousFrictionOfRuns(_FrictionOfRuns):
    """Viscous friction of a run beyond b, the friction that all runs have.

    tau = -c w, c free in each record, as a constant state              [N m]

    The setting `viscous_size` in a result is the root mean square of c [N m s/rad].
    """

    viscous_size: float
    """Standard deviation of the coefficient of a run [N m s/rad]."""

    amplitude_scale = "viscous_size"
    variant = f"viscous friction, {EACH_RUN}"
    unit = "N m s/rad"

    @property
    def size(self) -> float:
        return self.viscous_size

    def along(self, signals: Signals) -> Expression:
        return signals.speed

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate if there are several runs."""
        size = _SIZE * scales.torque / scales.speed
        found = [Candidate(_ScoredViscous(size), columns((size,)), fitted=cls(size))]
        return found if len(scales.runs) > 1 else []


@dataclass(frozen=True)
class DryFrictionOfRuns(_FrictionOfRuns):
    """Dry friction of a run.

    tau = -c sgn w, c free in each record, as a constant state          [N m]

    sgn w is smoothed as that of Coulomb friction.  The setting `dry_size` in a result is the root
    mean square of c [N m].
    """

    dry_size: float
    """Standard deviation of the torque of a run [N m]."""
    width: float
    """Width of the smoothed sign [rad/s]."""

    amplitude_scale = "dry_size"
    variant = f"dry friction, {EACH_RUN}"
    unit = "N m"

    @property
    def size(self) -> float:
        return self.dry_size

    @property
    def sharper(self) -> DryFrictionOfRuns:
        """The term with a ten times narrower sign."""
        return replace(self, width=SHARPER * self.width)

    def along(self, signals: Signals) -> Expression:
        return signals.speed / ca.sqrt(signals.speed * signals.speed + self.width * self.width)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate if there are several runs."""
        size, width = _SIZE * scales.torque, SIGN_WIDTH * scales.speed
        found = [Candidate(_ScoredDry(size, width), columns((size,)), fitted=cls(size, width))]
        return found if len(scales.runs) > 1 else []


@dataclass(frozen=True)
class _ScoredViscous(_Scored, ViscousFrictionOfRuns):
    """Viscous friction as it is scored."""


@dataclass(frozen=True)
class _ScoredDry(_Scored, DryFrictionOfRuns):
    """Dry friction as it is scored."""
