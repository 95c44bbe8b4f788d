"""Dormand-Prince 5(4) integration with step control and friction events (compiled).

An explicit embedded pair is used on purpose: the identification steps by matrix exponentials, so
the bench repeats nothing of its discretisation.  Every voltage edge is a knot, so the solution is
smooth within an interval except where dry friction reverses or breaks away.  These events are
located by bisection, and the mode of the friction is switched there.

Source:
    Dormand, Prince (1980), J. Comput. Appl. Math. 6, 19-26.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

from bench.drive import limited, open_interval
from bench.physics import derivative
from bench.torques import drive_torque, dry_level

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["build_integrate"]

_MAX_STEPS = 50_000  # per interval; only a degenerate plant reaches it


@njit(error_model="numpy")
def _stages(t: float, h: float, y: Any, k: Any, trial: Any, p: Any, u: Any, active: Any) -> None:
    """Evaluate stages 2 to 7 of the pair; `trial` becomes the fifth-order solution."""
    for j in active:
        trial[j] = y[j] + h * 0.2 * k[0, j]
    derivative(t + 0.2 * h, trial, k[1], p, u)
    for j in active:
        trial[j] = y[j] + h * (3.0 / 40.0 * k[0, j] + 9.0 / 40.0 * k[1, j])
    derivative(t + 0.3 * h, trial, k[2], p, u)
    for j in active:
        trial[j] = y[j] + h * (44.0 / 45.0 * k[0, j] - 56.0 / 15.0 * k[1, j] + 32.0 / 9.0 * k[2, j])
    derivative(t + 0.8 * h, trial, k[3], p, u)
    for j in active:
        trial[j] = y[j] + h * (
            19372.0 / 6561.0 * k[0, j]
            - 25360.0 / 2187.0 * k[1, j]
            + 64448.0 / 6561.0 * k[2, j]
            - 212.0 / 729.0 * k[3, j]
        )
    derivative(t + 8.0 / 9.0 * h, trial, k[4], p, u)
    for j in active:
        trial[j] = y[j] + h * (
            9017.0 / 3168.0 * k[0, j]
            - 355.0 / 33.0 * k[1, j]
            + 46732.0 / 5247.0 * k[2, j]
            + 49.0 / 176.0 * k[3, j]
            - 5103.0 / 18656.0 * k[4, j]
        )
    derivative(t + h, trial, k[5], p, u)
    for j in active:
        trial[j] = y[j] + h * (
            35.0 / 384.0 * k[0, j]
            + 500.0 / 1113.0 * k[2, j]
            + 125.0 / 192.0 * k[3, j]
            - 2187.0 / 6784.0 * k[4, j]
            + 11.0 / 84.0 * k[5, j]
        )
    derivative(t + h, trial, k[6], p, u)


@njit(error_model="numpy")
def _error(
    h: float, y: Any, trial: Any, k: Any, active: Any, scale: Any, tolerance: float
) -> float:
    """Maximum ratio of the error estimate to its tolerance over the active states [-]."""
    worst = 0.0
    for j in active:
        gap = h * (
            71.0 / 57600.0 * k[0, j]
            - 71.0 / 16695.0 * k[2, j]
            + 71.0 / 1920.0 * k[3, j]
            - 17253.0 / 339200.0 * k[4, j]
            + 22.0 / 525.0 * k[5, j]
            - 1.0 / 40.0 * k[6, j]
        )
        allowed = tolerance * (scale[j] + max(abs(y[j]), abs(trial[j])))
        worst = max(worst, abs(gap) / allowed)
    return worst


@njit(error_model="numpy")
def _is_past_event(t: float, y: Any, p: Any, u: Any) -> bool:
    """Return True if the state has left the present mode of dry friction."""
    if u.direction == 0.0:
        torque = drive_torque(t, y, p, u)
        logged = u.temperature + u.temperature_slope * (t - u.start)
        return abs(torque) > dry_level(t, y, p, u, logged, np.sign(torque))
    return u.direction * y[1] < 0.0


@njit(error_model="numpy")
def _switch_mode(t: float, y: Any, p: Any, u: Any) -> None:
    """Select the mode at standstill: sticking, or sliding in the direction of the other torques."""
    y[1] = 0.0
    torque = drive_torque(t, y, p, u)
    direction = np.sign(torque)
    logged = u.temperature + u.temperature_slope * (t - u.start)
    held = abs(torque) <= dry_level(t, y, p, u, logged, direction) * (1.0 + 1e-12)
    u.direction = 0.0 if held else direction


@njit(error_model="numpy")
def _first_mode(t: float, y: Any, p: Any, u: Any) -> None:
    """Select the mode at the start of an interval or a run."""
    if y[1] == 0.0:
        _switch_mode(t, y, p, u)
    else:
        u.direction = np.sign(y[1])


@njit(error_model="numpy")
def _bisect_event(
    t: float, h: float, y: Any, k: Any, trial: Any, p: Any, u: Any, active: Any
) -> float:
    """Shortest step that ends past the event inside ``(t, t + h)``, to rounding error [s]."""
    low, high = 0.0, h
    for _ in range(60):
        if high - low <= 1e-13 * (abs(t) + h):
            break
        middle = 0.5 * (low + high)
        _stages(t, middle, y, k, trial, p, u, active)
        if _is_past_event(t + middle, trial, p, u):
            high = middle
        else:
            low = middle
    _stages(t, high, y, k, trial, p, u, active)
    return high


@njit(error_model="numpy")
def _advance(
    t: float, end: float, h: float, y: Any, k: Any, trial: Any, p: Any, u: Any, active: Any,
    scale: Any, tolerance: float, has_dry: bool,
) -> float:  # fmt: skip
    """Integrate `y` from `t` to `end`; return the first step size of the next interval [s].

    The result is NaN if the interval needs more than `_MAX_STEPS` steps.
    """
    tiny = 1e-12 * (end - t)
    derivative(t, y, k[0], p, u)
    for _ in range(_MAX_STEPS):
        if end - t <= tiny:
            return h
        last = h >= end - t
        step = end - t if last else h
        _stages(t, step, y, k, trial, p, u, active)
        error = _error(step, y, trial, k, active, scale, tolerance)
        if not error <= 1.0:
            h = step * max(0.2, 0.9 * error**-0.2) if error < 1e30 else 0.1 * step
            continue
        event = has_dry and _is_past_event(t + step, trial, p, u)
        if event:
            step = _bisect_event(t, step, y, k, trial, p, u, active)
            last = False
        t += step
        for j in active:
            y[j] = trial[j]
        if event:
            _switch_mode(t, y, p, u)
            derivative(t, y, k[0], p, u)
            continue
        for j in active:
            k[0, j] = k[6, j]
        growth = min(5.0, 0.9 * max(error, 1e-10) ** -0.2)
        h = max(h, step * growth) if last else step * growth
        if last:
            return h
    return np.nan


@njit(error_model="numpy")
def _carry(
    p: Any, u: Any, active: Any, grid: Any, knot: Any, command: Any, temperature: Any,
    is_linear: bool, limit: float, start: Any, scale: Any, tolerance: float, has_dry: bool,
) -> Any:  # fmt: skip
    """Integrate the plant over the grid; arguments as for the function of `build_integrate`."""
    y, trial = start.copy(), start.copy()
    k = np.zeros((7, start.size))
    states = np.zeros((grid.size, start.size))
    states[0] = y
    applied, peaks = np.zeros(command.size), np.zeros(command.size)
    times = grid[knot >= 0]
    u.direction = 1.0
    u.start = grid[0]
    u.temperature = temperature[0]
    applied[0] = limited(command[0], y, p, u, limit)
    h = 0.1 * (grid[1] - grid[0])
    for g in range(grid.size):
        if knot[g] >= 0:
            open_interval(knot[g], times, y, p, u, command, temperature, is_linear, limit, applied)
            peaks[knot[g]] = u.peak
            if has_dry:
                _first_mode(grid[g], y, p, u)
        if g + 1 < grid.size:
            h = _advance(
                grid[g], grid[g + 1], h, y, k, trial, p, u, active, scale, tolerance, has_dry
            )
            states[g + 1] = y
            if np.isnan(h):
                states[g + 1 :] = np.nan
                break
    return states, applied, peaks


def build_integrate(fingerprint: str) -> Callable[..., Any]:
    """Build the compiled entry point, cached on disk under a fingerprint of the sources.

    Numba's cache checks one file only.  The fingerprint in the closure forces a new compilation
    after a change in any of the source files.

    Args:
        fingerprint: Hash of the source files.
    """

    @njit(cache=True, error_model="numpy")
    def integrate(
        p: Any, u: Any, active: Any, grid: Any, knot: Any, command: Any, temperature: Any,
        is_linear: bool, limit: float, start: Any, scale: Any, tolerance: float, has_dry: bool,
    ) -> Any:  # fmt: skip
        """Integrate the plant over the grid.

        Args:
            p: Plant record.
            u: Drive record; `peak` is read at the start and updated.
            active: (n_active,) indices of the states to integrate.
            grid: (n_grid,) instants at which the state is returned, including the knots [s].
            knot: (n_grid,) index of the knot at this instant, -1 between knots.
            command: (n_knot,) voltage command to the drive [V].
            temperature: (n_knot,) true temperature at the thermometer, linear between knots [degC].
            is_linear: Whether the voltage is linear between knots (FOH) or held (ZOH).
            limit: Current limit of the drive, 0 for none [A].
            start: (n_state,) state at ``grid[0]``, which must be a knot.
            scale: (n_state,) magnitude of each state, for the absolute tolerance.
            tolerance: Relative tolerance per step.
            has_dry: Whether the plant has set-valued friction.

        Returns:
            States (n_grid, n_state), applied voltage at the knots (n_knot,) [V], and highest magnet
            temperature so far at the knots (n_knot,) [degC].
        """
        _ = fingerprint
        return _carry(
            p, u, active, grid, knot, command, temperature,
            is_linear, limit, start, scale, tolerance, has_dry,
        )  # fmt: skip

    return integrate
