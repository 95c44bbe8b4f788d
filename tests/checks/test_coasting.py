"""Bridges that are switched off where the log has no voltage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from identification.checks import check_runs
from identification.checks.campaign import admitted
from identification.checks.coasting import coasting_of, coastings_of
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.model.excitation import records_of
from identification.options import FitOptions
from identification.preview import check
from tests.checks.test_limited import KT, NOISE, RA, STEP, B, J, L, deviations

ROWS, BLOCK = 3000, 60


def duty_run(
    seed: int, *, coasts: bool, noise: float = 1.0, drop: float = 0.0, before: float = 1.0
) -> Run:
    """Steps of a duty between pauses, in which the bridge is off or shorts the motor.

    Off, no current flows and the friction alone slows the motor.  The brushes lose `drop` volts.
    The steps before the pauses are smaller by the factor `before`.
    """
    rng = np.random.default_rng(seed)
    sizes = np.array([1.0, before, 0.0])[np.arange(ROWS // BLOCK) % 3]
    levels = sizes * rng.uniform(-24.0, 24.0, 50)
    command = np.repeat(levels, BLOCK)
    matrix = np.array([[-RA / L, -KT / L, 1.0 / L], [KT / J, -B / J, 0.0], [0.0, 0.0, 0.0]])
    fine = 20 if drop else 1
    change, decay = expm(matrix * STEP / fine)[:2], np.exp(-B / J * STEP)
    states = np.zeros((ROWS, 2))
    for k in range(ROWS - 1):
        state = states[k]
        if coasts and command[k] == 0.0:
            states[k + 1] = 0.0, state[1] * decay
            continue
        for _ in range(fine):
            # Near zero current, the brushes take any voltage below the drop.
            lost = drop * np.clip(state[0] / 0.05, -1.0, 1.0)
            state = change @ [*state, command[k] - lost]
        states[k + 1] = state
    if coasts:
        states[command == 0.0, 0] = 0.0
    logged = states + noise * NOISE * rng.normal(size=states.shape)
    time: NDArray[np.float64] = STEP * np.arange(ROWS, dtype=np.float64)
    warmth = np.full(ROWS, 25.0)
    return Run(f"r{seed}.csv", str(seed), time, command, logged[:, 0], logged[:, 1], warmth)


@pytest.mark.parametrize("noise", [0.05, 1.0, 3.0])
@pytest.mark.parametrize("seed", range(3))
def test_samples_of_a_coasting_motor_are_omitted(seed: int, noise: float) -> None:
    """The bridge is off in each third block; nearly all of its turning samples are found."""
    run = duty_run(seed, coasts=True, noise=noise)
    off = (run.voltage == 0.0) & (np.abs(run.speed) > 0.1 * np.abs(run.speed).max())
    verdict = check_runs([run])
    simulated = np.zeros(run.rows, dtype=bool)
    for start, stop in verdict.runs[0].segments:
        simulated[start:stop] = True

    assert [(f.code, f.severity) for f in verdict.findings] == [("coasting", "suspect")]
    assert np.mean(simulated[off]) < 0.1
    assert np.mean(simulated[run.voltage != 0.0]) > 0.95


@pytest.mark.parametrize("drop", [0.0, 2.0])
@pytest.mark.parametrize("seed", range(6))
def test_motor_that_is_braked_does_not_coast(seed: int, drop: float) -> None:
    """A shorted motor has its braking current, until the brushes take the induced voltage."""
    assert coasting_of(duty_run(seed, coasts=False, drop=drop)) is None


def test_a_bridge_that_is_off_in_one_run_is_off_in_slow_pauses_of_another() -> None:
    """At low speed, brushes might stop the current; another run shows that the bridge is off."""
    fast, slow = duty_run(0, coasts=True), duty_run(1, coasts=True, before=0.1)
    found = coastings_of([fast, slow])
    pauses = (slow.voltage == 0.0) & (np.abs(slow.speed) > 0.05 * np.abs(slow.speed).max())

    assert coasting_of(slow) is None
    assert found[1] is not None
    assert np.mean(found[1].samples[pauses]) > 0.9


@pytest.mark.parametrize("seed", range(3))
def test_a_run_that_is_braked_does_not_coast_beside_one_that_does(seed: int) -> None:
    """A bridge that shorts the motor in this run has its braking current at any speed."""
    runs = [duty_run(0, coasts=True), duty_run(seed + 1, coasts=False, drop=0.5)]

    assert coastings_of(runs)[1] is None


def as_a_maker_logs_it(run: Run, zero: float = 0.0) -> Run:
    """The run with a filter of 10 ms and a zero error of the current, and 200 counts in a turn."""
    current, filtered = np.zeros(run.rows), run.current[0]
    for k, value in enumerate(run.current):
        filtered += (value - filtered) * (1.0 - np.exp(-STEP / 10e-3))
        current[k] = filtered + zero
    count = 2.0 * np.pi / 200
    angle = count * np.floor(STEP * np.cumsum(run.speed) / count)
    return replace(run, current=current, speed=np.diff(angle, prepend=0.0) / STEP)


@pytest.mark.parametrize("zero", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(3))
def test_a_filter_and_a_coarse_encoder_do_not_hide_a_coasting_motor(seed: int, zero: float) -> None:
    """The whole time without voltage is omitted, while the current ends and at low speed too."""
    run = as_a_maker_logs_it(duty_run(seed, coasts=True), zero)
    verdict = check_runs([run])
    simulated = np.zeros(run.rows, dtype=bool)
    for start, stop in verdict.runs[0].segments:
        simulated[start:stop] = True

    assert [(f.code, f.severity) for f in verdict.findings] == [("coasting", "suspect")]
    assert np.mean(simulated[run.voltage == 0.0]) < 0.1
    assert np.mean(simulated[run.voltage != 0.0]) > 0.95
    assert coasting_of(as_a_maker_logs_it(duty_run(seed, coasts=False), zero)) is None


def test_a_pulse_after_which_the_motor_coasts_holds_no_magnitudes() -> None:
    """No channel is ever negative: no voltage brakes the motor, and none of its current is missing.

    The current sensor has a filter of 50 ms, so that its current has not ended when the log does.
    """
    rows, rest, pulse = 370, 30, 200
    driven = (np.arange(rows) >= rest) & (np.arange(rows) < rest + pulse)
    current, speed, shown = np.zeros(rows), np.zeros(rows), 0.0
    i, w = 0.0, 0.0
    for k in range(rows):
        current[k], speed[k] = 0.02 * round(shown / 0.02), 5.0 * np.floor(w / 5.0)
        for _ in range(20):
            i = i + 5e-5 / 3e-3 * (9.0 - 4.2 * i - 0.018 * w) if driven[k] else 0.0
            w = max(w + 5e-5 / 2.5e-6 * (0.018 * i - 2e-6 * w - 1e-3), 0.0)
            shown += (i - shown) * 5e-5 / 50e-3
    run = Run("r.csv", "r", 1e-3 * np.arange(370.0), np.where(driven, 9.0, 0.0), current, speed)

    assert check_runs([run]).refused == ()


def test_estimates_without_the_coasting_samples_are_those_of_the_motor() -> None:
    """Within 4 deviations of the truth; with these samples far from it, and check says the same."""
    runs = [duty_run(seed, coasts=True) for seed in (1, 2)]
    admission = admitted(runs, [], FitOptions())
    fits = [fit_declared(records_of(each), "zoh") for each in (admission.training, runs)]

    assert deviations(fits[0]).max() < 4.0
    assert deviations(fits[1]).max() > 30.0
    found = {prospect.name: prospect for prospect in check(runs).prospects}
    assert found["Ra25"].value == pytest.approx(RA, rel=0.02)
    assert found["Kt25"].value == pytest.approx(KT, rel=0.02)


def test_current_of_a_dead_sensor_is_no_coasting() -> None:
    """A current of zero at a voltage is refused as before."""
    run = duty_run(1, coasts=False)
    dead = replace(run, current=np.zeros(run.rows) + 1e-3 * np.sin(np.arange(run.rows)))

    assert coasting_of(dead) is None
    assert "refuse" in {finding.severity for finding in check_runs([dead]).findings}
