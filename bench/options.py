"""How a campaign is to be run: rows, excitations, temperatures, sensors."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from bench.sensors import Noise

__all__ = ["TRAINING_EXCITATIONS", "VALIDATION_EXCITATIONS", "BenchOptions"]

TRAINING_EXCITATIONS = ("multilevel", "prbs", "multisine", "staircase", "chirp")
VALIDATION_EXCITATIONS = ("multilevel", "ramps")


@dataclass(frozen=True)
class BenchOptions:
    """Settings of a campaign.

    Args:
        rows: Samples of each run.
        training: Number of training runs.
        validation: Number of validation runs.
        noise: Of the sensors.
        excitation: Names from `bench.excitation.EXCITATIONS` for the runs in turn, repeated as
            needed; None for a mixture that a competent engineer would choose.
        direction: both ways, forward only, or mixed (every third run forward only).
        amplitude: Largest voltage, relative to rated [-].
        current_limit: Of the drive, relative to rated current; 0 for none [-].
        temperature_span: Lowest and highest level of the training runs [degC].
        temperature_motion: Movement within a run [K].
        logs_temperature: Whether the thermometer is in the file.
        position: Whether an angle is logged, and whether its zero is that of the shaft.
        hold: True inter-sample behaviour of the voltage (the effect `input_hold` swaps it).
        sample_interval: [s]; None for the motor's own.
        jitter: Scatter of the sampling instants, logged truly, in sample intervals [-].
        sensor_range: Where current and speed clip, relative to rated; 0 for nowhere [-].
        lost_rows: Consecutive rows missing from the middle of every run.
        moving_start: Whether runs begin in motion; at rest otherwise.
        tolerance: Relative tolerance of the simulation's steps.
    """

    rows: int = 6000
    training: int = 5
    validation: int = 2
    noise: Noise = field(default_factory=Noise)
    excitation: tuple[str, ...] | None = None
    direction: Literal["both", "forward", "mixed"] = "both"
    amplitude: float = 0.9
    current_limit: float = 3.0
    temperature_span: tuple[float, float] = (25.0, 120.0)
    temperature_motion: float = 8.0
    logs_temperature: bool = True
    position: Literal["none", "absolute", "incremental"] = "none"
    hold: Literal["zoh", "foh"] = "zoh"
    sample_interval: float | None = None
    jitter: float = 0.0
    sensor_range: float = 0.0
    lost_rows: int = 0
    moving_start: bool = True
    tolerance: float = 1e-8

    def excitation_of(self, number: int) -> str:
        """Name of the excitation of run `number`, counted over training and then validation."""
        if self.excitation is not None:
            return self.excitation[number % len(self.excitation)]
        if number < self.training:
            return TRAINING_EXCITATIONS[number % len(TRAINING_EXCITATIONS)]
        return VALIDATION_EXCITATIONS[(number - self.training) % len(VALIDATION_EXCITATIONS)]

    def is_forward_only(self, number: int) -> bool:
        """Whether run `number` turns one way only."""
        return self.direction == "forward" or (self.direction == "mixed" and number % 3 == 2)
