"""Validation runs with another load on the shaft than the training runs."""

from __future__ import annotations

from dataclasses import replace

import pytest

from identification.checks.campaign import admitted
from identification.checks.other_inertia import other_inertia_findings
from identification.ingest import Run
from identification.options import FitOptions
from tests.motors import campaign, motor_named

SERVO = motor_named("servo 100 W")
LOADED = replace(SERVO, values=(*SERVO.values[:4], 1.8 * SERVO.values[4], *SERVO.values[5:]))
"""The same motor with a disk."""


def runs_of(seed: int) -> tuple[list[Run], list[Run]]:
    """Runs of the motor without and with the disk."""
    return campaign(SERVO, seed=seed), campaign(LOADED, seed=seed + 100, runs=1)


def test_a_validation_run_with_a_disk_is_named() -> None:
    """The ratio of the inertias is 1.8."""
    training, loaded = runs_of(1)
    (finding,) = admitted(training, loaded, FitOptions()).findings

    assert finding.code == "other_inertia"
    assert finding.severity == "suspect"
    assert finding.file == loaded[0].name
    assert finding.value == pytest.approx(1.8, rel=0.05)


def test_training_runs_with_other_disks_are_left_to_the_search() -> None:
    """If training runs differ, the change of the inertia can be found."""
    training, loaded = runs_of(2)

    assert other_inertia_findings([*training, *loaded], loaded) == []


@pytest.mark.parametrize("seed", range(5))
def test_validation_runs_of_the_same_motor_agree(seed: int) -> None:
    """Noise and temperature change the estimate by less than the limit."""
    *training, last = campaign(SERVO, seed=seed, runs=4)

    assert other_inertia_findings(training, [last]) == []
