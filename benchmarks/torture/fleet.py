"""Fleet of small motors of one type, recorded on the simulated bench, for batches."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from bench import Motor, make_campaign, motor

__all__ = ["fleet_motor", "write_fleet"]

_SPREAD = 0.03


def fleet_motor(number: int) -> Motor:
    """Motor of the fleet: a servo of 150 W with the tolerances of a series."""
    kind = motor("servo_150w")
    factors = np.exp(np.random.default_rng([number, 77]).normal(0.0, _SPREAD, 5))
    names = ("Ra25", "Kt25", "J", "b", "L")
    values = {n: getattr(kind, n) * float(f) for n, f in zip(names, factors, strict=True)}
    return dataclasses.replace(kind, name=f"motor-{number:03d}", **values)


def write_fleet(directory: Path, count: int, *, rows: int = 200, seed: int = 0) -> Path:
    """Simulate a fleet; write its runs and the manifest of a batch.

    Args:
        directory: Target directory.
        count: Number of motors.
        rows: Samples of each of the two runs of a motor.
        seed: Seed of the noise; the motors do not depend on it.

    Returns:
        Path of the manifest.
    """
    lines = ["motor,training"]
    for number in range(count):
        campaign = make_campaign(
            fleet_motor(number), seed=seed * 100_000 + number, rows=rows, training=2, validation=0
        )
        name = campaign.motor.name
        campaign.write(directory / name)
        lines.append(f"{name},{name}/training_1.csv;{name}/training_2.csv")
    manifest = directory / "manifest.csv"
    manifest.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return manifest
