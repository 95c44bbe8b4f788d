"""Records of a campaign: training records to fit and validation records to predict.

Runs with identical samples, within and across training and validation, are found by comparing
samples instead of bytes, so that a copy with another header or other line endings is found.  Time
and temperature are ignored: a copy may start at another time, and the noise of the other channels
is never the same in two runs.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from identification.errors import InputError
from identification.ingest.run import Run
from identification.model.excitation import Record, records_of
from identification.quantities import REFERENCE_TEMPERATURE_DEGC
from identification.warning import ResultWarning

__all__ = ["Campaign", "Voltage", "campaign_of", "first_alike"]

Voltage = Literal["logged", "smoothed"]
"""Voltage that drives a simulation."""

_ONCE: Final = "give each run once"


@dataclass(frozen=True)
class Campaign:
    """Runs of one motor and the records made of them."""

    training_runs: tuple[Run, ...]
    """Runs to fit, in the order of recording."""
    validation_runs: tuple[Run, ...]
    """Runs to predict, never fitted."""
    training: tuple[Record, ...]
    """Records of the training runs."""
    validation: tuple[Record, ...]
    """Records of the validation runs, numbered after the training runs."""
    warnings: tuple[ResultWarning, ...]
    """Warnings about the set of runs, for the result."""
    alike: tuple[int | None, ...]
    """For each run, training before validation, the index of the first earlier run with the same
    samples; None if there is none."""
    voltage: Voltage = "logged"
    """Voltage of the records: as logged, or without its noise."""

    @property
    def sample_interval(self) -> float:
        """Median sample interval of the training runs [s]."""
        return float(np.median([1.0 / run.sample_rate_hz for run in self.training_runs]))


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
    warnings = list(_repeat_warnings([*training, *validation], len(training), alike))
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
            message = (
                f"{name} never changes in any training run, so it was not fitted; what only that "
                "channel can tell is not identified"
            )
            warnings.append(ResultWarning("unfitted_channel", "warning", message))
    if dead.any():
        records, held_out = (
            [replace(record, weight=record.weight * ~dead) for record in each]
            for each in (records, held_out)
        )
    if all(run.temperature is None for run in training):
        message = (
            "the runs have no temperature: Ra25 and Kt25 are those of the unknown temperature of "
            f"{training[0].name}, and the temperature coefficients are not identified"
        )
        warnings.append(ResultWarning("unknown_temperature", "warning", message))
    return Campaign(
        tuple(training), tuple(validation), tuple(records), tuple(held_out), tuple(warnings), alike
    )


def first_alike(runs: Sequence[Run]) -> tuple[int | None, ...]:
    """For each run the index of the first earlier run with the same samples; None if none has."""
    first: dict[str, int] = {}
    found: list[int | None] = []
    for place, run in enumerate(runs):
        key = _key(run)
        found.append(None if key is None else first.get(key))
        if key is not None:
            first.setdefault(key, place)
    return tuple(found)


def _key(run: Run) -> str | None:
    """Hash of the samples; None if nothing changes, since two idle runs may be identical."""
    channels = (run.voltage, run.current, run.speed)
    if not any(np.ptp(channel) > 0.0 for channel in channels):
        return None
    digest = hashlib.sha256()
    for channel in channels:
        # -0.0 equals 0.0 but has other bytes.
        digest.update((channel + 0.0).tobytes())
    return digest.hexdigest()


def _repeat_warnings(
    runs: Sequence[Run], training: int, alike: Sequence[int | None]
) -> tuple[ResultWarning, ...]:
    """Warnings about identical runs, of which the first `training` are fitted."""
    groups: dict[int, list[int]] = {}
    for index, first in enumerate(alike):
        groups.setdefault(index if first is None else first, []).append(index)
    warnings = []
    for indices in groups.values():
        fitted = [runs[index].name for index in indices if index < training]
        checked = [runs[index].name for index in indices if index >= training]
        if len(fitted) > 1:
            message = (
                f"{_same(fitted)}: all are fitted, so they count {len(fitted)} times, and "
                f"intervals are too narrow by up to {math.sqrt(len(fitted)):.2g} times"
            )
            warnings.append(ResultWarning("repeated_runs", "warning", message, _ONCE))
        if fitted and checked:
            message = (
                f"{_same([*fitted[:1], *checked])}: the model was fitted to them, so they check "
                "neither it nor its effects"
            )
            fix = "validate with runs that are not fitted"
            warnings.append(ResultWarning("fitted_validation_run", "warning", message, fix))
        elif len(checked) > 1:
            message = f"{_same(checked)}: they count {len(checked)} times in the validation errors"
            warnings.append(ResultWarning("repeated_runs", "warning", message, _ONCE))
    return tuple(warnings)


def _same(names: Sequence[str]) -> str:
    distinct = list(dict.fromkeys(names))
    if len(distinct) == 1:
        return f"{len(names)} of the runs given, named {distinct[0]}, hold the same samples"
    return f"{', '.join(distinct[:-1])} and {distinct[-1]} hold the same samples"
