"""Remarks on the measured channels of a predicted run."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from identification.checks import Finding
from identification.ingest import Run, read_run
from identification.prediction import predict
from identification.remarks import contradictions, remarks_on

DATA = Path(__file__).parents[1] / "data"


def known(campaign: str) -> dict[str, Any]:
    """Result whose parameters are the true ones of a campaign in data/."""
    truth = json.loads((DATA / campaign / "truth.json").read_text(encoding="utf-8"))
    parameters = {name: {"estimate": value} for name, value in truth["parameters"].items()}
    noise = {"current_A": 0.02, "speed_rad_s": 0.02}
    return {"declared": {"parameters": parameters}, "parameters": parameters, "noise": noise}


PAPER, SERVO = known("paper_motor"), known("clean_servo")
RUN = read_run(DATA / "paper_motor" / "validation_1.csv")
"""Run of a motor whose friction keeps current and speed proportional: alone, it determines neither
R nor K, so that only the prediction shows a wrong speed."""


def found(result: dict[str, Any], run: Run) -> list[Finding]:
    """Contradictions of a run with the prediction of a result."""
    return list(contradictions(result, run, predict(result, run)))


@pytest.mark.parametrize("campaign", ["paper_motor", "clean_servo"])
@pytest.mark.parametrize("name", ["training_3.csv", "validation_2.csv"])
def test_run_of_the_same_motor_has_no_remark(campaign: str, name: str) -> None:
    """Runs of the motor of the result, of which some turn in one direction only."""
    run = read_run(DATA / campaign / name)

    assert remarks_on(known(campaign), run, predict(known(campaign), run)) == []


@pytest.mark.parametrize(
    ("changed", "code", "column", "correction"),
    [
        ({"speed": -RUN.speed}, "reversed_channel", "speed_rad_s", "speed_rad_s * -1"),
        ({"current": -RUN.current}, "reversed_channel", "current_A", "current_A * -1"),
        ({"voltage": -RUN.voltage}, "reversed_channel", "voltage_V", "voltage_V * -1"),
        (
            {"speed": RUN.speed * 30.0 / np.pi},
            "scaled_channel",
            "speed_rad_s",
            "speed_rad_s * 0.10471975512",
        ),
        ({"current": RUN.current * 1e3}, "scaled_channel", "current_A", "current_A * 0.001"),
        ({"voltage": RUN.voltage * 1e3}, "scaled_channel", "voltage_V", "voltage_V * 0.001"),
    ],
)
def test_wrong_sign_and_scale_are_named_with_their_correction(
    changed: dict[str, Any], code: str, column: str, correction: str
) -> None:
    """One fault each: a reversed sensor or battery, rpm, mA, mV under the header in SI units."""
    run = replace(RUN, **changed)

    (finding,) = found(PAPER, run)

    assert (finding.code, finding.column) == (code, column)
    assert finding.corrections == (f"validation_1.csv:{column}={correction}",)
    (remark,) = (r for r in remarks_on(PAPER, run, predict(PAPER, run)) if "contradicts" in r)
    assert f"--map '{finding.corrections[0]}'" in remark


def test_exchanged_columns_are_named_by_the_checks_of_the_run() -> None:
    """Current and speed of the servo, whose balances hold only with the two exchanged."""
    run = read_run(DATA / "clean_servo" / "validation_1.csv")
    run = replace(run, current=run.speed, speed=run.current)

    assert [finding.code for finding in found(SERVO, run)] == ["exchanged_channels"]


@pytest.mark.parametrize(("campaign", "scale"), [("clean_servo", 1.0), ("paper_motor", 2.0)])
def test_run_of_another_motor_is_foreign(campaign: str, scale: float) -> None:
    """Another shape of current and speed, or half of the torque constant."""
    run = read_run(DATA / campaign / "validation_1.csv")
    run = replace(run, speed=run.speed * scale)

    assert [finding.code for finding in found(PAPER, run)] == ["foreign_motor"]


def test_dead_sensor_is_named_and_a_run_of_inputs_has_no_remark() -> None:
    """A current of zero beside a speed that moves; a planned run has neither."""
    dead = replace(RUN, current=np.zeros(RUN.rows))
    planned = replace(dead, speed=np.zeros(RUN.rows))

    assert [finding.code for finding in found(PAPER, dead)] == ["dead_sensor"]
    assert found(PAPER, planned) == []


def test_noise_without_a_signal_is_no_other_motor() -> None:
    """A motor at a constant speed draws a constant current, and the sensor adds its noise."""
    noise = np.random.default_rng(3).normal(0.0, 0.02, (2, RUN.rows))
    run = replace(RUN, voltage=np.full(RUN.rows, 12.0))
    steady = predict(PAPER, run).iloc[-1]
    run = replace(run, current=steady.current_A + noise[0], speed=steady.speed_rad_s + noise[1])

    assert found(PAPER, run) == []
