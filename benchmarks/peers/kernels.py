"""Hand-tuned numba kernels: the fastest known simulation of many walkers.

The voltage is held between samples, so one interval is an affine map.  By the theorem of Cayley and
Hamilton every power of the 2x2 matrix M of an interval is p I + q M, and the Taylor series of
phi(M) = (exp(M) - I) / M takes four operations per order.  `LANES` walkers advance together in an
inner loop that LLVM compiles to vector instructions; state and parameters stay in the first-level
cache.  With `_ORDER` terms the series is exact to 1e-8 if the norm of M is below 0.5, which holds
for the motor of the comparison and not for a stiff one.

Dry friction keeps its sign between two zeros of the speed, so its map is affine too.  Intervals
with a zero, or at standstill, are solved by events in a scalar function.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

__all__ = ["LANES", "friction_in_lanes", "friction_run", "nominal_in_lanes"]

LANES = 32
"""Walkers per inner loop; the number of walkers must be a multiple of it."""


@njit(fastmath=True, inline="always")
def _series(t, d):  # type: ignore[no-untyped-def]
    """Coefficients p and q of phi(M) = p I + q M from trace `t` and determinant `d` of M."""
    p, q = 1.0 / 5040.0 + 0.0 * t, 1.0 / 40320.0 + 0.0 * t
    p, q = 1.0 / 720.0 - q * d, p + q * t
    p, q = 1.0 / 120.0 - q * d, p + q * t
    p, q = 1.0 / 24.0 - q * d, p + q * t
    p, q = 1.0 / 6.0 - q * d, p + q * t
    p, q = 0.5 - q * d, p + q * t
    return 1.0 - q * d, p + q * t


@njit(fastmath=True, inline="always")
def _stepped(i, w, u, f, a, k, c, b):  # type: ignore[no-untyped-def]
    """State after an interval with the matrix [[-a, -k], [c, -b]] and the forces u and f."""
    p, q = _series(-(a + b), a * b + k * c)
    di, dw = u - a * i - k * w, f + c * i - b * w
    return i + p * di - q * (a * di + k * dw), w + p * dw + q * (c * di - b * dw)


@njit(fastmath=True, parallel=True, error_model="numpy")
def nominal_in_lanes(  # type: ignore[no-untyped-def]
    walkers, interval, voltage, temperature, current, speed, starts
):
    """Sums of squares of many parameter vectors, (n_walker, 2).

    Args:
        walkers: (n_walker, 7) Ra25, alpha_Ra, Kt25, alpha_Kt, J, b, L.
        interval: Sample interval [s].
        voltage: (n_run, n_sample) [V].
        temperature: (n_run, n_sample) [degC].
        current: (n_run, n_sample) [A].
        speed: (n_run, n_sample) [rad/s].
        starts: (n_walker, n_run, 2) current and speed at the first samples.
    """
    sums = np.zeros((walkers.shape[0], 2))
    for g in prange(walkers.shape[0] // LANES):
        own = walkers[g * LANES : (g + 1) * LANES]
        per_l, per_j = interval / own[:, 6], interval / own[:, 4]
        ra, ra_slope = own[:, 0] * per_l, own[:, 0] * own[:, 1] * per_l
        kt, kt_slope = own[:, 2].copy(), own[:, 2] * own[:, 3]
        b = own[:, 5] * per_j
        of_current, of_speed = np.zeros(LANES), np.zeros(LANES)
        i, w = np.empty(LANES), np.empty(LANES)
        for r in range(voltage.shape[0]):
            i[:] = starts[g * LANES : (g + 1) * LANES, r, 0]
            w[:] = starts[g * LANES : (g + 1) * LANES, r, 1]
            for k in range(voltage.shape[1]):
                heat, v = temperature[r, k] - 25.0, voltage[r, k]
                logged_current, logged_speed = current[r, k], speed[r, k]
                for n in range(LANES):
                    of_current[n] += (logged_current - i[n]) ** 2
                    of_speed[n] += (logged_speed - w[n]) ** 2
                    kt_now = kt[n] + kt_slope[n] * heat
                    i[n], w[n] = _stepped(
                        i[n], w[n], v * per_l[n], 0.0, ra[n] + ra_slope[n] * heat,
                        kt_now * per_l[n], kt_now * per_j[n], b[n],
                    )  # fmt: skip
        sums[g * LANES : (g + 1) * LANES, 0] = of_current
        sums[g * LANES : (g + 1) * LANES, 1] = of_speed
    return sums


@njit(fastmath=True)
def _slid(i, w, u, f, a, k, c, b, part):  # type: ignore[no-untyped-def]
    """State after a part of an interval at constant friction."""
    return _stepped(i, w, u * part, f * part, a * part, k * part, c * part, b * part)


@njit
def _by_events(i, w, u, f, a, k, c, b):  # type: ignore[no-untyped-def]
    """State after an interval with zeros of the speed or standstill; Coulomb friction `f`."""
    left = 1.0
    for _ in range(8):
        if w == 0.0 and abs(c * i) <= f:
            # Standstill until the torque of the motor exceeds the friction.
            rest = u / a
            target = (f if rest > 0.0 else -f) / c
            part = left
            if abs(rest) > abs(target):
                part = min(left, np.log((rest - i) / (rest - target)) / a)
            i = rest + (i - rest) * np.exp(-a * part)
            left -= part
            if left <= 0.0:
                return i, 0.0
            i = target * (1.0 + 1e-12)
        sign = np.sign(w) if w != 0.0 else np.sign(c * i)
        end_i, end_w = _slid(i, w, u, -sign * f, a, k, c, b, left)
        if sign * end_w >= 0.0:
            return end_i, end_w
        low, high, at_low, at_high = 0.0, left, sign * w, sign * end_w
        part = left
        middle_i, middle_w = i, end_w
        for _ in range(6):
            # Regula falsi with the Illinois rule.
            if abs(middle_w) < 1e-6 * abs(end_w - w):
                break
            part = (low * at_high - high * at_low) / (at_high - at_low)
            middle_i, middle_w = _slid(i, w, u, -sign * f, a, k, c, b, part)
            if sign * middle_w > 0.0:
                low, at_low, at_high = part, sign * middle_w, 0.5 * at_high
            else:
                high, at_high, at_low = part, sign * middle_w, 0.5 * at_low
        i, w = middle_i, 0.0
        left -= part
    return i, w


@njit
def friction_run(walker, interval, voltage, temperature):  # type: ignore[no-untyped-def]
    """Current and speed of one run from rest with Coulomb friction, (n_sample, 2).

    Args:
        walker: (8,) Ra25, alpha_Ra, Kt25, alpha_Kt, J, b, L and friction torque.
        interval: Sample interval [s].
        voltage: (n_sample,) [V].
        temperature: (n_sample,) [degC].
    """
    out = np.empty((voltage.size, 2))
    i, w = 0.0, 0.0
    per_l, per_j = interval / walker[6], interval / walker[4]
    for k in range(voltage.size):
        out[k, 0], out[k, 1] = i, w
        heat = temperature[k] - 25.0
        kt = walker[2] * (1.0 + walker[3] * heat)
        ra = walker[0] * (1.0 + walker[1] * heat)
        i, w = _by_events(
            i, w, voltage[k] * per_l, walker[7] * per_j, ra * per_l, kt * per_l, kt * per_j,
            walker[5] * per_j,
        )  # fmt: skip
    return out


@njit(fastmath=True, parallel=True, error_model="numpy")
def friction_in_lanes(  # type: ignore[no-untyped-def]
    walkers, interval, voltage, temperature, current, speed, starts
):
    """Sums of squares with Coulomb friction, (n_walker, 2); the arguments as above.

    Args:
        walkers: (n_walker, 8) the parameters above and the friction torque [N m].
        interval: Sample interval [s].
        voltage: (n_run, n_sample) [V].
        temperature: (n_run, n_sample) [degC].
        current: (n_run, n_sample) [A].
        speed: (n_run, n_sample) [rad/s].
        starts: (n_walker, n_run, 2) current and speed at the first samples.
    """
    sums = np.zeros((walkers.shape[0], 2))
    for g in prange(walkers.shape[0] // LANES):
        own = walkers[g * LANES : (g + 1) * LANES]
        per_l, per_j = interval / own[:, 6], interval / own[:, 4]
        ra, ra_slope = own[:, 0] * per_l, own[:, 0] * own[:, 1] * per_l
        kt, kt_slope = own[:, 2].copy(), own[:, 2] * own[:, 3]
        b, dry = own[:, 5] * per_j, own[:, 7] * per_j
        of_current, of_speed = np.zeros(LANES), np.zeros(LANES)
        i, w = np.empty(LANES), np.empty(LANES)
        next_i, next_w = np.empty(LANES), np.empty(LANES)
        for r in range(voltage.shape[0]):
            i[:] = starts[g * LANES : (g + 1) * LANES, r, 0]
            w[:] = starts[g * LANES : (g + 1) * LANES, r, 1]
            for k in range(voltage.shape[1]):
                heat, v = temperature[r, k] - 25.0, voltage[r, k]
                logged_current, logged_speed = current[r, k], speed[r, k]
                crossed = 0.0
                for n in range(LANES):
                    of_current[n] += (logged_current - i[n]) ** 2
                    of_speed[n] += (logged_speed - w[n]) ** 2
                    kt_now = kt[n] + kt_slope[n] * heat
                    sign = 1.0 if w[n] > 0.0 else -1.0
                    next_i[n], next_w[n] = _stepped(
                        i[n], w[n], v * per_l[n], -dry[n] * sign,
                        ra[n] + ra_slope[n] * heat,
                        kt_now * per_l[n], kt_now * per_j[n], b[n],
                    )  # fmt: skip
                    crossed += np.float64(w[n] * next_w[n] <= 0.0)
                if crossed > 0.0:
                    for n in range(LANES):
                        if w[n] * next_w[n] <= 0.0:
                            kt_now = kt[n] + kt_slope[n] * heat
                            next_i[n], next_w[n] = _by_events(
                                i[n], w[n], v * per_l[n], dry[n], ra[n] + ra_slope[n] * heat,
                                kt_now * per_l[n], kt_now * per_j[n], b[n],
                            )  # fmt: skip
                i[:] = next_i
                w[:] = next_w
        sums[g * LANES : (g + 1) * LANES, 0] = of_current
        sums[g * LANES : (g + 1) * LANES, 1] = of_speed
    return sums
