"""Hand-written reference of the nominal model: numba loops and scipy's least squares.

The package is compared with this code, so it is optimised: the loop is compiled with fast
mathematics, reads its arrays once, keeps the state in registers, accumulates the sums of the
likelihood and allocates no memory.  It shares no code with the package.

The integrator is the classical Runge-Kutta method with zero-order hold.  It is unstable if a
substep is longer than 2.8 electrical time constants; `substeps_needed` chooses the smallest number
of substeps that shifts no estimate by more than half its standard deviation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import OptimizeResult, least_squares

__all__ = [
    "Recording",
    "by_solve_ivp",
    "fit_by_finite_differences",
    "simulate",
    "substeps_needed",
    "sums_of_all_walkers",
    "sums_of_squares",
]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Recording:
    """Runs of equal length, one per row.

    Args:
        interval: Sample interval [s].
        voltage: (n_run, n_sample) [V].
        temperature: (n_run, n_sample) [degC].
        current: (n_run, n_sample) [A].
        speed: (n_run, n_sample) [rad/s].
    """

    interval: float
    voltage: Array
    temperature: Array
    current: Array
    speed: Array


@njit(fastmath=True, inline="always")
def _advanced(i, w, v, ra, kt, inductance, inertia, b, h, substeps):  # type: ignore[no-untyped-def]
    """Current and speed one interval later by `substeps` Runge-Kutta steps of length `h`."""
    for _ in range(substeps):
        i1 = (v - ra * i - kt * w) * inductance
        w1 = (kt * i - b * w) * inertia
        i2 = (v - ra * (i + 0.5 * h * i1) - kt * (w + 0.5 * h * w1)) * inductance
        w2 = (kt * (i + 0.5 * h * i1) - b * (w + 0.5 * h * w1)) * inertia
        i3 = (v - ra * (i + 0.5 * h * i2) - kt * (w + 0.5 * h * w2)) * inductance
        w3 = (kt * (i + 0.5 * h * i2) - b * (w + 0.5 * h * w2)) * inertia
        i4 = (v - ra * (i + h * i3) - kt * (w + h * w3)) * inductance
        w4 = (kt * (i + h * i3) - b * (w + h * w3)) * inertia
        i += h * (i1 + 2.0 * i2 + 2.0 * i3 + i4) / 6.0
        w += h * (w1 + 2.0 * w2 + 2.0 * w3 + w4) / 6.0
    return i, w


@njit(fastmath=True, cache=False)
def simulate(parameters, interval, voltage, temperature, start, substeps):  # type: ignore[no-untyped-def]
    """Current and speed of one run, (n_sample, 2) [A, rad/s].

    Args:
        parameters: (7,) Ra25, alpha_Ra, Kt25, alpha_Kt, J, b, L.
        interval: Sample interval [s].
        voltage: (n_sample,) [V].
        temperature: (n_sample,) [degC].
        start: (2,) current and speed at the first sample.
        substeps: Runge-Kutta steps per interval.
    """
    ra25, alpha_ra, kt25, alpha_kt, inertia, b, inductance = parameters
    out = np.empty((voltage.size, 2))
    i, w = start[0], start[1]
    h = interval / substeps
    for k in range(voltage.size):
        out[k, 0] = i
        out[k, 1] = w
        heat = temperature[k] - 25.0
        ra, kt = ra25 * (1.0 + alpha_ra * heat), kt25 * (1.0 + alpha_kt * heat)
        i, w = _advanced(i, w, voltage[k], ra, kt, 1.0 / inductance, 1.0 / inertia, b, h, substeps)
    return out


@njit(fastmath=True, inline="always")
def _sums_of_run(parameters, interval, voltage, temperature, current, speed, start, substeps):  # type: ignore[no-untyped-def]
    """Sums of squared residuals of current and speed of one run."""
    ra25, alpha_ra, kt25, alpha_kt, inertia, b, inductance = parameters
    i, w = start[0], start[1]
    of_current, of_speed = 0.0, 0.0
    h = interval / substeps
    for k in range(voltage.size):
        of_current += (current[k] - i) ** 2
        of_speed += (speed[k] - w) ** 2
        heat = temperature[k] - 25.0
        ra, kt = ra25 * (1.0 + alpha_ra * heat), kt25 * (1.0 + alpha_kt * heat)
        i, w = _advanced(i, w, voltage[k], ra, kt, 1.0 / inductance, 1.0 / inertia, b, h, substeps)
    return of_current, of_speed


@njit(fastmath=True)
def sums_of_squares(  # type: ignore[no-untyped-def]
    parameters, interval, voltage, temperature, current, speed, starts, substeps
):
    """Sums of squared residuals over all runs for one parameter vector: one likelihood.

    Args:
        parameters: (7,) Ra25, alpha_Ra, Kt25, alpha_Kt, J, b, L.
        interval: Sample interval [s].
        voltage: (n_run, n_sample) [V].
        temperature: (n_run, n_sample) [degC].
        current: (n_run, n_sample) [A].
        speed: (n_run, n_sample) [rad/s].
        starts: (n_run, 2) current and speed at the first samples.
        substeps: Runge-Kutta steps per interval.
    """
    of_current, of_speed = 0.0, 0.0
    for r in range(voltage.shape[0]):
        a, c = _sums_of_run(
            parameters,
            interval,
            voltage[r],
            temperature[r],
            current[r],
            speed[r],
            starts[r],
            substeps,
        )
        of_current += a
        of_speed += c
    return of_current, of_speed


@njit(fastmath=True, parallel=True)
def sums_of_all_walkers(  # type: ignore[no-untyped-def]
    walkers, interval, voltage, temperature, current, speed, starts, substeps
):
    """Sums of squares of many parameter vectors on all cores, (n_walker, 2).

    Args:
        walkers: (n_walker, 7) parameter vectors.
        interval: Sample interval [s].
        voltage: (n_run, n_sample) [V].
        temperature: (n_run, n_sample) [degC].
        current: (n_run, n_sample) [A].
        speed: (n_run, n_sample) [rad/s].
        starts: (n_walker, n_run, 2) current and speed at the first samples.
        substeps: Runge-Kutta steps per interval.
    """
    sums = np.empty((walkers.shape[0], 2))
    for n in prange(walkers.shape[0]):
        sums[n, 0], sums[n, 1] = sums_of_squares(
            walkers[n], interval, voltage, temperature, current, speed, starts[n], substeps
        )
    return sums


def substeps_needed(
    parameters: Array, recording: Recording, start: Array, noise: Array, moved: float = 0.5
) -> int:
    """Smallest number of substeps whose error shifts no estimate by more than `moved`.

    By the Cauchy-Schwarz inequality an error e in N samples of noise s shifts any estimate by at
    most sqrt(N) rms(e) / s of its standard deviations.

    Args:
        parameters: (7,) Ra25, alpha_Ra, Kt25, alpha_Kt, J, b, L.
        recording: Runs; the first 2000 samples of the first are used.
        start: (2,) current and speed at the first sample.
        noise: (2,) standard deviations of current and speed.
        moved: Permitted shift of an estimate, in standard deviations.
    """
    voltage = np.ascontiguousarray(recording.voltage[0, :2000])
    temperature = np.ascontiguousarray(recording.temperature[0, :2000])
    least = max(1, int(np.ceil(recording.interval * parameters[0] / parameters[6] / 2.7)))

    def by(substeps: int) -> Array:
        return np.asarray(
            simulate(parameters, recording.interval, voltage, temperature, start, substeps)
        )

    exact = by(64 * least)
    substeps = least
    allowed = moved * noise / np.sqrt(recording.voltage.size)
    while not np.all(np.sqrt(np.mean((by(substeps) - exact) ** 2, axis=0)) < allowed):
        substeps += 1
    return substeps


def fit_by_finite_differences(
    guess: Array, recording: Recording, substeps: int, *, free_starts: bool
) -> OptimizeResult:
    """`scipy.optimize.least_squares` with its own finite differences on `simulate`.

    Positive quantities are searched in logarithms and every residual is divided by the scale of
    its channel, otherwise the search does not converge.

    Args:
        guess: (7,) parameters to start from.
        recording: Runs.
        substeps: Runge-Kutta steps per interval.
        free_starts: Whether the initial state of each run is fitted as well.
    """
    size = np.array([np.std(recording.current), np.std(recording.speed)])
    logged = np.stack([recording.current, recording.speed], axis=2)
    first = logged[:, 0, :] / size
    positive = np.array([0, 2, 4, 5, 6])

    def residuals(x: Array) -> Array:
        parameters = x[:7].copy()
        parameters[positive] = np.exp(parameters[positive])
        starts = (x[7:].reshape(first.shape) if free_starts else first) * size
        parts = [
            simulate(parameters, recording.interval, v, t, s, substeps)
            for v, t, s in zip(recording.voltage, recording.temperature, starts, strict=True)
        ]
        return np.ravel((logged - np.stack(parts)) / size)

    x0 = guess.copy()
    x0[positive] = np.log(x0[positive])
    if free_starts:
        x0 = np.concatenate([x0, first.ravel()])
    found = least_squares(residuals, x0, x_scale="jac")
    found.x[positive] = np.exp(found.x[positive])
    return found


def by_solve_ivp(
    parameters: Array, recording: Recording, start: Array, rows: int, method: str
) -> Array:
    """Current and speed of the first samples by scipy's `solve_ivp`, (rows, 2).

    Args:
        parameters: (7,) Ra25, alpha_Ra, Kt25, alpha_Kt, J, b, L.
        recording: Runs; the first is simulated.
        start: (2,) current and speed at the first sample.
        rows: Samples to simulate.
        method: Method of `solve_ivp`.
    """
    ra25, alpha_ra, kt25, alpha_kt, inertia, b, inductance = (float(x) for x in parameters)
    interval = recording.interval
    voltage = recording.voltage[0].tolist()
    temperature = recording.temperature[0].tolist()

    def rates(t: float, x: Array) -> tuple[float, float]:
        k = min(int(t / interval), rows - 1)
        heat = temperature[k] - 25.0
        i, w = x
        kt = kt25 * (1.0 + alpha_kt * heat)
        return (
            (voltage[k] - ra25 * (1.0 + alpha_ra * heat) * i - kt * w) / inductance,
            (kt * i - b * w) / inertia,
        )

    time = interval * np.arange(rows)
    # Without the limit the step would jump over changes of the voltage.
    solution = solve_ivp(
        rates,
        (0.0, time[-1]),
        start,
        method=method,
        t_eval=time,
        max_step=interval,
        rtol=1e-6,
        atol=1e-9,
    )
    return np.asarray(solution.y.T)
