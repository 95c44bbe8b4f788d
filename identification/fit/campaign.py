"""Records of a campaign: training records to fit and validation records to predict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.errors import InputError
from identification.fit.repeats import first_alike, repeat_warnings
from identification.ingest.run import Run
from identification.model.excitation import Record, records_of
from identification.quantities import REFERENCE_TEMPERATURE_DEGC

__all__ = ["Campaign", "campaign_of"]


@dataclass(frozen=True)
class Campaign:
    """Runs of one motor and the records made of them.

    Args:
        training_runs: Runs to fit, in the order of recording.
        validation_runs: Runs to predict, never fitted.
        training: Records of the training runs.
        validation: Records of the validation runs, numbered after the training runs.
        warnings: Warnings about the set of runs, for the result.
        alike: For each run, training before validation, the index of the first earlier run with the
            same samples; None if there is none.
    """

    training_runs: tuple[Run, ...]
    validation_runs: tuple[Run, ...]
    training: tuple[Record, ...]
    validation: tuple[Record, ...]
    warnings: tuple[str, ...]
    alike: tuple[int | None, ...]


def campaign_of(training: Sequence[Run], validation: Sequence[Run]) -> Campaign:
    """Records of the runs; a channel that is constant in all training runs gets zero weight.

    Raises:
        InputError: The voltage is zero in all training runs, or both current and speed are
            constant.
    """
    logged = [float(np.mean(run.temperature)) for run in training if run.temperature is not None]
    expected = float(np.mean(logged)) if logged else REFERENCE_TEMPERATURE_DEGC
    records = records_of(training, expected=expected)
    hottest = max(float(record.column("peak_temperature")[-1]) for record in records)
    held_out = records_of(validation, len(training), hottest, expected)
    alike = first_alike([*training, *validation])
    warnings = list(repeat_warnings([*training, *validation], len(training), alike))
    stacked = np.concatenate([record.measured for record in records])
    dead = np.ptp(stacked, axis=0) == 0.0
    if not np.any(np.concatenate([record.column("voltage") for record in records])):
        raise InputError(
            "voltage_V is 0 in every training run; expected runs in which the motor is driven",
            file=training[0].name,
            column="voltage_V",
            value=0.0,
        )
    if dead.all():
        raise InputError(
            "neither current_A nor speed_rad_s changes in any training run; expected at least one "
            "that responds to the voltage: check that the sensors were connected",
            file=training[0].name,
            column="current_A",
        )
    for channel, name in enumerate(("current_A", "speed_rad_s")):
        if dead[channel]:
            warnings.append(
                f"{name} never changes in any training run, so it was not fitted; what only that "
                "channel can tell is not identified"
            )
    if dead.any():
        records = [_without(record, dead) for record in records]
        held_out = [_without(record, dead) for record in held_out]
    if all(run.temperature is None for run in training):
        warnings.append(
            "the runs have no temperature: Ra25 and Kt25 are those of the unknown temperature of "
            f"{training[0].name}, and the temperature coefficients are not identified"
        )
    return Campaign(
        tuple(training),
        tuple(validation),
        tuple(records),
        tuple(held_out),
        tuple(warnings),
        alike,
    )


def _without(record: Record, dead: np.ndarray) -> Record:
    return replace(record, weight=record.weight * ~dead)
