"""Channels of noise only in short runs, where no balance over windows exists."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.commands.arguments import mapping_of
from identification.checks import check_runs
from identification.checks.balance import signals_of
from identification.checks.dead import NOISE_PROBABILITY, noise_probability
from identification.ingest import Run, read_run
from tests.motors import MOTORS, Motor, campaign, motor_named, run_of

SERVO = motor_named("servo 100 W")
ROWS = 120


def noise(like: np.ndarray, seed: int) -> np.ndarray:
    """White noise of a tenth of a signal's standard deviation."""
    return np.asarray(0.1 * np.std(like) * np.random.default_rng(seed).standard_normal(like.size))


@pytest.mark.parametrize("channel", ["current", "speed"])
def test_noise_instead_of_a_sensor_is_refused_in_a_short_run(channel: str) -> None:
    """120 samples of a servo; one sensor is not connected, the other responds to the voltage."""
    run = campaign(SERVO, seed=4, runs=1, rows=ROWS)[0]
    if channel == "current":
        dead = replace(run, current=noise(run.current, 1))
    else:
        dead = replace(run, speed=noise(run.speed, 1))

    (finding,) = (f for f in check_runs([dead]).findings if f.code == "dead_sensor")

    assert finding.severity == "refuse"
    assert finding.column == {"current": "current_A", "speed": "speed_rad_s"}[channel]
    assert finding.value > finding.limit == NOISE_PROBABILITY


@pytest.mark.parametrize("motor", MOTORS, ids=lambda motor: motor.name)
def test_sensors_that_respond_are_no_noise(motor: Motor) -> None:
    """Short runs of seven decades of inertia, voltages of three kinds, noise of 2 % and 10 %."""
    for kind in ("steps", "binary", "multisine"):
        for level in (0.02, 0.1):
            (run,) = campaign(motor, seed=5, runs=1, rows=ROWS, kind=kind, noise=level)
            codes = {f.code for f in check_runs([run]).findings}
            assert not codes & {"dead_sensor", "unlogged_voltage"}, (kind, level)


def test_noise_is_explained_as_well_as_the_f_distribution_says() -> None:
    """Under the hypothesis, the probability is uniform: 10 % of 400 runs are below 0.1.

    The standard deviation of that share is 1.5 %.
    """
    run = campaign(SERVO, seed=6, runs=1, rows=ROWS)[0]
    found = [
        noise_probability(signals_of(replace(run, current=noise(run.current, seed))), "current")
        for seed in range(400)
    ]
    assert np.mean(np.array(found) < 0.1) == pytest.approx(0.1, abs=0.045)


def spun_up(voltage: np.ndarray) -> Run:
    """The servo from standstill at a voltage, with noise of 1 % of the peaks."""
    run = run_of(SERVO, voltage, np.full(voltage.size, 25.0), np.zeros(2))
    rng = np.random.default_rng(8)
    current, speed = (
        signal + 0.01 * np.max(np.abs(signal)) * rng.standard_normal(signal.size)
        for signal in (run.current, run.speed)
    )
    return replace(run, current=current, speed=speed)


@pytest.mark.parametrize("logged", [0.0, 0.02])
def test_a_voltage_that_was_not_logged_is_suspected(logged: float) -> None:
    """Steps in both directions, logged as a constant with or without noise [V]."""
    run = campaign(SERVO, seed=4, runs=1, rows=3 * ROWS)[0]
    dead = replace(run, voltage=12.0 + logged * np.random.default_rng(2).standard_normal(run.rows))

    (finding,) = check_runs([dead]).findings

    assert (finding.code, finding.severity) == ("unlogged_voltage", "suspect")


@pytest.mark.parametrize("offset", [0.0, 0.02])
def test_a_switched_voltage_logged_as_its_magnitude_is_signed_by_the_direction(
    offset: float,
) -> None:
    """A voltage of alternating sign is constant as a magnitude, but for the zero of its sensor."""
    run = campaign(SERVO, seed=4, runs=1, rows=3 * ROWS, kind="binary")[0]
    run = replace(run, voltage=run.voltage + offset)
    table = run.table().assign(dir=(run.voltage > 0.0).astype(int))
    unsigned = table.assign(voltage_V=table["voltage_V"].abs())

    (finding,) = check_runs([read_run(unsigned, name="run.csv")]).findings

    assert finding.code == "unlogged_voltage"
    assert finding.corrections == ("run.csv:voltage_V=voltage_V * dir in V",)
    mapping = mapping_of(None, finding.corrections)
    restored = read_run(unsigned, name="run.csv", mapping=mapping)
    np.testing.assert_allclose(restored.voltage, run.voltage)
    assert check_runs([restored]).findings == ()


def test_a_run_up_at_a_constant_voltage_is_sound() -> None:
    """A step before the record began: current and speed fit K w = v - R i - L di/dt."""
    supply = np.random.default_rng(3).standard_normal(ROWS)

    for ripple in (0.0, 0.02):
        assert not check_runs([spun_up(12.0 + ripple * supply)]).findings
