"""Nominal-model fit to a campaign: exact discretisation and Levenberg-Marquardt.

The bench needs the detectability of an effect, which is not its nominal size but its residual after
the seven nominal parameters have been fitted and have absorbed part of it.  Between samples the
model is linear with constant coefficients, so one step is the exponential of a 2x2 matrix in closed
form.  The response is linear in the initial state, which linear least squares therefore determines
without iteration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from bench.campaign import Campaign
from bench.recording import BenchRun

__all__ = ["DeclaredFit", "basis", "fit_declared"]

Array = NDArray[np.float64]
_NAMES = ("Ra25", "Kt25", "J", "b", "L", "alpha_Ra", "alpha_Kt")
_LOGARITHMIC = 5


@njit(cache=True, error_model="numpy")
def _exponential(a: float, b: float, c: float, d: float, h: float, out: Any) -> None:
    """Matrix exponential of h [[a, b], [c, d]], written to `out` (2, 2)."""
    mean = 0.5 * (a + d)
    square = (mean * mean - (a * d - b * c)) * h * h
    if square > 1e-12:
        q = np.sqrt(square)
        up, down = np.exp(mean * h + q), np.exp(mean * h - q)
        even, odd = 0.5 * (up + down), 0.5 * (up - down) / q
    elif square < -1e-12:
        q = np.sqrt(-square)
        even, odd = np.exp(mean * h) * np.cos(q), np.exp(mean * h) * np.sin(q) / q
    else:
        even = odd = np.exp(mean * h)
    out[0, 0] = even + odd * h * (a - mean)
    out[0, 1] = odd * h * b
    out[1, 0] = odd * h * c
    out[1, 1] = even + odd * h * (d - mean)


@njit(cache=True, error_model="numpy")
def basis(time: Array, voltage: Array, temperature: Array, values: Array, is_linear: bool) -> Array:
    """Forced and free responses of the nominal model.

    Args:
        time: (n_sample,) [s].
        voltage: (n_sample,) [V].
        temperature: (n_sample,) [degC].
        values: (7,) Ra25, Kt25, J, b, L, alpha_Ra, alpha_Kt.
        is_linear: Whether the voltage is linear between samples (FOH) or held (ZOH).

    Returns:
        (3, 2, n_sample): response to the voltage from zero state, to unit initial current, and to
        unit initial speed; each with current [A] and speed [rad/s].
    """
    out = np.zeros((3, 2, time.size))
    out[1, 0, 0] = 1.0
    out[2, 1, 0] = 1.0
    step = np.zeros((2, 2))
    for n in range(time.size - 1):
        h = time[n + 1] - time[n]
        rise = 0.5 * (temperature[n] + temperature[n + 1]) - 25.0
        ra, kt = values[0] * (1.0 + values[5] * rise), values[1] * (1.0 + values[6] * rise)
        a, b, c, d = -ra / values[4], -kt / values[4], kt / values[2], -values[3] / values[2]
        _exponential(a, b, c, d, h, step)
        det = a * d - b * c
        # Zero-order hold: A^-1 (exp(A h) - I) B with B = (1/L, 0).
        g0, g1 = (step[0, 0] - 1.0) / values[4], step[1, 0] / values[4]
        held0, held1 = (d * g0 - b * g1) / det, (a * g1 - c * g0) / det
        drive0, drive1 = held0 * voltage[n], held1 * voltage[n]
        if is_linear:
            slope = (voltage[n + 1] - voltage[n]) / h
            g0, g1 = held0 - h / values[4], held1
            drive0 += slope * (d * g0 - b * g1) / det
            drive1 += slope * (a * g1 - c * g0) / det
        for k in range(3):
            i, w = out[k, 0, n], out[k, 1, n]
            out[k, 0, n + 1] = step[0, 0] * i + step[0, 1] * w
            out[k, 1, n + 1] = step[1, 0] * i + step[1, 1] * w
        out[0, 0, n + 1] += drive0
        out[0, 1, n + 1] += drive1
    return out


@dataclass(frozen=True)
class DeclaredFit:
    """Result of fitting the nominal model to a campaign.

    Args:
        parameters: Fitted values by name.
        shift: Relative error of each value against the true one [-].
        ratios: Simulation RMSE over the noise standard deviation, by role and channel [-].
    """

    parameters: dict[str, float]
    shift: dict[str, float]
    ratios: dict[str, dict[str, float]]

    @property
    def held_out(self) -> float:
        """Root mean square of the two channels' ratios on the validation runs [-]."""
        both = self.ratios["validation"]
        return float(np.sqrt(0.5 * (both["current"] ** 2 + both["speed"] ** 2)))


def _values(coordinates: Array) -> Array:
    """Convert coordinates to parameters: only the first five coordinates are logarithms."""
    values = coordinates.copy()
    values[:_LOGARITHMIC] = np.exp(values[:_LOGARITHMIC])
    return values


def _residual(run: BenchRun, coordinates: Array, sd: tuple[float, float], is_linear: bool) -> Array:
    """(2, n_sample) normalised residual of a run after least squares over its initial state [-]."""
    frame = run.frame
    response = basis(
        frame["time_s"].to_numpy(np.float64), frame["voltage_V"].to_numpy(np.float64),
        run.temperature, _values(coordinates), is_linear,
    ) / np.array(sd)[:, None]  # fmt: skip
    logged = np.stack(
        [frame["current_A"].to_numpy() / sd[0], frame["speed_rad_s"].to_numpy() / sd[1]]
    )
    if not np.isfinite(response).all():
        return np.full(logged.shape, np.inf)
    gap = (logged - response[0]).ravel()
    free = response[1:].reshape(2, -1).T
    return np.asarray(
        (gap - free @ np.linalg.lstsq(free, gap, rcond=None)[0]).reshape(2, -1), dtype=np.float64
    )


def _stack(runs: tuple[BenchRun, ...], x: Array, sd: tuple[float, float], hold: bool) -> Array:
    """(2, n) normalised residuals of all runs, concatenated [-]."""
    return np.concatenate([_residual(run, x, sd, hold) for run in runs], axis=1)


def _gauss_newton(
    runs: tuple[BenchRun, ...], x: Array, sd: tuple[float, float], hold: bool, steps: int
) -> Array:
    """Coordinates of the best fit, by Levenberg-Marquardt from `x` with numerical derivatives."""
    damping = 1e-4
    residual = _stack(runs, x, sd, hold).ravel()
    trial, fresh = x, residual
    for _ in range(steps):
        widths = np.array([1e-5] * _LOGARITHMIC + [1e-7, 1e-7])
        columns = [
            (_stack(runs, x + widths * (np.arange(7) == k), sd, hold).ravel() - residual)
            / widths[k]
            for k in range(7)
        ]
        jacobian = np.stack(columns, axis=1)
        normal, slope = jacobian.T @ jacobian, jacobian.T @ residual
        while damping < 1e8:
            move = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), slope)
            trial = x + np.clip(move, -1.0, 1.0)
            fresh = _stack(runs, trial, sd, hold).ravel()
            if fresh @ fresh < residual @ residual:
                break
            damping *= 10.0
        else:
            return x
        gained = 1.0 - (fresh @ fresh) / (residual @ residual)
        x, residual, damping = trial, fresh, max(damping / 10.0, 1e-9)
        if gained < 1e-5:
            break
    return x


def fit_declared(
    campaign: Campaign, noise: tuple[float, float] | None = None, steps: int = 12
) -> DeclaredFit:
    """Fit the nominal model to the training runs from the true values; evaluate it on all runs.

    Args:
        campaign: The campaign; the fit uses its declared hold, true or not.
        noise: Standard deviations of current [A] and speed [rad/s]; None for those of the campaign.
        steps: Maximum number of iterations.
    """
    truth = campaign.motor.parameters
    sd = noise or (campaign.truth["noise"]["current_A"], campaign.truth["noise"]["speed_rad_s"])
    hold = campaign.truth["hold"]["declared"] == "foh"
    start = np.array([truth[name] for name in _NAMES])
    start[:_LOGARITHMIC] = np.log(start[:_LOGARITHMIC])
    x = _gauss_newton(campaign.training, start, sd, hold, steps)
    ratios = {}
    for role, runs in (("training", campaign.training), ("validation", campaign.validation)):
        if runs:
            rms = np.sqrt(np.mean(_stack(runs, x, sd, hold) ** 2, axis=1))
            ratios[role] = {"current": float(rms[0]), "speed": float(rms[1])}
    fitted = dict(zip(_NAMES, _values(x).tolist(), strict=True))
    shift = {name: fitted[name] / truth[name] - 1.0 for name in _NAMES}
    return DeclaredFit(fitted, shift, ratios)
