"""Interface of an effect on the bench, and the quantities that it may change.

An effect has several laws: the textbook law and others that real motors follow.  A law is a
function that sets the fields of a `Setup` (hidden plant, single runs, sensors) for a given size.
It returns the values that it has chosen, which become part of the true values of the campaign.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bench.motors import Motor
from bench.plant import Plant

__all__ = ["BenchEffect", "Law", "RunPlan", "Setup"]


@dataclass
class RunPlan:
    """Plan of one run, before it is simulated.

    Args:
        role: training or validation.
        duration: Duration of the run [s].
        temperature: (n_sample,) temperature at the thermometer [degC].
        overrides: Plant fields that differ in this run.
        offset_scale: Factor on the sensor offsets in this run [-].
    """

    role: str
    duration: float
    temperature: NDArray[np.float64]
    overrides: dict[str, float] = field(default_factory=dict)
    offset_scale: float = 1.0


@dataclass
class Setup:
    """Quantities that a law may change.

    Args:
        motor: The motor; read only.
        plant: The hidden plant, shared by all runs.
        runs: Plans of the runs, in the order of recording.
        rng: Random generator for what the size does not determine: orders, phases, signs,
            choice of a run.
        offsets: Offset of a channel (current, voltage, speed) [SI].
        delays: Delay of a channel [s].
        difference_time: Window over which the speed is computed from the angle, 0 for a
            true speed [s].
        is_linear: Whether the true voltage is linear between samples.
    """

    motor: Motor
    plant: Plant
    runs: list[RunPlan]
    rng: np.random.Generator
    offsets: dict[str, float] = field(default_factory=dict)
    delays: dict[str, float] = field(default_factory=dict)
    difference_time: float = 0.0
    is_linear: bool = False

    @property
    def duration(self) -> float:
        """Duration of the longest run [s]."""
        return max(run.duration for run in self.runs)

    @property
    def sign(self) -> float:
        """Random sign, drawn again at each access."""
        return float(self.rng.choice([-1.0, 1.0]))

    def training_run(self) -> int:
        """Index of a random training run, never the first if there are others."""
        numbers = [k for k, run in enumerate(self.runs) if run.role == "training"]
        return int(self.rng.choice(numbers[1:] or numbers))


Law = Callable[[Setup, float], dict[str, float]]


@dataclass(frozen=True)
class BenchEffect:
    """One effect that the bench can add to a motor.

    Args:
        name: Name of the effect.
        equation: electrical, mechanical, thermal or sensor.
        drivers: Signals that the missing term depends on, the main one first.
        size_means: Meaning of a size of 1.
        typical: A small and a large size that occur in practice.
        laws: Laws by name; the first is the textbook law.
        is_listed: Whether the catalogue of the identification is expected to contain the effect.
    """

    name: str
    equation: str
    drivers: tuple[str, ...]
    size_means: str
    typical: tuple[float, float]
    laws: Mapping[str, Law]
    is_listed: bool = True

    @property
    def textbook(self) -> str:
        """Name of the textbook law, which is the first."""
        return next(iter(self.laws))
