"""Residuals of a fit and their derivatives, by hand-written numba code.

Forward sensitivities of the classical Runge-Kutta method: the nine derivatives of a run are
integrated with its state.  The unknowns are the parameters, positive ones in logarithms, and the
initial state of each run.  Residuals are divided by the true noise deviations, which a user would
have to estimate first.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from benchmarks.peers.task import Task

__all__ = ["LeastSquares"]

Array = NDArray[np.float64]

_POSITIVE = np.array([0, 2, 4, 5, 6])


@njit(fastmath=True, inline="always")
def _rates(x, v, heat, p, out):  # type: ignore[no-untyped-def]
    """Rates of current, speed and their derivatives, (10, 2): first the state."""
    ra, kt = p[0] * (1.0 + p[1] * heat), p[2] * (1.0 + p[3] * heat)
    per_l, per_j = 1.0 / p[6], 1.0 / p[4]
    for n in range(10):
        out[n, 0] = (-ra * x[n, 0] - kt * x[n, 1]) * per_l
        out[n, 1] = (kt * x[n, 0] - p[5] * x[n, 1]) * per_j
    i, w = x[0, 0], x[0, 1]
    out[0, 0] += v * per_l
    kt_by_kt25, kt_by_alpha = 1.0 + p[3] * heat, p[2] * heat
    out[1, 0] -= (1.0 + p[1] * heat) * i * per_l
    out[2, 0] -= p[0] * heat * i * per_l
    out[3, 0] -= kt_by_kt25 * w * per_l
    out[3, 1] += kt_by_kt25 * i * per_j
    out[4, 0] -= kt_by_alpha * w * per_l
    out[4, 1] += kt_by_alpha * i * per_j
    out[5, 1] -= out[0, 1] * per_j
    out[6, 1] -= w * per_j
    out[7, 0] -= out[0, 0] * per_l


@njit(fastmath=True)
def _simulated(p, interval, voltage, temperature, start, substeps):  # type: ignore[no-untyped-def]
    """State and derivatives of one run, (n_sample, 10, 2)."""
    found = np.empty((voltage.size, 10, 2))
    x = np.zeros((10, 2))
    x[0, 0], x[0, 1] = start[0], start[1]
    x[8, 0], x[9, 1] = 1.0, 1.0
    k1, k2, k3, k4 = np.empty((10, 2)), np.empty((10, 2)), np.empty((10, 2)), np.empty((10, 2))
    h = interval / substeps
    for k in range(voltage.size):
        found[k] = x
        v, heat = voltage[k], temperature[k] - 25.0
        for _ in range(substeps):
            _rates(x, v, heat, p, k1)
            _rates(x + 0.5 * h * k1, v, heat, p, k2)
            _rates(x + 0.5 * h * k2, v, heat, p, k3)
            _rates(x + h * k3, v, heat, p, k4)
            x += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return found


class LeastSquares:
    """Residuals and Jacobian of a task.

    Args:
        task: Data.
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        self.noise = task.truth[7:]
        self.spread = np.array([task.current.std(), task.speed.std()])
        self.calls = 0

    @property
    def start(self) -> Array:
        """(n_unknown,) rough guess, and the logged initial states."""
        task = self.task
        first = np.stack([task.current[:, 0], task.speed[:, 0]], axis=1) / self.spread
        guess = task.guess.copy()
        guess[_POSITIVE] = np.log(guess[_POSITIVE])
        guess[[1, 3]] *= 1e3
        return np.concatenate([guess, first.ravel()])

    def values(self, x: Array) -> Array:
        """(7,) physical parameters."""
        values = x[:7].copy()
        values[_POSITIVE] = np.exp(values[_POSITIVE])
        values[[1, 3]] *= 1e-3
        return values

    def residuals(self, x: Array) -> tuple[Array, Array]:
        """Residuals (n_residual,) and Jacobian (n_residual, n_unknown)."""
        self.calls += 1
        task, values = self.task, self.values(x)
        runs, rows = task.voltage.shape
        slopes = np.where(np.isin(np.arange(7), _POSITIVE), values, 1e-3)
        residuals = np.empty((runs, rows, 2))
        jacobian = np.zeros((runs, rows, 2, x.size))
        for r in range(runs):
            start = x[7 + 2 * r : 9 + 2 * r] * self.spread
            found = _simulated(
                values, float(task.interval[0]), task.voltage[r], task.temperature[r], start,
                int(task.substeps[0]),
            )  # fmt: skip
            logged = np.stack([task.current[r], task.speed[r]], axis=1)
            residuals[r] = (found[:, 0] - logged) / self.noise
            scaled = found[:, 1:] / self.noise
            jacobian[r, :, :, :7] = np.swapaxes(scaled[:, :7], 1, 2) * slopes
            jacobian[r, :, :, 7 + 2 * r] = scaled[:, 7] * self.spread[0]
            jacobian[r, :, :, 8 + 2 * r] = scaled[:, 8] * self.spread[1]
        return residuals.ravel(), jacobian.reshape(-1, x.size)
