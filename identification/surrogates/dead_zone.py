"""Sensor with a dead zone, as of a tachogenerator with brushes or of an amplifier without bias."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import casadi as ca
import numpy as np

from identification.effects.effect import AbstractEffect, CampaignScales, Candidate
from identification.effects.parameters import amplitude, columns
from identification.model.parameter import Parameter
from identification.model.term import AbstractSensor, Channel, Expression, Signals, Values

__all__ = ["SensorDeadZone"]

_CORNER: Final = 3e-3
"""Width of the rounded corners of the dead zone, over the largest reading."""
_CHANNELS: Final[tuple[Channel, Channel]] = ("current", "speed")
_UNITS: Final[dict[Channel, str]] = {"current": "A", "speed": "rad/s"}


@dataclass(frozen=True)
class SensorDeadZone(AbstractEffect, AbstractSensor):
    """Sensor of the current or the speed that reads too little by a constant, and zero within it.

        logged = x - d    for x > d,      x + d    for x < -d,      0    between   [A, rad/s]

    The brushes of a tachogenerator lose a part of its voltage; an amplifier without bias current
    loses the voltage that its transistors need to conduct.  The corners are rounded.
    """

    channel: Channel
    """Channel of the sensor."""
    largest: float
    """Largest logged value [A, rad/s]."""

    name = "unlisted"
    source = "Doebelin, Measurement Systems, 5th edition, chapter 3 (threshold, dead space)"

    @property
    def variant(self) -> str:
        return f"dead zone of the {self.channel} sensor"

    @property
    def drivers(self) -> tuple[str, ...]:
        return (self.channel,)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = "half the width of the dead zone, d in the formula"
        return (amplitude("threshold", _UNITS[self.channel], meaning, self.largest),)

    def reading(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        signal, corner = getattr(signals, self.channel), _CORNER * self.largest
        far = ca.sqrt((signal - values.threshold) ** 2 + corner**2)
        near = ca.sqrt((signal + values.threshold) ** 2 + corner**2)
        return before + (far - near) / 2

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate for each sensor."""
        found = []
        for column, channel in enumerate(_CHANNELS):
            largest = max(float(np.abs(r.measured[:, column]).max()) for r in scales.records)
            starts = columns((0.01 * largest,), (0.05 * largest,))
            found.append(Candidate(cls(channel, largest), starts))
        return found
