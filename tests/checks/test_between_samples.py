"""Samples that are too far apart to show which voltage acted, and slow samples that are not."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from identification import FitOptions, identify
from identification.checks.campaign import check_runs
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction
from identification.ingest.run import Run
from identification.selection.confounded import unresolved_transients
from identification.selection.omitted import consider_variances
from tests.motors import simulated

Array = NDArray[np.float64]
Course = Literal["held", "steps at any time", "fast binary", "sines"]

MOTOR = np.array([1.0, 0.0039, 0.05, -0.001, 5e-5, 1e-5, 5e-4])
"""Time constants of 0.5 ms and 20 ms."""
SETTLING = 0.02
PARTS = 100
"""Simulated intervals for each sample."""
ROWS = 600


def _run(course: Course, interval: float, seed: int, temperature: float = 25.0) -> Run:
    """A run sampled at instants; closed form of the balances between them.

    Args:
        course: Voltage over time.
        interval: Sample interval [s].
        seed: Seed of voltage and noise.
        temperature: Temperature [degC].
    """
    rng = np.random.default_rng(seed)
    fine = interval / PARTS
    time = fine * np.arange(ROWS * PARTS, dtype=np.float64)
    if course == "held":
        levels = np.repeat(rng.uniform(-20.0, 20.0, ROWS), rng.integers(1, 6, ROWS))[:ROWS]
        voltage = np.repeat(levels, PARTS)
    elif course == "steps at any time":
        lasting = rng.integers(3 * PARTS, 20 * PARTS, ROWS)
        voltage = np.repeat(rng.uniform(-20.0, 20.0, ROWS), lasting)[: time.size]
    elif course == "fast binary":
        voltage = 15.0 * np.repeat(rng.choice([-1.0, 1.0], 5 * ROWS), PARTS // 5)
    else:
        waves = np.linspace(0.05, 2.0, 15) / interval
        phases = rng.uniform(0.0, 2.0 * np.pi, waves.size)
        voltage = sum(
            4.0 * np.sin(2.0 * np.pi * f * time + p) for f, p in zip(waves, phases, strict=True)
        )
    body = np.full(time.size, temperature)
    exact = simulated(MOTOR, fine, np.asarray(voltage), body, np.zeros(2))
    noise = 0.005 * exact.std(axis=0) * rng.standard_normal((ROWS, 2))
    current, speed = (exact[::PARTS] + noise).T
    name = f"{course.replace(' ', '_')}_{temperature:.0f}"
    hashed = f"{abs(hash((course, seed))):064d}"
    return Run(
        f"{name}.csv", hashed, time[::PARTS].copy(), np.asarray(voltage)[::PARTS].copy(), current,
        speed, body[::PARTS].copy(),
    )  # fmt: skip


def _codes(run: Run) -> set[str]:
    return {finding.code for finding in check_runs([run]).refused}


@pytest.mark.parametrize("course", ["steps at any time", "fast binary", "sines"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_voltage_that_changes_between_far_samples_is_refused(course: Course, seed: int) -> None:
    """Five mechanical time constants between samples, and a voltage that is not held over them."""
    assert _codes(_run(course, 5.0 * SETTLING, seed)) == {"voltage_between_samples"}


@pytest.mark.parametrize("factor", [0.1, 1.0, 2.0, 5.0])
def test_a_voltage_that_is_held_between_samples_passes_at_any_interval(factor: float) -> None:
    """With a voltage that changes at the samples only, the log shows what acted."""
    for seed in range(3):
        assert not _codes(_run("held", factor * SETTLING, seed))


@pytest.mark.parametrize("course", ["steps at any time", "fast binary", "sines"])
def test_near_samples_pass(course: Course) -> None:
    """A tenth of the mechanical time constant between samples shows when the voltage changed."""
    assert "voltage_between_samples" not in _codes(_run(course, 0.1 * SETTLING, 1))


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_motor_that_runs_steadily_passes(noise: float) -> None:
    """The noise of its sensors follows no voltage, and a constant voltage does not change."""
    rng = np.random.default_rng(4)
    sizes = ((12.0, noise), (2.0, 0.05), (200.0, 0.1))
    voltage, current, speed = (rng.normal(mean, sd, ROWS) for mean, sd in sizes)
    run = Run("run.csv", "", 1e-3 * np.arange(ROWS, dtype=np.float64), voltage, current, speed)

    assert check_runs([run]).refused == ()


def test_the_refusal_says_what_to_record() -> None:
    """The message has the interval, the sign of the fault and the remedy."""
    (finding,) = check_runs([_run("steps at any time", 5.0 * SETTLING, 1)]).refused

    assert "100 ms apart" in finding.message
    assert "rad_s follows the voltage of the same sample" in finding.message
    assert "several samples in the mechanical time constant" in finding.remedy


@pytest.mark.parametrize("seed", range(3))
def test_slow_samples_of_a_held_voltage_determine_the_motor(seed: int) -> None:
    """The intervals of the resistance and the inertia hold the true values.

    The best start has a resistance that is many times too high; the least inductance that is
    searched must not stay that of the start.
    """
    runs = [
        _run("held", 5.0 * SETTLING, 10 * seed + k, t) for k, t in enumerate((25.0, 45.0, 65.0))
    ]

    fit = fit_declared(campaign_of(runs, ()).training, "zoh")

    fraction = effective_fraction(fit)
    added = consider_variances(fit, unresolved_transients(fit, fraction))
    spread = np.sqrt(np.diag(fit.equations.covariance(fraction)) + added)
    missed = (fit.values - MOTOR) / (spread * fit.coordinates.slopes(fit.position))
    assert np.abs(missed).max() < 3.3
    assert spread[0] < 1.0 / 3.0


def test_resolved_transients_need_no_other_optimum() -> None:
    """With samples in the mechanical time constant the covariance stands for itself."""
    fit = fit_declared(campaign_of([_run("held", 0.5 * SETTLING, 1)], ()).training, "zoh")

    assert unresolved_transients(fit, 1.0) == ()


def test_no_parameter_is_identified_if_forced_runs_explain_nothing() -> None:
    """White residuals of the size of the signals are no sensor noise."""
    runs = [_run("fast binary", 5.0 * SETTLING, k, 25.0 + 20.0 * k) for k in range(3)]
    options = FitOptions(posterior=False, effects=False, force=True)

    result = identify(runs, (), options).result

    assert not any(entry["identified"] for entry in result["parameters"].values())
    assert {"unexplained_channel"} <= {one["code"] for one in result["warning_details"]}
