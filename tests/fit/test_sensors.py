"""Sensor noise without a model: its upper bound, and steps larger than the noise."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.noise import noise_deviation
from identification.fit.sensors import bounded_noise, coarse_warnings, noise_ceiling
from identification.ingest import read_run
from identification.ingest.run import Run
from identification.model.excitation import Record
from tests.motors import Array, campaign, motor_named

SERVO = motor_named("servo 100 W")
DATA = Path(__file__).parents[2] / "data" / "brush_drop_servo"
TRUTH = json.loads((DATA / "truth.json").read_text(encoding="utf-8"))["noise"]
NOISE = np.array([TRUTH["current_A"], TRUTH["speed_rad_s"]])


def warned(runs: list[Run]) -> tuple[str, ...]:
    """Warnings for runs with the noise of their fit."""
    fit = fit_declared(campaign_of(runs, []).training, "zoh")
    return tuple(map(str, coarse_warnings(runs, noise_deviation(fit))))


def bench_runs(noise: float = 0.01) -> list[Run]:
    """Runs of the servo motor: currents to 40 A, speeds to 300 rad/s, noise of 1 % of both."""
    return campaign(SERVO, seed=12, rows=1000, noise=noise)


def stepped(run: Run, current: float = 0.0, speed: float = 0.0) -> Run:
    """Run with channels rounded to steps [A, rad/s]; 0 leaves a channel unchanged."""
    return replace(
        run,
        current=np.round(run.current / current) * current if current else run.current,
        speed=np.round(run.speed / speed) * speed if speed else run.speed,
    )


def noise_of(runs: list[Run]) -> Array:
    """(2,) noise of the runs [A, rad/s]."""
    return noise_deviation(fit_declared(campaign_of(runs, []).training, "zoh"))


def test_steps_of_eight_times_the_noise_are_reported() -> None:
    """The warnings name the two coarse runs, both channels and their steps."""
    first, *rest = bench_runs()
    current, speed = (float(f"{8.0 * size:.2g}") for size in noise_of([first, *rest]))

    told = warned([first, *(stepped(run, current, speed) for run in rest)])

    assert len(told) == 2
    assert told[0].startswith(f"run1.csv, run2.csv, current_A: logged in steps of {current:.3g} A")
    assert told[1].startswith(f"run1.csv, run2.csv, speed_rad_s: logged in steps of {speed:.3g} ra")
    assert all("intervals are too narrow" in words for words in told)


def test_steps_no_larger_than_the_noise_give_no_warning() -> None:
    """Quantisation theory: noise of half a step or more makes rounding errors independent."""
    runs = bench_runs()
    current, speed = noise_of(runs)

    assert warned([stepped(run, current, speed) for run in runs]) == ()


def test_runs_with_full_precision_have_no_steps() -> None:
    """Normal noise with sixteen digits."""
    assert warned(bench_runs()) == ()


def test_fine_digits_without_noise_are_not_coarse() -> None:
    """In a simulated run of six digits, the signal changes by many steps per sample."""
    assert warned([stepped(run, 1e-4, 1e-4) for run in bench_runs(noise=1e-9)]) == ()


@pytest.fixture(scope="module")
def records() -> tuple[Record, ...]:
    """Training records of a campaign with a hidden brush drop."""
    runs = [read_run(path) for path in sorted(DATA.glob("training_*.csv"))]
    return campaign_of(runs, []).training


def test_a_model_that_explains_nothing_does_not_pass_for_noise(
    records: tuple[Record, ...],
) -> None:
    """With the wrong sign in all runs the best model is i = 0, whose residual is the signal."""
    size = np.std(np.concatenate([record.measured for record in records]), axis=0)

    noise = bounded_noise(records, size, error=size)

    assert np.all(size > 10.0 * noise)


def test_the_ceiling_is_above_the_noise_whatever_is_hidden(records: tuple[Record, ...]) -> None:
    """A brush drop is no noise, and the noise that there is may not be denied."""
    assert np.all(noise_ceiling(records) > NOISE)


def test_the_ceiling_is_not_asked_where_the_model_explains_the_runs(
    records: tuple[Record, ...],
) -> None:
    """Under a speed loop the voltage explains the noise of the sensor, and no bound is sound."""
    large = np.array([1.0, 20.0])

    np.testing.assert_array_equal(bounded_noise(records, large, error=large), large)
