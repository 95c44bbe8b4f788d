"""Difficult campaigns: little data, one run, effects near the detection limit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bench import EffectRequest, make_campaign
from benchmarks.coverage import run_of
from identification import FitOptions, InputError, identify
from identification.effects.load import LoadStep
from identification.ingest.run import Run
from tests.motors import campaign, motor_named

FAST = FitOptions(posterior=False)


def _runs(
    effects: list[EffectRequest], seed: int = 31, **options: Any
) -> tuple[list[Run], list[Run]]:
    measured = make_campaign("servo_150w", effects, seed=seed, **options)
    return (
        [run_of(run, f"t{k}.csv") for k, run in enumerate(measured.training)],
        [run_of(run, f"v{k}.csv") for k, run in enumerate(measured.validation)],
    )


def _names(result: dict[str, Any]) -> list[str]:
    return [effect["name"] for effect in result["effects"]]


def test_an_effect_of_the_validation_runs_alone_is_reported_and_not_added() -> None:
    """The bench adds friction to the validation runs only."""
    hidden = [EffectRequest("coulomb_friction", 0.05, role="validation")]
    training, validation = _runs(hidden, rows=800, training=2, validation=1)

    result: Any = identify(training, validation, FAST).result

    assert _names(result) == []
    assert any("validation runs" in warning for warning in result["warnings"])
    assert result["diagnosis"]["remaining"]["missing"]


def test_one_short_run_is_enough_for_a_large_friction() -> None:
    """Eighty samples without validation: significance and size decide."""
    training, _ = _runs([EffectRequest("coulomb_friction", 0.08)], rows=80, training=1)

    result: Any = identify(training, [], FAST).result

    assert _names(result) == ["coulomb_friction"]
    assert result["errors"]["after"]["validation"] is None


def test_a_load_in_one_run_is_found_in_that_run() -> None:
    """The bench loads one training run for a while; the truth contains its number."""
    hidden = [EffectRequest("load_step", 0.15)]
    measured = make_campaign("servo_150w", hidden, seed=31, rows=800, training=4, validation=1)
    training = [run_of(run, f"t{k}.csv") for k, run in enumerate(measured.training)]
    validation = [run_of(run, f"v{k}.csv") for k, run in enumerate(measured.validation)]

    result: Any = identify(training, validation, FAST).result

    assert _names(result) == ["load_step"]
    hidden_in = measured.truth["effects"][0]["values"]["run"]
    assert result["effects"][0]["settings"]["run"] == hidden_in


def test_a_motor_that_is_not_driven_is_refused() -> None:
    """The voltage is zero in all runs; the error names the column."""
    training, _ = _runs([], rows=300, training=2, validation=1)
    still = [
        Run(run.name, run.sha256, run.time, 0.0 * run.voltage, run.current, run.speed)
        for run in training
    ]

    with pytest.raises(InputError, match="voltage_V is 0 in every training run"):
        identify(still, [], FAST)


def test_a_result_with_effects_is_plain_numbers() -> None:
    """All numbers are finite; `b` of the nominal model had absorbed the friction."""
    training, validation = _runs(
        [EffectRequest("coulomb_friction", 0.05)], rows=800, training=3, validation=1
    )

    result: Any = identify(training, validation, FAST).result

    shift = result["diagnosis"]["shifts"]["b"]
    assert shift["before"]["median"] > shift["after"]["median"]
    assert shift["off"]
    assert len(result["feedback_before"]) == len(result["feedback"])
    assert all(np.isfinite(entry["step_rad_s"]) for entry in result["feedback_nonlinear"])


def test_a_run_with_a_sensor_off_is_named_and_is_no_noise() -> None:
    """Offset of ten times the noise in one of four runs: five times the noise as RMS.

    The noise estimate must stay that of the sensors.
    """
    runs = campaign(motor_named("servo 100 W"), seed=6, noise=0.005, runs=5, rows=800)
    clean: Any = identify(runs[:4], runs[4:], FAST).result
    noise = clean["noise"]["current_A"]
    runs[2] = replace(runs[2], current=runs[2].current + 10 * noise)

    result: Any = identify(runs[:4], runs[4:], FAST).result

    assert result["noise"]["current_A"] == pytest.approx(noise, rel=0.2)
    (found,) = result["effects"]
    assert (found["name"], found["variant"]) == ("current_offset", "separate value for each run")
    assert found["settings"]["size"] == pytest.approx(5 * noise, rel=0.1)
    after = result["errors"]["after"]
    for role in ("training", "validation"):
        assert after[role]["current"]["noise_ratio"] == pytest.approx(1.0, abs=0.1)
    assert not any("other runs" in warning for warning in clean["warnings"])


def test_a_zero_error_that_is_small_in_the_validation_run_is_found() -> None:
    """The zero of the current drifts from run to run; the last run is noisier and nearly free."""
    runs = campaign(motor_named("servo 100 W"), seed=6, noise=0.005, runs=5, rows=800)
    noise = 0.005 * max(np.abs(run.current).max() for run in runs)
    runs = [
        replace(run, current=run.current + size * noise)
        for run, size in zip(runs, (3.0, -2.0, 4.0, 1.0, 0.6), strict=True)
    ]
    scatter = np.random.default_rng(6).normal(0.0, 1.5 * noise, runs[4].rows)
    runs[4] = replace(runs[4], current=runs[4].current + scatter)

    result: Any = identify(runs[:4], runs[4:], FAST).result

    (found,) = result["effects"]
    assert (found["name"], found["variant"]) == ("current_offset", "separate value for each run")


def test_a_stuck_thermometer_leaves_no_effect_that_validation_refuses() -> None:
    """Fitted with `force`: thermal effects are surrogates, but only if they predict."""
    runs = campaign(motor_named("servo 100 W"), seed=9, noise=0.01, runs=3, rows=300)
    hottest = max(range(2), key=lambda k: float(np.mean(temperature_of(runs[k]))))
    runs[hottest] = replace(runs[hottest], temperature=np.full(runs[hottest].rows, 25.0))

    result: Any = identify(runs[:2], runs[2:], replace(FAST, force=True)).result

    assert result["effects"]
    for effect in result["effects"]:
        assert effect["evidence"]["error_fall_validation"] > 0.0, effect["name"]


def test_a_load_of_a_few_samples_is_none() -> None:
    """A lost sample resembles a short load; a real one lasts for a twentieth of a second."""
    term = LoadStep(0, 1.0, 2e-3, 1.0)

    assert "ten samples" in term.flaw({"torque": 2.0, "start": 0.3, "stop": 0.3016})
    assert not term.flaw({"torque": 0.1, "start": 0.3, "stop": 0.35})


def temperature_of(run: Run) -> Any:
    """Logged temperature [degC]."""
    assert run.temperature is not None
    return run.temperature
