"""What an effect on the bench is, and what it may touch.

An effect has several laws: the textbook's and others that real motors obey.  A law is a function
that writes the fields of one `Setup` (hidden plant, single runs, sensors) for a given size and
returns the numbers it chose, which become part of the campaign's truth.
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
    """What is to happen in one run, before it is simulated.

    Args:
        role: training or validation.
        duration: [s].
        temperature: (n_sample,) at the thermometer [degC].
        overrides: Plant fields that differ in this run.
        offset_scale: By what the sensors' zero errors are multiplied in this run [-].
    """

    role: str
    duration: float
    temperature: NDArray[np.float64]
    overrides: dict[str, float] = field(default_factory=dict)
    offset_scale: float = 1.0


@dataclass
class Setup:
    """Everything that a law may change.

    Args:
        motor: Read only.
        plant: The hidden plant, shared by all runs.
        runs: In the order of recording.
        rng: For what the size does not fix: orders, phases, signs, which run.
        offsets: Zero error added to a channel: current, voltage, speed.
        delays: Time by which a channel lags [s].
        difference_time: Span over which the speed is formed from the angle, 0 for a true speed [s].
        is_linear: Whether the voltage truly runs linearly between samples.
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
        """Length of the longest run [s]."""
        return max(run.duration for run in self.runs)

    @property
    def sign(self) -> float:
        """A sign drawn at random."""
        return float(self.rng.choice([-1.0, 1.0]))

    def training_run(self) -> int:
        """Number of a training run drawn at random, never the first where there are others."""
        numbers = [k for k, run in enumerate(self.runs) if run.role == "training"]
        return int(self.rng.choice(numbers[1:] or numbers))


Law = Callable[[Setup, float], dict[str, float]]


@dataclass(frozen=True)
class BenchEffect:
    """One effect that a motor on the bench can have.

    Args:
        name: Its kind.
        equation: electrical, mechanical, thermal or sensor.
        drivers: Signals the missing term depends on, the main one first.
        size_means: What a size of 1 would be.
        typical: A small and a large size as they occur.
        laws: Name to law; the first is the textbook's.
        is_listed: Whether a catalogue is expected to know it.
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
        """Name of the first law."""
        return next(iter(self.laws))
