"""Viscous friction that differs from run to run, as bearings run in and grease spreads.

The dry part of such a friction is a variant of Coulomb friction, which is in the catalogue.
"""

from __future__ import annotations

from dataclasses import dataclass

from identification.effects.effect import EACH_RUN, AbstractEffect, CampaignScales, Candidate
from identification.effects.parameters import amplitude, columns
from identification.model.parameter import Parameter
from identification.model.term import AbstractTorque, Expression, Signals, State, Values

__all__ = ["ViscousOfRuns"]


@dataclass(frozen=True)
class ViscousOfRuns(AbstractEffect, AbstractTorque):
    """Viscous friction of a run beyond b, the friction that all runs have.

    tau = -c w, c free in each record, as a constant state              [N m]

    The setting `viscous_size` in a result is the root mean square of c [N m s/rad].
    """

    viscous_size: float
    """Standard deviation of the friction coefficient of a run [N m s/rad]."""

    name = "unlisted"
    amplitude_scale = "viscous_size"
    drivers = ("time", "speed")
    variant = f"viscous friction, {EACH_RUN}"
    source = "Harris and Kotzalas, Rolling Bearing Analysis, 5th edition, chapter 10 (friction)"

    @property
    def varies(self) -> bool:
        return True

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return ()

    @property
    def states(self) -> tuple[State, ...]:
        return (State("viscous", "N m s/rad", scale=self.viscous_size, is_own=True),)

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return -states.viscous * signals.speed

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate if there are several runs; the amplitude is scored for each record."""
        size = 0.05 * scales.torque / scales.speed
        found = [Candidate(_Scored(size), columns((size,)), fitted=cls(size))]
        return found if len(scales.runs) > 1 else []


@dataclass(frozen=True)
class _Scored(ViscousOfRuns):
    """The friction with one parameter for all runs, whose sensitivity is that of each run."""

    @property
    def varies(self) -> bool:
        return False

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        size = self.viscous_size
        return (amplitude("viscous", "N m s/rad", "friction of a run", size, signed=True),)

    @property
    def states(self) -> tuple[State, ...]:
        return ()

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return -values.viscous * signals.speed
