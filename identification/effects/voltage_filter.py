"""Low-pass filter of the logged voltage, in front of the logger or of its samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.effects.confusion import INDUCTANCE
from identification.effects.effect import AbstractEffect, CampaignScales, Candidate, register
from identification.effects.parameters import columns, shape
from identification.model.parameter import Parameter
from identification.model.term import AbstractVoltageFilter, Expression, Signals, Values

__all__ = ["VoltageFilter"]

_FASTEST: Final = 0.3
"""Shortest time constant, over the sample interval: a filter passes 96 % of a step in a sample."""
_JUMP: Final = 0.1
"""Least change between two samples that is a jump, over the range of the voltage."""


@dataclass(frozen=True)
class _VoltageFilter(AbstractEffect, AbstractVoltageFilter):
    """First-order low-pass filter between the terminal voltage, held between samples, and the log.

    The inverse of the filter returns the terminal voltage from two samples of the log.
    """

    fastest: float
    """Shortest time constant that the sampling resolves [s]."""
    slowest: float
    """Longest time constant [s]."""

    name = "voltage_filter"
    drivers = ("voltage",)
    source = "Doebelin, Measurement Systems, 5th edition, chapter 3 (first-order instruments)"
    confusions = (INDUCTANCE,)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            shape("time_constant", "s", "time constant of the filter", self.fastest, self.slowest),
        )

    def supplied(self, before: Expression, signals: Signals, values: Values) -> Expression:
        """Terminal voltage over the interval; the last one of a record has no length [V]."""
        kept = ca.exp(-signals.interval / values.time_constant)
        change = ca.if_else(signals.interval > 0, signals.voltage_change / (1 - kept), 0)
        return before + change

    @classmethod
    def is_excluded(cls, scales: CampaignScales) -> bool:
        """True if most jumps of the logged voltage end within a sample.

        After a filter, a step continues in the next sample with the fraction exp(-h / tau).
        """
        left: list[Array] = []
        for record in scales.records:
            voltage = record.column("voltage")
            change = np.abs(np.diff(voltage))
            jump = np.flatnonzero(change[:-1] > _JUMP * np.ptp(voltage))
            left.append(change[jump + 1] / change[jump])
        found = np.concatenate(left)
        return bool(found.size and np.median(found) < np.exp(-1.0 / _FASTEST))

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        scanned = [(f * scales.interval,) for f in (0.7, 3.0, 12.0, 50.0)]
        term = cls(_FASTEST * scales.interval, 300 * scales.interval)
        return [Candidate(term, columns(*scanned))]


@dataclass(frozen=True)
class DigitalVoltageFilter(_VoltageFilter):
    """Filter of the samples of the voltage, whose output is logged with them."""

    law: str = "filter of the samples"
    """Name of the law in a result."""

    behind = 1

    @property
    def variant(self) -> str:
        return self.law

    @property
    def rival_laws(self) -> tuple[VoltageFilter]:
        """The other law: the two differ by a delay of one sample, which another effect can fit."""
        return (VoltageFilter(self.fastest, self.slowest),)


@register
@dataclass(frozen=True)
class VoltageFilter(_VoltageFilter):
    """First-order low-pass filter in the logged voltage.

        tau dy/dt = v - y,   logged voltage = y                             [V]
        y_k = a y_(k-1) + (1 - a) v_k,   a = exp(-h / tau)                  [V]

    The first law is a filter of the terminal voltage v, which is held from sample to sample; the
    voltage over the interval after sample k is v = y_k + (y_(k+1) - y_k) / (1 - a).  The second law
    is a filter of the samples, such as exponential smoothing in a logger; h is the sample interval,
    and v_k = y_k + (y_k - y_(k-1)) a / (1 - a).
    """

    laws = (DigitalVoltageFilter,)

    @property
    def rival_laws(self) -> tuple[DigitalVoltageFilter]:
        """The other law."""
        return (DigitalVoltageFilter(self.fastest, self.slowest),)

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        return [*super().candidates(scales), *DigitalVoltageFilter.candidates(scales)]
