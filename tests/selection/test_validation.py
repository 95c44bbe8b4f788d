"""Per-record amplitudes predict the second half of a validation record."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import StateSpace, lsim

from identification.arrays import Array
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit, TerminationLimits
from identification.ingest import Run
from identification.model.excitation import Record, records_of
from identification.selection.refit import refitted_with
from identification.selection.start import Start
from identification.selection.validation import validation_errors
from identification.surrogates.ripple import MissingTorqueRipple
from tests.motors import drive, motor_named

MOTOR = motor_named("servo 100 W")
ROWS, PERIODS, SIZE, NOISE = 1500, 3.0, 0.05, 0.002


def record(shape: Array, seed: int) -> Record:
    """Record of a run at 25 degC whose shaft has a torque in proportion to a shape (n_sample,).

    The factor is a twentieth of the stall torque.
    """
    rng = np.random.default_rng(seed)
    ra, _, kt, _, inertia, friction, inductance = MOTOR.vector
    matrix = np.array([[-ra / inductance, -kt / inductance], [kt / inertia, -friction / inertia]])
    inputs = np.diag([1.0 / inductance, 1.0 / inertia])
    voltage = drive(MOTOR, "steps", ROWS, rng)
    torque = SIZE * MOTOR.voltage / ra * kt * shape
    time = MOTOR.interval * np.arange(ROWS, dtype=np.float64)
    system = StateSpace(matrix, inputs, np.eye(2), np.zeros((2, 2)))
    _, states, _ = lsim(system, np.column_stack([voltage, torque]), time, interp=False)
    logged = states + NOISE * states.std(axis=0) * rng.standard_normal(states.shape)
    run = Run("r.csv", "0", time, voltage, logged[:, 0], logged[:, 1], np.full(ROWS, 25.0))
    return records_of([run])[0]


def models() -> tuple[Fit, Fit]:
    """The motor without and with a torque that is periodic in time, both at the same values."""
    fit = fit_declared([record(np.zeros(ROWS), 1)], "zoh")
    duration = MOTOR.interval * (ROWS - 1)
    size = MOTOR.voltage / MOTOR.values[0] * MOTOR.values[2]
    term = MissingTorqueRipple(size, 1.0 / duration, 0.4 / MOTOR.interval, duration)
    start = Start(np.array([PERIODS / duration, 0.0]))
    return fit, refitted_with(fit, term, [start], TerminationLimits(0))


def test_a_periodic_torque_is_predicted_from_the_first_half_of_a_record() -> None:
    """The phase is that of this run; the frequency is known."""
    turns = PERIODS * np.arange(ROWS) / (ROWS - 1)
    run = record(np.sin(2 * np.pi * turns + 1.0), 2)

    without, periodic = (validation_errors(fit, [run], 1.0).square for fit in models())

    assert np.all(periodic < 0.01 * without)


def test_a_torque_by_hand_is_no_periodic_torque() -> None:
    """A Fourier series follows any slow torque of the past, and predicts none of the future.

    The mean over several runs loses; fitted to all of each run, the series would gain in every one.
    """
    fits, changes = models(), []
    for seed in range(6):
        drawn = np.random.default_rng(seed).standard_normal(ROWS)
        slow = gaussian_filter1d(drawn, ROWS / 40)
        run = record(slow / slow.std(), seed + 3)
        without, periodic = (validation_errors(fit, [run], 1.0).square for fit in fits)
        changes.append(np.log(periodic / without))

    assert np.all(np.mean(changes, axis=0) > 0.0)
