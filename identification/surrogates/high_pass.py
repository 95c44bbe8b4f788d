"""Sensor that is coupled by alternating current, as a current transformer or an oscilloscope is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.effects.effect import AbstractEffect, CampaignScales, Candidate
from identification.effects.parameters import columns, shape
from identification.model.parameter import Parameter
from identification.model.term import AbstractSensor, Channel, Expression, Signals, State, Values

__all__ = ["SensorHighPass"]

_CHANNELS: Final[tuple[tuple[Channel, str], ...]] = (("current", "A"), ("speed", "rad/s"))
_FASTEST: Final = 3.0
"""Shortest time constant, over the sample interval: a faster one leaves only the steps."""
_SLOWEST: Final = 30.0
"""Longest time constant, over the duration of the longest run: a slower one loses 3 % of a constant
signal, and less of one that reverses."""
_SCANNED: Final = (0.01, 0.05, 0.25, 1.0, 5.0)
"""Scanned time constants, over the duration of the longest run."""


@dataclass(frozen=True)
class SensorHighPass(AbstractEffect, AbstractSensor):
    """High-pass filter of first order between a quantity x and its logged value.

        tau dm/dt = x - m,   logged = x - m                                 [A, rad/s]

    A current transformer, and an oscilloscope whose input is coupled by alternating current, do not
    transmit the mean m.  Its value at the start of a run is unknown.
    """

    channel: Channel
    """Channel of the sensor."""
    largest: float
    """Largest logged value [A, rad/s]."""
    fastest: float
    """Shortest time constant [s]."""
    slowest: float
    """Longest time constant [s]."""

    name = "unlisted"
    source = "Doebelin, Measurement Systems, 5th edition, chapter 3 (first-order systems)"

    @property
    def variant(self) -> str:
        return f"high-pass filter of the {self.channel} sensor"

    @property
    def drivers(self) -> tuple[str, ...]:
        return (self.channel,)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = "time constant of the high-pass filter"
        return (shape("time_constant", "s", meaning, self.fastest, self.slowest),)

    @property
    def states(self) -> tuple[State, ...]:
        return (State("lost", dict(_CHANNELS)[self.channel], scale=self.largest),)

    def rates(self, signals: Signals, states: Values, values: Values) -> list[Expression]:
        return [(getattr(signals, self.channel) - states.lost) / values.time_constant]

    def reading(
        self, before: Expression, signals: Signals, states: Values, values: Values
    ) -> Expression:
        return before - states.lost

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        """One candidate for each sensor, scored at several time constants."""
        fastest, slowest = _FASTEST * scales.interval, _SLOWEST * scales.run_duration
        scanned = [(factor * scales.run_duration,) for factor in _SCANNED]
        starts = columns(*[one for one in scanned if one[0] > fastest] or [(slowest / 2,)])
        found = []
        for column, (channel, _) in enumerate(_CHANNELS):
            largest = max(float(np.abs(r.measured[:, column]).max()) for r in scales.records)
            found.append(Candidate(cls(channel, largest, fastest, slowest), starts))
        return found
