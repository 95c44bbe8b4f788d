"""Friction that differs from run to run, as bearings and brushes run in and grease spreads.

It may also fade within each run, as grease warms up.

If all runs have a dry friction as well, its differences are a variant of Coulomb friction, which is
in the catalogue.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar, Final, Self

import casadi as ca

from identification.effects.effect import AbstractEffect, CampaignScales, Candidate
from identification.effects.friction import SHARPER, SIGN_WIDTH
from identification.effects.parameters import amplitude, columns, shape
from identification.effects.runs import EACH_RUN
from identification.model.parameter import Parameter
from identification.model.term import AbstractTorque, Expression, Signals, State, Values

__all__ = ["DryFrictionOfRuns", "ViscousFrictionOfRuns"]

_SIZE: Final = 0.05
"""First guess of the friction at the RMS speed, over the torque scale."""
_FADING: Final = (0.05, 20.0)
"""Range of the time constant over the duration of the longest run.  Beyond it, the friction is an
event at the start or a constant."""
_FIRST: Final = 0.5
"""First guess of the time constant over the duration of the longest run."""


@dataclass(frozen=True)
class _FrictionOfRuns(AbstractEffect, AbstractTorque):
    """Friction whose coefficient c is free in each record, as a state."""

    duration: float = field(default=0.0, kw_only=True)
    """Duration of the longest run [s]; zero if unknown."""
    fades: bool = field(default=False, kw_only=True)
    """True if the coefficient falls exponentially within each run."""

    constant: ClassVar[str]
    """Variant with a constant coefficient."""
    unit: ClassVar[str]
    """Unit of the coefficient."""

    name = "unlisted"
    drivers = ("time", "speed")
    is_approximate = True
    source = "Harris and Kotzalas, Rolling Bearing Analysis, 5th edition, chapter 10 (friction)"

    @property
    @abstractmethod
    def size(self) -> float:
        """Standard deviation of the coefficients, in their unit."""

    @abstractmethod
    def along(self, signals: Signals) -> Expression:
        """Torque against the motion for a coefficient of one."""

    @property
    def variant(self) -> str:
        return f"{self.constant}, which fades within it" if self.fades else self.constant

    @property
    def richer(self) -> tuple[Self, ...]:
        return () if self.fades or not self.duration else (replace(self, fades=True),)

    @property
    def varies(self) -> bool:
        return True

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        if not self.fades:
            return ()
        lower, upper = (share * self.duration for share in _FADING)
        meaning = "time constant of the friction, T in the formula"
        return (shape("fading_time", "s", meaning, lower, upper),)

    @property
    def states(self) -> tuple[State, ...]:
        return (State("friction", self.unit, scale=self.size, is_own=True),)

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return -states.friction * self.along(signals)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        return [-states.friction / values.fading_time if self.fades else ca.SX(0)]


class _Scored(_FrictionOfRuns):
    """The friction with one coefficient for all runs, which is scored for each record."""

    @property
    def richer(self) -> tuple[Self, ...]:
        return ()

    @property
    def varies(self) -> bool:
        return False

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        friction = amplitude("friction", self.unit, "friction of a run", self.size, signed=True)
        return (*super().parameters, friction)

    @property
    def states(self) -> tuple[State, ...]:
        return ()

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        faded = ca.exp(-signals.time / values.fading_time) if self.fades else 1.0
        return -values.friction * faded * self.along(signals)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        return []


def _candidates(scored: _Scored, fitted: _FrictionOfRuns) -> list[Candidate]:
    """A friction that is constant within each run, and one that fades."""
    start = columns((_FIRST * fitted.duration, scored.size))
    return [
        Candidate(scored, columns((scored.size,)), fitted=fitted),
        Candidate(replace(scored, fades=True), start, fitted=replace(fitted, fades=True)),
    ]


@dataclass(frozen=True)
class ViscousFrictionOfRuns(_FrictionOfRuns):
    """Viscous friction of a run beyond b, the friction that all runs have.

    tau = -c w, c free in each record                                   [N m]
    dc/dt = 0, or -c / T if it fades within each run            [N m s/rad s]

    The setting `viscous_size` in a result is the root mean square of c [N m s/rad].
    """

    viscous_size: float
    """Standard deviation of the coefficient of a run [N m s/rad]."""

    amplitude_scale = "viscous_size"
    constant = f"viscous friction, {EACH_RUN}"
    unit = "N m s/rad"

    @property
    def size(self) -> float:
        return self.viscous_size

    def along(self, signals: Signals) -> Expression:
        return signals.speed

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """Candidates if there are several runs."""
        size, duration = _SIZE * scales.torque / scales.speed, scales.run_duration
        found = _candidates(_ScoredViscous(size, duration=duration), cls(size, duration=duration))
        return found if len(scales.runs) > 1 else []


@dataclass(frozen=True)
class DryFrictionOfRuns(_FrictionOfRuns):
    """Dry friction of a run.

    tau = -c sgn w, c free in each record                               [N m]
    dc/dt = 0, or -c / T if it fades within each run                  [N m/s]

    sgn w is smoothed as that of Coulomb friction.  The setting `dry_size` in a result is the root
    mean square of c [N m].
    """

    dry_size: float
    """Standard deviation of the torque of a run [N m]."""
    width: float
    """Width of the smoothed sign [rad/s]."""

    amplitude_scale = "dry_size"
    constant = f"dry friction, {EACH_RUN}"
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
        """Candidates if there are several runs."""
        own = _SIZE * scales.torque, SIGN_WIDTH * scales.speed
        duration = scales.run_duration
        found = _candidates(_ScoredDry(*own, duration=duration), cls(*own, duration=duration))
        return found if len(scales.runs) > 1 else []


@dataclass(frozen=True)
class _ScoredViscous(_Scored, ViscousFrictionOfRuns):
    """Viscous friction as it is scored."""


@dataclass(frozen=True)
class _ScoredDry(_Scored, DryFrictionOfRuns):
    """Dry friction as it is scored."""
