"""Excitation of a run: ranges, directions of rotation, standstill, temperature span."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.arrays import Array, Bool
from identification.ingest.run import Run

__all__ = ["Excitation", "excitation_of", "joined"]

_STANDSTILL: Final = 0.01
"""Speed below which a shaft counts as standing, over the largest speed of all runs [-]."""


@dataclass(frozen=True)
class Excitation:
    """Operating points that a set of samples covers."""

    forward: float
    """Fraction of the time at positive speed [-]."""
    reverse: float
    """Fraction of the time at negative speed [-]."""
    standstill: float
    """Fraction of the time at standstill [-]."""
    voltage_V: tuple[float, float]
    """Smallest and largest voltage [V]."""
    current_A: tuple[float, float]
    """Smallest and largest current [A]."""
    speed_rad_s: tuple[float, float]
    """Smallest and largest speed [rad/s]."""
    temperature_degC: tuple[float, float] | None
    """Lowest and highest temperature [degC]; None if not logged."""
    duration_s: float
    """Time without gaps [s]."""

    @property
    def temperature_span(self) -> float:
        """Difference of highest and lowest temperature; zero if not logged [K]."""
        low, high = self.temperature_degC or (0.0, 0.0)
        return high - low

    @property
    def directions(self) -> int:
        """Number of directions in which the shaft turns for more than a hundredth of the time."""
        return sum(fraction > _STANDSTILL for fraction in (self.forward, self.reverse))


def excitation_of(run: Run, fastest: float) -> Excitation:
    """Excitation of one run; `fastest` is the largest speed in all runs [rad/s]."""
    durations = np.diff(run.time)
    inside = np.zeros(durations.size, dtype=bool)
    for first, last in run.segments:
        inside[first : last - 1] = True
    weights = np.where(inside, durations, 0.0)
    total = float(weights.sum())
    speed = run.speed[:-1]
    limit = _STANDSTILL * fastest

    def fraction(chosen: Bool) -> float:
        return float(weights[chosen].sum()) / total if total > 0.0 else 0.0

    return Excitation(
        forward=fraction(speed > limit),
        reverse=fraction(speed < -limit),
        standstill=fraction(np.abs(speed) <= limit),
        voltage_V=_range(run.voltage),
        current_A=_range(run.current),
        speed_rad_s=_range(run.speed),
        temperature_degC=None if run.temperature is None else _range(run.temperature),
        duration_s=total,
    )


def joined(parts: Sequence[Excitation]) -> Excitation:
    """Excitation of several runs together, from that of each."""
    total = sum(part.duration_s for part in parts) or 1.0
    logged = [part.temperature_degC for part in parts if part.temperature_degC is not None]

    return Excitation(
        forward=sum(part.forward * part.duration_s for part in parts) / total,
        reverse=sum(part.reverse * part.duration_s for part in parts) / total,
        standstill=sum(part.standstill * part.duration_s for part in parts) / total,
        voltage_V=_covering([part.voltage_V for part in parts]),
        current_A=_covering([part.current_A for part in parts]),
        speed_rad_s=_covering([part.speed_rad_s for part in parts]),
        temperature_degC=_covering(logged) if logged else None,
        duration_s=sum(part.duration_s for part in parts),
    )


def _range(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _covering(ranges: Sequence[tuple[float, float]]) -> tuple[float, float]:
    return min(low for low, _ in ranges), max(high for _, high in ranges)
