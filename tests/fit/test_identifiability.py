"""Identifiability: parameters that the runs do not determine are reported as such."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from identification.errors import InputError
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.identifiability import identified
from identification.fit.solve import Fit
from identification.ingest.run import Run
from tests.motors import NAMES, Motor, campaign, motor_named

SERVO = motor_named("servo 100 W")
WHITE = 1.0


def answered(runs: list[Run]) -> tuple[dict[str, bool], Fit]:
    """Identifiability of each parameter, and the fit."""
    fit = fit_declared(campaign_of(runs, []).training, "zoh")
    return identified(fit, WHITE), fit


def deviation(fit: Fit, name: str) -> float:
    """Standard deviation of a parameter [its unit]."""
    k = NAMES.index(name)
    sd = np.sqrt(fit.equations.covariance()[k, k])
    return float(sd * fit.coordinates.slopes(fit.position)[k])


def at_one_temperature(temperature: float, seed: int) -> list[Run]:
    """Runs of the servo motor, all at the same temperature."""
    ra, alpha_ra, kt, alpha_kt, inertia, friction, inductance = SERVO.values
    heat = temperature - 25.0
    hot_ra, hot_kt = ra * (1 + alpha_ra * heat), kt * (1 + alpha_kt * heat)
    there = (hot_ra, 0.0, hot_kt, 0.0, inertia, friction, inductance)
    runs = campaign(Motor("there", there, SERVO.voltage, SERVO.interval), seed=seed)
    return [replace(run, temperature=np.full(run.rows, temperature)) for run in runs]


def test_a_campaign_over_all_temperatures_identifies_everything() -> None:
    """A span of 90 K, both directions and fast sampling identify all parameters."""
    known, _ = answered(campaign(SERVO, seed=1))

    assert known == dict.fromkeys(NAMES, True)


@pytest.mark.parametrize("temperature", [25.0, 80.0])
def test_one_temperature_does_not_identify_the_temperature_coefficients(temperature: float) -> None:
    """At one temperature, only the product of coefficient and reference value is determined."""
    known, fit = answered(at_one_temperature(temperature, seed=2))

    assert not known["alpha_Ra"]
    assert not known["alpha_Kt"]
    assert known["J"]
    assert known["L"]
    # As wide as the prior from material data.
    assert deviation(fit, "alpha_Ra") == pytest.approx(0.003, rel=0.05)
    assert deviation(fit, "alpha_Kt") == pytest.approx(0.002, rel=0.05)


def test_at_the_reference_temperature_the_reference_values_are_known() -> None:
    """At 25 degC, Ra25 and Kt25 are measured without a temperature coefficient."""
    known, fit = answered(at_one_temperature(25.0, seed=3))

    assert known["Ra25"]
    assert known["Kt25"]
    assert fit.values[0] == pytest.approx(SERVO.values[0], rel=0.01)


@pytest.mark.parametrize("temperature", [21.0, 24.0, 28.0])
def test_a_laboratory_at_one_temperature_determines_the_reference_values(
    temperature: float,
) -> None:
    """4 K from 25 degC, any usual coefficient changes Ra25 and Kt25 by about 1 %."""
    known, fit = answered(at_one_temperature(temperature, seed=2))

    assert known["Ra25"]
    assert known["Kt25"]
    assert not known["alpha_Ra"]
    assert not known["alpha_Kt"]
    assert fit.values[0] == pytest.approx(SERVO.values[0], rel=0.03)


def test_runs_far_from_the_reference_temperature_leave_the_reference_values_unknown() -> None:
    """55 K from 25 degC, the resistance at 25 degC is that of the assumed coefficient."""
    known, _ = answered(at_one_temperature(80.0, seed=2))

    assert not known["Ra25"]
    assert not known["Kt25"]


def test_runs_without_temperature_leave_the_coefficients_unidentified() -> None:
    """The runs count as runs at one unknown temperature, here with 1.2 times the resistance."""
    runs = [replace(run, temperature=None) for run in at_one_temperature(76.3, seed=4)]

    campaign_ = campaign_of(runs, [])
    known, fit = answered(runs)

    assert not known["alpha_Ra"]
    assert not known["alpha_Kt"]
    assert fit.values[0] == pytest.approx(1.2 * SERVO.values[0], rel=0.01)
    assert any("no temperature" in warning.message for warning in campaign_.warnings)


def test_a_hot_run_without_temperature_does_not_tell_how_the_magnet_warms() -> None:
    """A run with more resistance and the same torque constant: how hot it was is unknown."""
    ra, _, kt, _, inertia, friction, inductance = SERVO.values
    runs = []
    for seed, ratio in enumerate((1.0, 1.25)):
        values = (ratio * ra, 0.0, kt, 0.0, inertia, friction, inductance)
        motor = Motor("unlogged", values, SERVO.voltage, SERVO.interval)
        runs += campaign(motor, seed=seed, noise=0.0)[:1]
    runs = [replace(run, temperature=None) for run in runs]

    known, _ = answered(runs)

    assert not known["alpha_Ra"]
    assert not known["alpha_Kt"]
    assert known["J"]


def test_a_motor_that_is_only_warmed_by_a_kelvin_is_at_one_temperature() -> None:
    """A rise of 1 K changes the resistance by 0.4 %, which equals its uncertainty."""
    runs = [
        replace(run, temperature=25.0 + np.linspace(0.0, 1.0, run.rows))
        for run in campaign(replace_slopes(0.0), seed=5, noise=0.03, rows=300)
    ]

    known, _ = answered(runs)

    assert not known["alpha_Ra"]


def replace_slopes(slope: float) -> Motor:
    """Servo motor with both temperature coefficients set to one value."""
    ra, _, kt, _, inertia, friction, inductance = SERVO.values
    values = (ra, slope, kt, slope, inertia, friction, inductance)
    return Motor("flat", values, SERVO.voltage, SERVO.interval)


def test_a_speed_that_never_moves_leaves_the_shaft_unknown() -> None:
    """Without speed, only ratios of inertia, friction and torque constant are determined."""
    runs = [replace(run, speed=np.zeros(run.rows)) for run in campaign(SERVO, seed=6)]

    campaign_ = campaign_of(runs, [])
    known, _ = answered(runs)

    assert not any(known[name] for name in ("J", "b", "Kt25"))
    assert known["Ra25"]
    assert any("speed_rad_s never changes" in warning.message for warning in campaign_.warnings)


def test_a_current_that_never_moves_leaves_the_winding_unknown() -> None:
    """Without current, only the product of Ra and J is determined; the speed determines Kt."""
    runs = [replace(run, current=np.zeros(run.rows)) for run in campaign(SERVO, seed=7)]

    campaign_ = campaign_of(runs, [])
    known, fit = answered(runs)

    assert not any(known[name] for name in ("Ra25", "J", "L"))
    assert known["Kt25"]
    assert fit.values[2] == pytest.approx(SERVO.values[2], rel=0.03)
    assert any("current_A never changes" in warning.message for warning in campaign_.warnings)


@pytest.mark.parametrize("ratio", [30.0, 3000.0])
def test_sampling_far_slower_than_the_winding_leaves_the_inductance_open(ratio: float) -> None:
    """If L/R is much shorter than the interval, every current is in steady state."""
    ra = SERVO.values[0]
    motor = Motor(
        "fast winding",
        (*SERVO.values[:6], ra * SERVO.interval / ratio),
        SERVO.voltage,
        SERVO.interval,
    )

    known, fit = answered(campaign(motor, seed=8, noise=0.05, rows=800))

    assert not known["L"]
    assert known["Ra25"]
    assert known["J"]
    # The interval extends from zero to several times the estimate and contains the true value.
    assert abs(fit.values[6] - motor.values[6]) < 4.0 * deviation(fit, "L")


def test_a_motor_that_never_leaves_one_steady_state_hides_its_inertia() -> None:
    """At constant speed, J and L multiply derivatives that are zero."""
    rng = np.random.default_rng(9)
    ra, _, kt, _, _, friction, _ = SERVO.values
    speed = 12.0 / (kt + ra * friction / kt)
    runs = []
    for k in range(2):
        run = campaign(SERVO, seed=9, runs=1, rows=500)[0]
        runs.append(
            replace(
                run,
                name=f"run{k}.csv",
                voltage=np.full(500, 12.0),
                current=friction * speed / kt + 0.02 * rng.standard_normal(500),
                speed=speed + 0.5 * rng.standard_normal(500),
                temperature=np.full(500, 25.0),
            )
        )

    known, _ = answered(runs)

    assert not known["J"]
    assert not known["L"]


def test_runs_in_which_nothing_is_driven_are_refused() -> None:
    """Without any voltage, the runs contain no excitation."""
    runs = [replace(run, voltage=np.zeros(run.rows)) for run in campaign(SERVO, seed=1, rows=100)]

    with pytest.raises(InputError, match="voltage_V is 0 in every training run"):
        campaign_of(runs, [])


def test_runs_in_which_nothing_responds_are_refused() -> None:
    """Two dead sensors leave no signal to fit."""
    runs = [
        replace(run, current=np.zeros(run.rows), speed=np.full(run.rows, 3.0))
        for run in campaign(SERVO, seed=1, rows=100)
    ]

    with pytest.raises(InputError, match="neither current_A nor speed_rad_s changes"):
        campaign_of(runs, [])


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_loop_that_holds_one_speed_is_fitted_to_its_best_optimum(seed: int) -> None:
    """A second optimum with a resistance and no inductance has nearly the same cost."""
    ra, kt, inertia, friction, inductance = 1.1, 0.115, 1.2e-4, 6e-5, 2.6e-3
    dynamics = np.array([[-ra / inductance, -kt / inductance], [kt / inertia, -friction / inertia]])
    drive = np.array([[1 / inductance], [0.0]])
    step = expm(np.block([[dynamics, drive], [np.zeros((1, 3))]]) * 1e-3)
    rng = np.random.default_rng(seed)
    runs = []
    for k in range(2):
        state = np.array([friction * 150.0 / kt, 150.0])
        total = kt * state[1] + ra * state[0]
        rows = []
        for n in range(3000):
            logged = state + np.array([0.03, 0.4]) * rng.standard_normal(2)
            error = 150.0 - logged[1]
            total += 1e-3 * error
            rows.append((1e-3 * n, 0.03 * error + total, *logged))
            state = (step @ [*state, rows[-1][1]])[:2]
        time, voltage, current, speed = np.array(rows).T
        runs.append(Run(f"run{k}", f"{k}", time, voltage, current, speed))

    fit = fit_declared(campaign_of(runs, []).training, "zoh")

    assert abs(fit.values[0] - ra) < 3.0 * deviation(fit, "Ra25")
    assert fit.values[0] > 0.5 * ra
