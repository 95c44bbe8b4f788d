"""Runs whose shaft another machine drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.checks import check_runs
from identification.ingest import Run
from tests.motors import campaign, motor_named, noiseless

MOTOR = motor_named("servo 100 W")
CONSTANT = MOTOR.vector[2]


def generator(turned: Run, *, offset: float = 0.0) -> Run:
    """Open terminals: the shaft is brought to speed in a second and runs on."""
    rng = np.random.default_rng(3)
    time = turned.time
    speed = 200.0 * np.minimum(time / (0.4 * time[-1]), 1.0)
    noise = rng.normal(0.0, 1.0, (3, time.size))
    return replace(
        turned,
        name="generator.csv",
        sha256="g",
        speed=speed + 0.3 * noise[0],
        voltage=CONSTANT * speed + 0.01 * noise[1],
        current=offset + 0.02 * noise[2],
    )


def codes_of(runs: list[Run]) -> dict[str, set[str]]:
    """Codes of the contradictions by file."""
    found: dict[str, set[str]] = {}
    for one in check_runs(runs).refused:
        found.setdefault(one.file, set()).add(one.code)
    return found


@pytest.mark.parametrize("offset", [0.0, 5e-3])
def test_a_shaft_that_another_machine_drives_is_refused(offset: float) -> None:
    """The finding gives Kt, which the run shows, and refuses no other run."""
    runs = campaign(MOTOR, seed=5, runs=3)
    driven = generator(runs[0], offset=offset)

    assert codes_of([*runs, driven]) == {"generator.csv": {"driven_shaft"}}
    (finding,) = check_runs([*runs, driven]).refused
    given = float(finding.message.rpartition("=")[2])
    assert given == pytest.approx(CONSTANT, rel=0.02)


def test_a_motor_that_coasts_is_not_driven() -> None:
    """The generator with its time reversed: the speed falls without current."""
    runs = campaign(MOTOR, seed=5, runs=3)
    driven = generator(runs[0])
    coasting = replace(
        driven, name="coasting.csv", speed=driven.speed[::-1], voltage=driven.voltage[::-1]
    )

    assert "driven_shaft" not in codes_of([*runs, coasting]).get("coasting.csv", set())


@pytest.mark.parametrize("share", [0.2, 5.0])
def test_a_motor_with_another_load_is_not_driven(share: float) -> None:
    """Another inertia in one run, up to the factor of a disk or of a bare shaft."""
    values = (*MOTOR.values[:4], share * MOTOR.values[4], *MOTOR.values[5:])
    runs = [*campaign(MOTOR, seed=5, runs=3), *noiseless(replace(MOTOR, values=values), seed=8)]
    named = [replace(run, name=f"{k}.csv", sha256=str(k)) for k, run in enumerate(runs)]

    assert not any("driven_shaft" in codes for codes in codes_of(named).values())
