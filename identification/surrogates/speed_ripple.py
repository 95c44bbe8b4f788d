"""Ripple of a speed sensor over the shaft angle: a law outside the catalogue."""

from __future__ import annotations

from dataclasses import dataclass

from identification.effects.effect import CampaignScales, Candidate
from identification.effects.periodic import AbstractPeriodic
from identification.model.term import AbstractSensor, Expression, Signals, Values

__all__ = ["SpeedRipple"]


@dataclass(frozen=True)
class SpeedRipple(AbstractPeriodic, AbstractSensor):
    """Gain of the speed sensor that is periodic in the shaft angle phi.

        logged speed = w (1 + sum_h A_h sin(h k phi) + B_h cos(h k phi))    [rad/s]

    The commutator of a tachogenerator has as many periods per revolution as segments, an eccentric
    encoder disc has one.  The ripple grows with the speed, and the current has no part in it; that
    of a torque falls with the speed, because the inertia filters it.
    """

    ratio: float
    """Scale of the amplitudes [-]."""

    name = "unlisted"
    amplitude_scale = "ratio"
    unit = "-"
    equation = "sensor"
    drivers = ("speed", "position")
    channel = "speed"
    source = (
        "Doebelin, Measurement Systems, 5th edition, section 4.8 (ripple of a tachometer generator)"
    )

    @property
    def size(self) -> float:
        return self.ratio

    @property
    def variant(self) -> str:
        return f"ripple of the speed sensor over the shaft angle, {super().variant}"

    def reading(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        return before * (1 + self.wave(signals, states, values))

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return cls._scanned(scales, cls(1.0))
