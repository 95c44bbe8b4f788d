"""Runs in which the motor loses its supply while the set point of the voltage is logged."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from identification.checks import check_runs
from identification.checks.campaign import admitted
from identification.checks.disconnected import disconnections_of
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.model.excitation import records_of
from identification.options import FitOptions
from tests.checks.test_limited import KT, NOISE, RA, STEP, B, J, L, deviations

ROWS = 3000


def tripped_run(seed: int, opened: slice, *, zero: float = 0.0, load: float = 1.0) -> Run:
    """Steps of a voltage whose lead is open for a part of a run; the current has a zero error.

    Without current, the friction alone slows the motor.  Friction is B times `load`.  The set point
    of the voltage is zero during a quarter of the time with an open lead.
    """
    rng = np.random.default_rng(seed)
    command = np.repeat(rng.uniform(-24.0, 24.0, ROWS // 150), 150)
    matrix = np.array([[-RA / L, -KT / L, 1.0 / L], [KT / J, -B * load / J, 0.0], [0.0, 0.0, 0.0]])
    change, decay = expm(matrix * STEP)[:2], np.exp(-B * load / J * STEP)
    is_open = np.zeros(ROWS, dtype=bool)
    is_open[opened] = True
    command[is_open & (np.arange(ROWS) % 300 < 75)] = 0.0
    states = np.zeros((ROWS, 2))
    for k in range(ROWS - 1):
        if is_open[k]:
            states[k + 1] = 0.0, states[k, 1] * decay
        else:
            states[k + 1] = change @ [*states[k], command[k]]
    states[is_open, 0] = 0.0
    logged = states + NOISE * rng.normal(size=states.shape) + np.array([zero, 0.0])
    time: NDArray[np.float64] = STEP * np.arange(ROWS, dtype=np.float64)
    warmth = np.full(ROWS, 25.0)
    return Run(f"t{seed}.csv", str(seed), time, command, logged[:, 0], logged[:, 1], warmth)


@pytest.mark.parametrize("zero", [0.0, 0.5])
@pytest.mark.parametrize("opened", [slice(1400, ROWS), slice(700, 1300)])
def test_samples_without_a_supply_are_omitted(opened: slice, zero: float) -> None:
    """The lead is open for a known time; all of it is omitted, and hardly anything else."""
    run = tripped_run(1, opened, zero=zero)
    verdict = check_runs([run])
    simulated = np.zeros(run.rows, dtype=bool)
    for start, stop in verdict.runs[0].segments:
        simulated[start:stop] = True

    assert [(f.code, f.severity) for f in verdict.findings] == [("disconnected", "suspect")]
    assert np.mean(simulated[opened]) < 0.01
    assert np.mean(np.delete(simulated, np.r_[opened])) > 0.95


def test_the_motor_is_found_from_the_samples_with_a_supply() -> None:
    """The true parameters are known, and each is within four standard deviations."""
    runs = [tripped_run(1, slice(1400, ROWS)), tripped_run(2, slice(0, 0))]
    training = admitted(runs, [], FitOptions()).training
    fit = fit_declared(records_of(training), "zoh")

    assert np.all(deviations(fit) < 4.0)


@pytest.mark.parametrize("load", [0.0, 1.0])
@pytest.mark.parametrize("seed", range(4))
def test_a_motor_that_runs_without_load_is_connected(seed: int, load: float) -> None:
    """Without load the current is small after each step, as v - K w is."""
    assert disconnections_of([tripped_run(seed, slice(0, 0), load=load)]) == [None]


@pytest.mark.parametrize("drop", [0.5, 3.0])
def test_brushes_that_take_the_voltage_are_no_open_lead(drop: float) -> None:
    """Below the voltage drop of the brushes, a motor at rest has no current."""
    rng = np.random.default_rng(0)
    command = np.repeat(rng.uniform(-8.0, 8.0, 20), 150) * np.repeat([1.0, 0.3], ROWS // 2)
    states, state, fine = np.zeros((ROWS, 2)), np.zeros(2), 20
    matrix = np.array([[-RA / L, -KT / L, 1.0 / L], [KT / J, -B / J, 0.0], [0.0, 0.0, 0.0]])
    change = expm(matrix * STEP / fine)[:2]
    for k, asked in enumerate(command.tolist()):
        states[k] = state
        for _ in range(fine):
            state = change @ [*state, asked - drop * np.clip(state[0] / 0.05, -1.0, 1.0)]
    logged = states + NOISE * rng.normal(size=states.shape)
    time, warmth = STEP * np.arange(ROWS, dtype=np.float64), np.full(ROWS, 25.0)
    run = Run("b.csv", "b", time, command, logged[:, 0], logged[:, 1], warmth)

    assert disconnections_of([run]) == [None]
