"""Localisation of a deficiency in one of the two balances: clean motors, effects, traces."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal
from scipy.linalg import expm

from identification.diagnosis.localise import Localisation, localise
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.model.excitation import records_of
from tests.motors import Motor, motor_named, noiseless

Array = NDArray[np.float64]

SERVO = motor_named("servo 100 W")
SIZE = np.array([0.1, 1.5])


def noise_of(kind: str, rows: int, rng: np.random.Generator) -> Array:
    """White, coloured (pole 0.9) or spiky noise (rows, 2) with standard deviation 1."""
    white = rng.standard_normal((rows, 2))
    if kind == "coloured":
        filtered = signal.lfilter([np.sqrt(1 - 0.81)], [1.0, -0.9], white, axis=0)
        return np.asarray(filtered, dtype=np.float64)
    if kind == "spiky":
        return np.asarray(rng.standard_t(3.0, (rows, 2)) / np.sqrt(3.0), dtype=np.float64)
    return white


def noisy(runs: list[Run], kind: str, seed: int, louder: float = 1.0) -> list[Run]:
    """Runs with added noise of `SIZE`, times a factor."""
    rng = np.random.default_rng(seed)
    made = []
    for run in runs:
        noise = louder * SIZE * noise_of(kind, run.rows, rng)
        made.append(
            dataclasses.replace(
                run, current=run.current + noise[:, 0], speed=run.speed + noise[:, 1]
            )
        )
    return made


def localised(runs: list[Run]) -> Localisation:
    """Fit the nominal model and localise its deficiency."""
    return localise(fit_declared(records_of(runs), "zoh"))


def pushed(motor: Motor, runs: list[Run], missing: Array) -> list[Run]:
    """Runs of a motor at constant temperature with an additional voltage or torque.

    The response to a disturbance (n_sample, 2) [V, N m], held over the intervals, is added by the
    recursion of the two balances, which the matrix exponential makes exact.
    """
    ra, _, kt, _, inertia, friction, inductance = motor.values
    rates = np.zeros((4, 4))
    rates[0] = np.array([-ra, -kt, 1.0, 0.0]) / inductance
    rates[1] = np.array([kt, -friction, 0.0, 1.0]) / inertia
    step = expm(rates * motor.interval)[:2]
    made = []
    for run in runs:
        state, path = np.zeros(2), np.zeros((run.rows, 2))
        for row in range(run.rows):
            path[row] = state
            state = step @ np.concatenate([state, missing[row]])
        made.append(
            dataclasses.replace(run, current=run.current + path[:, 0], speed=run.speed + path[:, 1])
        )
    return made


def cold(seed: int, rows: int = 700) -> list[Run]:
    """Runs of a motor whose temperature coefficients are zero, so that it is time-invariant."""
    ra, _, kt, _, inertia, friction, inductance = SERVO.values
    motor = dataclasses.replace(SERVO, values=(ra, 0.0, kt, 0.0, inertia, friction, inductance))
    return noiseless(motor, seed=seed, rows=rows)


@pytest.mark.parametrize("kind", ["white", "coloured", "spiky"])
def test_a_complete_model_is_not_deficient(kind: str) -> None:
    """At level 1 %, more than one false alarm in four campaigns has a probability of 1e-3."""
    alarms, floors = 0, []
    for seed in range(4):
        found = localised(noisy(noiseless(SERVO, seed=seed, rows=500), kind, 50 + seed))
        alarms += found.electrical.significant or found.mechanical.significant
        floors.append(found.noise / SIZE)

    assert alarms <= 1
    # The true noise is known; coloured noise has 79 independent samples per campaign.
    np.testing.assert_allclose(np.mean(floors, axis=0), 1.0, atol=0.15)


@pytest.mark.parametrize(
    ("which", "size"), [(0, 0.5), (1, 0.02)], ids=["missing voltage", "missing torque"]
)
def test_a_gauss_markov_disturbance_is_found_and_traced(which: int, size: float) -> None:
    """Balance, intensity, correlation time and trace of a known disturbance are recovered."""
    rng = np.random.default_rng(7)
    keep = np.exp(-1.0 / 30.0)
    drive = size * np.sqrt(1 - keep**2) * rng.standard_normal(700)
    missing = np.zeros((700, 2))
    missing[:, which] = signal.lfilter([1.0], [1.0, -keep], drive)

    found = localised(noisy(pushed(SERVO, cold(3), missing), "white", 8))

    hit, other = found.electrical, found.mechanical
    if which == 1:
        hit, other = other, hit
    assert hit.significant
    assert not other.significant
    # 70 correlation times determine the intensity to 1/3 and the correlation time to 1/2.
    assert hit.strength == pytest.approx(size, rel=0.4)
    assert 0.010 < hit.time_constant < 0.090
    trace = found.missing[0]
    mean, spread = ((trace.voltage, trace.voltage_sd), (trace.torque, trace.torque_sd))[which]
    error = (mean - missing[:, which]) / spread
    assert np.corrcoef(mean, missing[:, which])[0, 1] > 0.9
    assert 0.85 < np.mean(np.abs(error) < 1.96) <= 1.0
    np.testing.assert_allclose(found.noise, SIZE, rtol=0.1)


def test_a_disturbance_of_zero_changes_no_run() -> None:
    """Negative control: `pushed` with a zero disturbance leaves the run unchanged."""
    runs = cold(3, rows=50)

    changed = pushed(SERVO, runs, np.zeros((50, 2)))

    np.testing.assert_array_equal(changed[0].speed, runs[0].speed)


def test_dry_friction_is_mechanical_although_parameters_absorb_most_of_it() -> None:
    """Only the mechanical balance is deficient, although b absorbs most of the friction."""
    runs = cold(4)
    friction = 0.03
    made = []
    for run in runs:
        missing = np.zeros((run.rows, 2))
        missing[:, 1] = -friction * np.sign(run.speed)
        made += pushed(SERVO, [run], missing)

    found = localised(noisy(made, "white", 9))

    assert found.mechanical.significant
    assert not found.electrical.significant
    assert found.mechanical.gain > 20.0 > found.electrical.gain


def test_sampling_far_slower_than_the_inductance_is_stable() -> None:
    """With L/R a hundredth of the interval, all numbers are finite and no deficiency is found."""
    inductance = 0.01 * SERVO.values[0] * SERVO.interval
    motor = dataclasses.replace(SERVO, values=(*SERVO.values[:6], inductance))

    found = localised(noisy(noiseless(motor, seed=5, rows=500), "white", 10))

    assert not found.electrical.significant
    assert not found.mechanical.significant
    for trace in found.missing:
        assert np.all(np.isfinite(trace.voltage_sd))
        assert np.all(trace.torque_sd > 0.0)
    np.testing.assert_allclose(found.noise, SIZE, rtol=0.1)


def test_there_is_a_trace_of_every_row_of_every_record() -> None:
    """Three runs of 500 rows, the second with a gap after row 200."""
    runs = noisy(noiseless(SERVO, seed=6, rows=500), "white", 11)
    runs[1] = dataclasses.replace(runs[1], segments=((0, 200), (210, 500)))

    found = localised(runs)

    places = [(trace.run, trace.start) for trace in found.missing]
    assert places == [(0, 0), (1, 0), (1, 210), (2, 0)]
    assert [trace.torque.size for trace in found.missing] == [500, 200, 290, 500]
    assert [trace.time.size for trace in found.missing] == [500, 200, 290, 500]
