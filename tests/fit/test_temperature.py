"""Runs without a thermometer: one temperature each, estimated from the resistance."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from identification import FitOptions, Identification, identify
from identification.fit.temperature import with_own_temperatures
from identification.ingest.run import Run
from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.prediction import predict
from tests.motors import NAMES, drive, motor_named, run_of

SERVO = motor_named("servo 100 W")
FAST = FitOptions(posterior=False)
NOISE = np.array([0.05, 0.5])
"""Noise of current and speed [A, rad/s]."""


def at(temperature: float, seed: int, *, is_logged: bool, warming: float = 0.0) -> Run:
    """Run of the servo motor around a temperature."""
    rng = np.random.default_rng(seed)
    rows = 1200
    true = temperature + warming * np.linspace(-0.5, 0.5, rows)
    voltage = drive(SERVO, "steps", rows, rng)
    clean = run_of(SERVO, voltage, true, np.zeros(2), name=f"run{seed}.csv")
    current, speed = (rng.normal(0.0, size, rows) for size in NOISE)
    return replace(
        clean,
        sha256=f"{seed:064d}",
        current=clean.current + current,
        speed=clean.speed + speed,
        temperature=true + rng.normal(0.0, 0.1, rows) if is_logged else None,
    )


def ratios(found: Identification) -> list[float]:
    """Ratios of final simulation error to noise, for all channels and runs."""
    after: Any = found.result["errors"]
    return [entry["noise_ratio"] for role in after["after"].values() for entry in role.values()]


def estimates(found: Identification) -> dict[str, float]:
    """Medians of the parameters."""
    entries: Any = found.result["parameters"]
    return {name: entries[name]["median"] for name in NAMES}


@pytest.fixture(scope="module")
def never_logged() -> Identification:
    """Identification from runs at four temperatures, none logged, each warming by 4 K."""
    runs = [
        at(temperature, seed, is_logged=False, warming=4.0)
        for seed, temperature in enumerate((30.0, 60.0, 90.0, 50.0))
    ]
    return identify(runs[:3], runs[3:], FAST)


def test_temperatures_that_were_never_logged_cause_no_effect(
    never_logged: Identification,
) -> None:
    """Only the temperature differs between and within the runs."""
    assert never_logged.result["effects"] == []
    assert ratios(never_logged) == pytest.approx([1.0] * 4, abs=0.1)


def test_its_parameters_are_those_at_the_temperature_of_the_first_run(
    never_logged: Identification,
) -> None:
    """Ra(30) and Kt(30) by equations 11 and 12; the others do not depend on temperature.

    Only the ratio of the two coefficients is determined, so alpha_Ra is as uncertain as its prior.
    """
    entries: Any = never_logged.result["parameters"]
    found, true = estimates(never_logged), dict(zip(NAMES, SERVO.values, strict=True))

    assert found["Ra25"] == pytest.approx(true["Ra25"] * (1 + 5 * true["alpha_Ra"]), rel=3e-3)
    assert found["Kt25"] == pytest.approx(true["Kt25"] * (1 + 5 * true["alpha_Kt"]), rel=3e-3)
    for name in ("J", "b", "L"):
        assert found[name] == pytest.approx(true[name], rel=0.02)
    assert not entries["alpha_Ra"]["identified"]
    assert not entries["alpha_Kt"]["identified"]
    assert entries["alpha_Ra"]["sd"] == pytest.approx(0.003, rel=0.1)
    assert entries["alpha_Kt"]["sd"] > 5e-4


def test_a_warning_gives_the_estimated_temperatures_of_the_runs(
    never_logged: Identification,
) -> None:
    """The prior coefficient is 0.0035 1/K; the motor has 0.0039 1/K and starts at 30 degC."""
    warnings: Any = never_logged.result["warnings"]
    (told,) = [text for text in warnings if "was not logged" in text]
    assert not any("no temperature column" in text for text in warnings)

    rise = 0.0039 / (1 + 0.0039 * 5) / 0.0035
    for name, warmer in (("run1.csv", 30.0), ("run2.csv", 60.0), ("run3.csv", 20.0)):
        value = float(told.split(f"{name} (")[1].split(" degC")[0])
        assert value == pytest.approx(25.0 + rise * warmer, abs=1.5)
    assert "run0.csv, which is assumed to be at 25 degC" in told


def test_a_run_that_was_not_logged_is_predicted_at_the_temperature_it_had(
    never_logged: Identification,
) -> None:
    """At 120 degC, the response differs from that of the first run by tens of noise deviations."""
    run = at(120.0, 9, is_logged=False)

    prediction = predict(json.loads(json.dumps(never_logged.result)), run)

    errors = [run.current - prediction["current_A"], run.speed - prediction["speed_rad_s"]]
    assert np.std(errors, axis=1) / NOISE == pytest.approx([1.0, 1.0], abs=0.1)


def test_one_run_without_temperature_among_others_has_no_disadvantage() -> None:
    """Two runs determine the coefficients, which determine the temperature of the third."""
    runs = [
        at(temperature, seed, is_logged=seed != 1)
        for seed, temperature in enumerate((30.0, 60.0, 90.0))
    ]

    found = identify(runs, [at(50.0, 3, is_logged=True)], FAST)

    entries: Any = found.result["parameters"]
    assert found.result["effects"] == []
    assert ratios(found) == pytest.approx([1.0] * 4, abs=0.1)
    for name, true in zip(NAMES, SERVO.values, strict=True):
        assert entries[name]["identified"]
        assert abs(entries[name]["mean"] - true) < 4 * entries[name]["sd"]


def test_a_validation_run_may_lack_its_temperature() -> None:
    """The run is simulated at its best temperature, down to the noise level."""
    runs = [at(temperature, seed, is_logged=True) for seed, temperature in enumerate((30.0, 90.0))]

    found = identify(runs, [at(60.0, 3, is_logged=False)], FAST)

    assert found.result["effects"] == []
    assert ratios(found) == pytest.approx([1.0] * 4, abs=0.1)
    warnings: Any = found.result["warnings"]
    (told,) = [text for text in warnings if "was not logged" in text]
    assert float(told.split("run3.csv (")[1].split(" degC")[0]) == pytest.approx(60.0, abs=1.0)


def test_a_winding_hotter_than_its_insulation_permits_is_implausible() -> None:
    """At 190 degC, other leads or another sensor are the likely cause."""
    runs = [at(temperature, seed, is_logged=True) for seed, temperature in enumerate((30.0, 90.0))]

    found = identify(runs, [at(190.0, 3, is_logged=False)], FAST)

    warnings: Any = found.result["warnings"]
    assert any(text.startswith("implausible winding temperature in run3.csv") for text in warnings)
    (told,) = [text for text in warnings if "was not logged" in text]
    assert float(told.split("run3.csv (")[1].split(" degC")[0]) <= 155.0


def test_a_run_whose_simulation_diverges_at_every_temperature_keeps_the_expected_one() -> None:
    """With a negative moment of inertia no temperature is better than another."""
    records = records_of([at(60.0, 3, is_logged=False)])
    values = np.array(SERVO.values)
    values[NAMES.index("J")] *= -0.01

    (record,) = with_own_temperatures(MotorModel(), values, records, NOISE)

    assert np.ptp(record.column("temperature")) == 0.0
    assert record.column("temperature")[0] == 25.0
