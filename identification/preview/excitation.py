"""Excitation of a run: ranges, directions of rotation, standstill, temperature span."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.ingest.run import Run

__all__ = ["Excitation", "excitation_of"]

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


def excitation_of(runs: Sequence[Run], fastest: float | None = None) -> Excitation:
    """Excitation of runs together.

    The shaft stands below a fraction of `fastest`, by default the largest speed of the runs
    [rad/s].
    """
    if fastest is None:
        fastest = max(float(np.abs(run.speed).max()) for run in runs)
    speed = np.concatenate([run.speed[:-1] for run in runs])
    weights = np.concatenate([np.where(run.joined, np.diff(run.time), 0.0) for run in runs])
    total, limit = float(weights.sum()), _STANDSTILL * fastest
    forward, reverse, standstill = (
        float(weights[chosen].sum()) / total if total > 0.0 else 0.0
        for chosen in (speed > limit, speed < -limit, np.abs(speed) <= limit)
    )
    logged = [run.temperature for run in runs if run.temperature is not None]
    return Excitation(
        forward=forward,
        reverse=reverse,
        standstill=standstill,
        voltage_V=_range([run.voltage for run in runs]),
        current_A=_range([run.current for run in runs]),
        speed_rad_s=_range([run.speed for run in runs]),
        temperature_degC=_range(logged) if logged else None,
        duration_s=total,
    )


def _range(signals: Sequence[Array]) -> tuple[float, float]:
    return min(float(x.min()) for x in signals), max(float(x.max()) for x in signals)
