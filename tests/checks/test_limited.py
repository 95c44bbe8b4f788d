"""Drives that limit the current while the set point of their voltage is logged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

from identification.checks import check_runs
from identification.checks.campaign import admitted
from identification.checks.limited import current_limit_of
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit
from identification.ingest import Run
from identification.model.excitation import records_of
from identification.options import FitOptions

Array = NDArray[np.float64]

RA, KT, J, B, L, STEP = 0.6, 0.07, 1e-4, 1e-4, 2e-3, 1e-3
NOISE = np.array([0.02, 0.1])
TRUTH = {"Ra25": RA, "Kt25": KT, "J": J, "b": B, "L": L}


def limited_run(limit: float, seed: int, inductance: float = L) -> tuple[Run, Array]:
    """Run with the set point as its voltage, and the voltage at the motor (n_sample,) [V].

    The drive chooses the voltage of each interval so that the current ends at the limit; current
    and speed follow from the matrix exponential.
    """
    rng, rows = np.random.default_rng(seed), 3000
    command = np.repeat(rng.uniform(-24.0, 24.0, 50), 60)
    block = np.zeros((3, 3))
    block[0] = np.array([-RA, -KT, 1.0]) / inductance
    block[1] = [KT / J, -B / J, 0.0]
    change = expm(block * STEP)[:2]
    state, states, applied = np.zeros(2), np.zeros((rows, 2)), command.copy()
    for k, asked in enumerate(command.tolist()):
        states[k] = state
        ahead = change @ [*state, asked]
        excess = ahead[0] - np.clip(ahead[0], -limit, limit)
        applied[k] -= excess / change[0, 2]
        state = change @ [*state, applied[k]]
    logged = states + NOISE * rng.normal(size=states.shape)
    time, warmth = STEP * np.arange(rows, dtype=np.float64), np.full(rows, 25.0)
    run = Run(f"r{seed}.csv", str(seed), time, command, logged[:, 0], logged[:, 1], warmth)
    return run, applied


def converter_noise(rows: int) -> Array:
    """Noise of a converter [A]."""
    return 0.02 * np.random.default_rng(9).normal(size=rows)


def deviations(fit: Fit) -> Array:
    """Distances of the determined parameters from the truth, in standard deviations."""
    spread = np.sqrt(np.diag(fit.equations.covariance()))
    slopes = fit.coordinates.slopes(fit.position)
    at = {name: k for k, name in enumerate(fit.coordinates.names)}
    return np.array(
        [abs(fit.by_name[n] - v) / (slopes[at[n]] * spread[at[n]]) for n, v in TRUTH.items()]
    )


def clamped_run(limit: float, seed: int) -> Run:
    """Run with the set point of a drive that clamps its voltage to K w -+ R limit as its voltage.

    The current approaches the limit with the electrical time constant of 1 ms, in steps of 0.05 ms.
    """
    rng, rows, substeps = np.random.default_rng(seed), 3000, 20
    command = np.repeat(rng.uniform(-12.0, 12.0, 15), 200)
    block = np.zeros((3, 3))
    block[0] = np.array([-RA, -KT, 1.0]) / 6e-4
    block[1] = [KT / (3.0 * J), -B / (3.0 * J), 0.0]
    change = expm(block * STEP / substeps)[:2]
    state, states = np.zeros(2), np.zeros((rows, 2))
    for k, asked in enumerate(command.tolist()):
        states[k] = state
        for _ in range(substeps):
            emf = KT * state[1]
            applied = min(max(asked, emf - RA * limit), emf + RA * limit)
            state = change @ [*state, applied]
    logged = states + NOISE * rng.normal(size=states.shape)
    time, warmth = STEP * np.arange(rows, dtype=np.float64), np.full(rows, 25.0)
    return Run(f"c{seed}.csv", str(seed), time, command, logged[:, 0], logged[:, 1], warmth)


@pytest.mark.parametrize("seed", range(4))
def test_a_voltage_that_is_clamped_to_limit_the_current_is_found(seed: int) -> None:
    """The rise to the limit has another voltage, too, and is no part of the regression."""
    (finding,) = check_runs([clamped_run(10.0, seed)]).findings

    assert finding.code == "current_limit"


@pytest.mark.parametrize("limit", [12.0, 18.0, 25.0])
def test_no_interval_with_another_voltage_is_simulated(limit: float) -> None:
    """The true intervals are known; of the others, nearly all are."""
    run, applied = limited_run(limit, seed=1)
    active = np.abs(applied - run.voltage) > 1e-9
    (checked,) = check_runs([run]).runs
    simulated = np.zeros(run.rows, dtype=bool)
    for start, stop in checked.segments:
        simulated[start : stop - 1] = True

    assert active.sum() > 20
    assert not np.any(simulated & active)
    assert np.mean(simulated[~active]) > 0.85


def test_the_estimates_are_those_of_the_motor() -> None:
    """Without the limited intervals within 4 deviations of the truth; with them, far from it."""
    runs = [limited_run(15.0, seed=seed)[0] for seed in (1, 2)]
    admission = admitted(runs, [], FitOptions())
    fits = [fit_declared(records_of(each), "zoh") for each in (admission.training, runs)]

    assert {f.code for f in admission.findings} == {"current_limit"}
    assert deviations(fits[0]).max() < 4.0
    assert deviations(fits[1]).max() > 30.0


def test_a_sensor_that_saturates_before_its_noise_is_found() -> None:
    """The motor exceeds the range, and the noise of the converter hides the plateau."""
    run, _ = limited_run(np.inf, seed=1)
    run = replace(run, current=np.clip(run.current, -14.0, 14.0) + converter_noise(run.rows))
    found = current_limit_of(run)

    assert found is not None
    assert float(found.finding.message.split()[2]) == pytest.approx(14.0, abs=0.02)


@pytest.mark.parametrize("limit", [10.0, 15.0, 25.0])
@pytest.mark.parametrize("inductance", [1e-4, 5e-4, 2e-3])
def test_a_limited_current_agrees_with_the_voltage_at_the_motor(
    limit: float, inductance: float
) -> None:
    """The same current as with the set point; the samples at the limit are good ones."""
    for seed in range(4):
        run, applied = limited_run(limit, seed, inductance)

        assert current_limit_of(run) is not None
        assert current_limit_of(replace(run, voltage=applied)) is None


@pytest.mark.parametrize("seed", range(8))
def test_a_drive_below_its_limit_has_none(seed: int) -> None:
    """The highest currents pass, or stay because shaft or load hold them."""
    run, _ = limited_run(np.inf, seed=seed)
    rng = np.random.default_rng(seed)
    held = np.repeat(rng.choice([-10.0, -4.0, 4.0, 10.0], 50), 60)
    decay = np.exp(-RA / L * STEP)
    current = lfilter([0.0, 1.0 - decay], [1.0, -decay], held / RA) + converter_noise(3000)
    locked = replace(run, voltage=held, current=current, speed=NOISE[1] * rng.normal(size=3000))

    assert current_limit_of(run) is None
    assert current_limit_of(locked) is None
