"""Sums of exponential modes, also for coincident poles.

Partial fractions write a response as a sum of c_k exp(p_k t).  For nearly coincident poles the
weights c_k grow without bound and cancel; for coincident poles the form does not exist.  Newton's
divided-difference form has no such singularity:

    x(t) = a_1 f[p_1] + a_2 f[p_1, p_2] + a_3 f[p_1, p_2, p_3] + ...         f(p) = exp(p t)

Its divided differences f[...] are smooth in the poles: f[p, p] is t exp(p t).  The faster partial
fractions are evaluated for separate poles, Newton's form for the others.  A matrix exponential for
each draw and time would be as robust, but two hundred times slower.

Newton's form also shows what the operator D - p_1 (D = d/dt) does: it removes the first pole and
the first weight.  `Modes.tail` is that sum; its zeros bracket the turns of exp(-p_1 t) x(t).

Two upper bounds of a stable sum hold for all t >= 0.  The modal bound, sum |c_k| exp(Re p_k t), is
tight, but useless for nearly coincident poles, whose weights grow without limit.  The Newton bound,

    (|a_1| + |a_2| t + |a_3| t^2 / 2 + ...) exp(p t)          p the largest real part,

holds for all poles, because a divided difference of the exponential is a mean of its derivatives
(Hermite-Genocchi formula), but is loose for widely separated poles.  The bound that falls below the
level first limits the horizon in which a response has to be searched.

Source: McCurdy, Ng and Parlett, Mathematics of Computation 43 (1984), 501-528 (divided
differences of the exponential).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from typing import Final

import numpy as np

from identification.arrays import Array, Bool, Complex, Index
from identification.speed_loop.roots import root

__all__ = ["Modes", "bound_at", "time_below"]


# Relative distance of poles above which partial fractions lose no more than two digits.
_APART: Final = 0.1
# Poles closer than 1/t are summed as a series around their mean; the terms decay as 1/k!.
_SERIES_TERMS: Final = 18
_SMALLEST_GAP: Final = 1e-150
_LARGEST_WEIGHT: Final = 1e60
_FIXED_POINT_STEPS: Final = 40
# The bound may equal the sum; this relative margin in time covers rounding.
_ROUNDING: Final = 1e-6


@dataclass(frozen=True)
class Modes:
    """Inverse Laplace transforms of N(s) / ((s - p_1) ... (s - p_n))."""

    poles: Complex
    """(n_loop, n_pole) [1/s]."""
    weights: Complex
    """Coefficients a_1 to a_n of Newton's form, (n_loop, n_pole)."""
    residues: Complex
    """Weights c_1 to c_n of the partial fractions, (n_loop, n_pole); not finite for coincident
    poles."""
    have_neighbours: Bool
    """(n_loop,) true if two poles of a loop are too close for partial fractions."""

    @classmethod
    def of(cls, numerator: Array, poles: Complex) -> Modes:
        """Sums of modes of strictly proper fractions, from their poles (n_loop, n_pole) [1/s].

        The numerators (n_loop, n_pole) are in falling powers from s^(n_pole - 1).
        """
        weights = numerator.astype(np.complex128)
        # Repeated synthetic division: by the last pole, then the one before it.
        for last in range(poles.shape[1] - 1, 0, -1):
            for k in range(1, last + 1):
                weights[:, k] += weights[:, k - 1] * poles[:, last]
        value = np.zeros_like(poles)
        for coefficient in numerator.T:
            value = value * poles + coefficient[:, None]
        apart = poles[:, :, None] - poles[:, None, :] + np.eye(poles.shape[1])
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            residues = value / apart.prod(axis=2)
        return cls(poles, weights, residues, _have_neighbours(poles))

    def selected(self, rows: Bool, scale: Array) -> Modes:
        """Sums of the selected loops, each divided by its `scale`, (n_selected,)."""
        share = 1 / scale[:, None]
        weights, residues = self.weights[rows] * share, self.residues[rows] * share
        return Modes(self.poles[rows], weights, residues, self.have_neighbours[rows])

    def tail(self, count: int) -> Modes:
        """(D - p_1) ... (D - p_count) x, over the slowest exponential left, so that it lasts."""
        poles = self.poles[:, count:]
        removed = poles[:, None] - self.poles[:, :count, None]
        residues = self.residues[:, count:] * removed.prod(axis=1)
        slowest = poles.real.max(axis=1, keepdims=True)
        # Of the shifted poles one is zero, so that no gap would be small relative to them.
        near = _have_neighbours(poles)
        return Modes(poles - slowest, self.weights[:, count:], residues, near)

    def at(self, time: Array, loop: Index) -> Array:
        """Values of the sums at times [s], which are real if complex poles are paired.

        `loop` is the index of the loop for each time, of a shape that broadcasts with `time`.
        """
        return np.asarray(self.complex_at(time, loop).real)

    def complex_at(self, time: Array, loop: Index) -> Complex:
        """Values of sums that may contain only one pole of a pair; arguments as for `at`."""
        # One pole after the other: a sum over the last axis of an array takes four times as long.
        with np.errstate(invalid="ignore"):
            parts = [
                residue[loop] * np.exp(pole[loop] * time)
                for pole, residue in zip(self.poles.T, self.residues.T, strict=True)
            ]
            total = np.asarray(sum(parts[1:], parts[0]))
        nearby = np.broadcast_to(self.have_neighbours[loop], total.shape)
        if nearby.any():
            rows = np.broadcast_to(loop, total.shape)[nearby]
            times = np.broadcast_to(time, total.shape)[nearby]
            poles, weights = self.poles[rows], self.weights[rows]
            total[nearby] = sum(
                weights[:, k] * _divided_difference(poles[:, : k + 1], times)
                for k in range(poles.shape[1])
            )
        return total


def _have_neighbours(poles: Complex) -> Bool:
    """(n_loop,) true if two poles of a loop are too close for partial fractions."""
    gaps = np.abs(poles[:, :, None] - poles[:, None, :])
    size = np.maximum(np.abs(poles)[:, :, None], np.abs(poles)[:, None, :])
    apart = (gaps > _APART * size) | np.eye(poles.shape[1], dtype=bool)
    return np.asarray(~apart.all(axis=(1, 2)))


def bound_at(modes: Modes, time: Array, loop: Index) -> Array:
    """Smaller of the two bounds of |x| of stable modes from times (n_time,) on [s].

    `loop` (n_time,) is the index of the loop for each time.
    """
    modal = np.sum(
        _modal_weights(modes)[loop] * np.exp(modes.poles.real[loop] * time[:, None]), axis=1
    )
    slowest = modes.poles.real[loop].max(axis=1)
    newton = _polynomial(np.abs(modes.weights[loop]), time) * np.exp(slowest * time)
    # Newton's bound may rise up to this time; it bounds no later value before.
    falls = time * -slowest >= modes.poles.shape[1] - 1
    return np.asarray(np.where(falls, np.minimum(modal, newton), modal))


def time_below(modes: Modes, level: float) -> Array:
    """Time (n_loop,) [s] after which |x| of stable modes stays below a level < |x(0)|."""
    slowest = modes.poles.real.max(axis=1)
    newton = _newton_time(np.abs(modes.weights), slowest, level)
    weights = _modal_weights(modes)
    # One exponential at the slowest rate bounds the modal sum; its crossing ends the bracket.
    total = np.log(np.maximum(weights.sum(axis=1) / level, 1.0))
    latest = np.maximum(total, 1.0) / -slowest * (1 + _ROUNDING)

    def excess(time: Array, loop: Index) -> Array:
        exponents = modes.poles.real[loop] * time[..., None]
        largest = exponents.max(axis=-1)
        rest = np.sum(weights[loop] * np.exp(exponents - largest[..., None]), axis=-1)
        return np.asarray(np.log(rest / level) + largest)

    found = root(excess, (np.zeros_like(latest), latest), (np.arange(latest.size),))
    modal = np.where(np.isfinite(found), found, latest)
    return np.asarray(np.minimum(modal, newton) * (1 + _ROUNDING))


def _modal_weights(modes: Modes) -> Array:
    return np.nan_to_num(np.abs(modes.residues), nan=_LARGEST_WEIGHT).clip(max=_LARGEST_WEIGHT)


def _polynomial(weights: Array, time: Array) -> Array:
    """|a_1| + |a_2| t + |a_3| t^2 / 2 + ..., by Horner's rule."""
    total: Array = np.zeros_like(time)
    for k in range(weights.shape[1], 0, -1):
        total = np.asarray(weights[:, k - 1] + total * time / k)
    return total


def _newton_time(weights: Array, slowest: Array, level: float) -> Array:
    """Largest fixed point of t = log(polynomial(t) / level) / -slowest, approached from above.

    From t = (n_pole - 1) / -slowest the right-hand side grows more slowly than t, so each iterate
    stays above the fixed point: stopping early only loosens the bound.
    """

    def later(time: Array) -> Array:
        return np.log(np.maximum(_polynomial(weights, time) / level, 1.0)) / -slowest

    time: Array = max(1, weights.shape[1] - 1) / -slowest
    while np.any(short := later(time) > time):
        time = np.where(short, 2 * time, time)
    for _ in range(_FIXED_POINT_STEPS):
        time = later(time)
    return time


def _divided_difference(poles: Complex, time: Array) -> Complex:
    """f[p_1, ..., p_k] by recursion on the most distant pair, or by a series if all are close.

    Poles (n_time, k) [1/s], times (n_time,) [s].
    """
    count = poles.shape[1]
    if count == 1:
        return np.asarray(np.exp(poles[:, 0] * time))
    if count == 2:
        return _pair(poles[:, 0], poles[:, 1], time)
    gaps = np.abs(poles[:, :, None] - poles[:, None, :]).reshape(-1, count**2)
    first, last = np.divmod(gaps.argmax(axis=1)[:, None], count)
    number = np.arange(count)
    order = np.argsort(1 * (number == last) - (number == first), axis=1, kind="stable")
    poles = np.take_along_axis(poles, order, axis=1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        upper, lower = (_divided_difference(p, time) for p in (poles[:, :-1], poles[:, 1:]))
        apart = (upper - lower) / (poles[:, 0] - poles[:, -1])
    together = gaps.max(axis=1) * time < 1
    return np.where(together, _series(poles, time * together), apart)


def _pair(p: Complex, q: Complex, time: Array) -> Complex:
    """f[p, q]; the slower exponential is factored out, so that nothing overflows."""
    slow, fast = np.where(p.real >= q.real, p, q), np.where(p.real >= q.real, q, p)
    z = (fast - slow) * time
    # Complex division overflows on subnormal numbers, where the quotient is 1 to all digits.
    is_zero = np.abs(z) < _SMALLEST_GAP
    ratio = np.where(is_zero, 1.0, np.expm1(z) / np.where(is_zero, 1.0, z))
    return np.asarray(np.exp(slow * time) * time * ratio)


def _series(poles: Complex, time: Array) -> Complex:
    """f[p_1, ..., p_n] = t^(n-1) exp(m t) sum h_k / (k + n - 1)!, with m the mean of the poles.

    h_k is the complete homogeneous symmetric polynomial of degree k of z_i = (p_i - m) t; Newton's
    recursion gives it from the elementary ones e_i: h_k = e_1 h_(k-1) - e_2 h_(k-2) + ...
    """
    mean = poles.mean(axis=1)
    count = poles.shape[1]
    elementary = [np.ones_like(mean)] + [np.zeros_like(mean)] * count
    for z in ((poles - mean[:, None]) * time[:, None]).T:
        for k in range(count, 0, -1):
            elementary[k] = elementary[k] + z * elementary[k - 1]
    complete = [elementary[0]]
    total = complete[0] / factorial(count - 1)
    for k in range(1, _SERIES_TERMS):
        terms = range(1, min(k, count) + 1)
        complete.append(sum((-1) ** (i - 1) * elementary[i] * complete[k - i] for i in terms))
        total = total + complete[k] / factorial(k + count - 1)
    return np.asarray(time ** (count - 1) * np.exp(mean * time) * total)
