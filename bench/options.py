"""Options of a campaign: rows, excitations, temperatures, sensors."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from bench.sensors import Noise

__all__ = ["TRAINING_EXCITATIONS", "VALIDATION_EXCITATIONS", "BenchOptions"]

TRAINING_EXCITATIONS = ("multilevel", "prbs", "multisine", "staircase", "chirp")
VALIDATION_EXCITATIONS = ("multilevel", "ramps")


@dataclass(frozen=True)
class BenchOptions:
    """Options of a campaign.

    Args:
        rows: Number of samples per run.
        training: Number of training runs.
        validation: Number of validation runs.
        noise: Noise of the sensors.
        excitation: Names from `bench.excitation.EXCITATIONS`, assigned to the runs in turn and
            repeated as needed; None for a standard mixture.
        direction: both, forward, or mixed (every third run forward only).
        amplitude: Maximum voltage relative to rated [-].
        current_limit: Current limit of the drive relative to rated current, 0 for none [-].
        temperature_span: Lowest and highest level of the training runs [degC].
        temperature_motion: Temperature variation within a run [K].
        logs_temperature: Whether the file has a temperature column.
        position: none, absolute, or incremental (zero at the start of the run).
        hold: Declared inter-sample hold of the voltage; the true one differs only with the
            effect `input_hold`.
        sample_interval: Sample interval; None for that of the motor [s].
        jitter: Scatter of the sampling instants in sample intervals; the logged times
            include it [-].
        sensor_range: Range of the current and speed sensors relative to rated, 0 for no limit [-].
        lost_rows: Number of consecutive rows missing in the middle of every run.
        moving_start: Whether runs start in motion instead of at standstill.
        tolerance: Relative tolerance per integration step.
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
        """Name of the excitation of run `number`, counted from 0 with training runs first."""
        if self.excitation is not None:
            return self.excitation[number % len(self.excitation)]
        if number < self.training:
            return TRAINING_EXCITATIONS[number % len(TRAINING_EXCITATIONS)]
        return VALIDATION_EXCITATIONS[(number - self.training) % len(VALIDATION_EXCITATIONS)]

    def is_forward_only(self, number: int) -> bool:
        """Return True if run `number` turns in one direction only."""
        return self.direction == "forward" or (self.direction == "mixed" and number % 3 == 2)
