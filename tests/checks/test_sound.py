"""Unusual but valid runs are never refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.checks import check_runs
from identification.ingest import Run, read_run

Array = NDArray[np.float64]
DATA = Path(__file__).parents[2] / "data"
LABECA = Path(__file__).parents[3] / "shared" / "real" / "labeca_dc_servo"
R, K, L, J, B, STEP = 1.0, 0.05, 1e-3, 5e-5, 2e-5, 1e-3


def run_of(
    voltage: Array, load: Array | float = 0.0, name: str = "run.csv", speed: Array | None = None
) -> Run:
    """Run of a 12 V motor by Euler steps of 1/20 of the interval, with 0.5 % noise.

    Args:
        voltage: (n_sample,) held [V].
        load: Torque against the motion's positive direction [N m].
        name: File name.
        speed: Speed that a machine on the shaft imposes, where one does [rad/s].
    """
    torque = np.broadcast_to(load, voltage.shape)
    i, w = 0.0, 0.0 if speed is None else float(speed[0])
    current, turned = np.zeros(voltage.size), np.zeros(voltage.size)
    for k in range(voltage.size):
        w = w if speed is None else float(speed[k])
        current[k], turned[k] = i, w
        for _ in range(20):
            i += STEP / 20 / L * (voltage[k] - R * i - K * w)
            w += STEP / 20 / J * (K * i - B * w - torque[k]) if speed is None else 0.0
    rng = np.random.default_rng(3)
    return Run(
        name,
        "0" * 64,
        STEP * np.arange(voltage.size, dtype=np.float64),
        voltage + rng.normal(0.0, 0.01, voltage.size),
        current + rng.normal(0.0, 0.02, voltage.size),
        turned + rng.normal(0.0, 0.5, voltage.size),
    )


def levels(low: float, high: float, rows: int = 2000, hold: int = 100) -> Array:
    """Random levels, each held for some samples."""
    rng = np.random.default_rng(5)
    return np.repeat(rng.uniform(low, high, rows // hold), hold)


SOUND = {
    "both directions": run_of(levels(-12, 12)),
    "one direction": run_of(levels(4, 12)),
    "regenerative braking": run_of(np.repeat([10.0, 3.0, 10.0, 2.0], 500)),
    "a load that drives the motor": run_of(levels(4, 6), load=-0.2),
    "a load that steps": run_of(levels(-12, 12), load=np.repeat([0.0, 0.1, -0.1, 0.0], 500)),
    "driven as a generator": run_of(levels(3, 5), speed=150 + 50 * np.sin(np.arange(2000) / 90)),
    "short-circuited generator": run_of(np.zeros(2000), speed=80 * np.sin(np.arange(2000) / 90)),
    "coasting": run_of(np.concatenate([np.full(1000, 10.0), np.zeros(1000)])),
    "locked rotor": run_of(levels(-3, 3), speed=np.zeros(2000)),
    "one step": run_of(np.concatenate([np.zeros(100), np.full(900, 12.0)])),
    "a slow ramp": run_of(np.linspace(0.0, 12.0, 3000)),
    "very short": run_of(levels(-12, 12, rows=60, hold=10)),
}


@pytest.mark.parametrize("rest", [100, 300, 700])
def test_a_standstill_before_one_step_is_no_stuck_sensor(rest: int) -> None:
    """A commanded voltage has no noise, and an encoder counts nothing at standstill.

    The current sensor alone changes there.
    """
    command = np.concatenate([np.zeros(rest), np.full(1000 - rest, 12.0)])
    run, count = run_of(command), 5.0
    run = replace(run, voltage=command, speed=count * np.round(run.speed / count))
    assert not np.any(run.speed[:rest])
    assert check_runs([run]).refused == ()


def step_of_a_geared_motor(rest: int, volts: float, inertia: float, *, timed: bool) -> Run:
    """0.4 s of a robot's motor that starts from rest, as its controller logs it.

    The current sensor has a filter of 20 ms and steps of 20 mA; 44 counts of the encoder in a turn
    give a speed over four samples, or the time between two of them does.
    """
    command = np.concatenate([np.zeros(rest), np.full(370 - rest, volts)])
    i, w, angle, filtered = 0.0, 0.0, 0.0, 0.0
    current, count, turned = np.zeros(370), np.zeros(370), np.zeros(370)
    for k, value in enumerate(command):
        current[k], count[k] = 0.02 * round(filtered / 0.02), np.floor(angle * 44 / (2.0 * np.pi))
        turned[k] = w
        for _ in range(40):
            i += STEP / 40 / 3e-3 * (value - 4.2 * i - 0.018 * w)
            w = max(w + STEP / 40 / inertia * (0.018 * i - 2e-6 * w - 1.2e-3), 0.0)
            angle += STEP / 40 * w
            filtered += (i - filtered) * STEP / 40 / 20e-3
    speed = (count - np.concatenate([np.zeros(4), count[:-4]])) * 2.0 * np.pi / 44 / (4 * STEP)
    if timed:
        speed = np.where(count > 1, turned, 0.0)
    return Run("step.csv", "0" * 64, STEP * np.arange(370.0), command, current, speed)


@pytest.mark.parametrize(
    ("rest", "volts", "inertia", "timed"),
    [(18, 3.0, 2.5e-6, False), (31, 4.5, 2.5e-6, False), (31, 3.0, 2e-5, True)],
)
def test_a_step_that_a_coarse_encoder_shows_late_is_no_stuck_sensor(
    rest: int, volts: float, inertia: float, timed: bool
) -> None:
    """The first count and the filtered current come some samples after the step of the voltage."""
    run = step_of_a_geared_motor(rest, volts, inertia, timed=timed)
    assert np.count_nonzero(np.cumsum(run.speed) == 0.0) > rest + 1
    assert check_runs([run]).refused == ()


def test_an_encoder_that_misses_the_start_is_still_found() -> None:
    """The speed jumps from zero to that of the shaft, as the encoder is connected."""
    command = np.concatenate([np.zeros(100), np.full(900, 12.0)])
    run = run_of(command)
    speed = np.where(np.arange(1000) < 300, 0.0, run.speed)
    found = check_runs([replace(run, speed=speed)]).refused
    assert [(f.code, f.column) for f in found] == [("stuck_sensor", "speed_rad_s")]


def test_a_speed_that_stays_zero_while_the_motor_turns_is_still_found() -> None:
    """The encoder fails for 300 samples of a run without standstill."""
    run = SOUND["one direction"]
    speed = run.speed.copy()
    speed[500:800] = 0.0
    found = check_runs([replace(run, speed=speed)]).refused
    assert [(f.code, f.column) for f in found] == [("stuck_sensor", "speed_rad_s")]


@pytest.mark.parametrize("name", SOUND)
def test_an_unusual_run_that_obeys_physics_is_not_refused(name: str) -> None:
    """Simulated motors obey v = R i + K w + L di/dt by construction, whatever drives the shaft."""
    assert check_runs([SOUND[name]]).refused == ()


def test_unusual_runs_of_one_motor_do_not_contradict_each_other() -> None:
    """All runs are simulated with one motor, so no two of them contradict each other."""
    assert check_runs(list(SOUND.values())).refused == ()


@pytest.mark.parametrize("campaign", ["paper_motor", "clean_servo", "brush_drop_servo"])
def test_the_campaigns_of_the_project_are_sound(campaign: str) -> None:
    """The published campaigns are simulated and contain no fault."""
    runs = [read_run(path) for path in sorted((DATA / campaign).glob("*.csv"))]

    assert check_runs(runs).findings == ()


def test_a_real_servo_is_sound() -> None:
    """Measured runs; the current sensor gains of the two files differ by a factor of about two."""
    if not LABECA.is_dir():
        pytest.skip("the measured runs are not on this machine")
    mapping = {"current_A": {"column": "current_sensor_V", "scale": 1.0}}
    runs = [read_run(path, mapping=mapping) for path in sorted(LABECA.glob("*.csv"))]

    assert check_runs(runs).refused == ()
