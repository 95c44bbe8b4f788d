"""Gain margin, phase margin and bandwidth from the roots of polynomials.

On the imaginary axis, the squared modulus and the phase condition of a rational function are
polynomials in x = omega^2.  Their positive real roots are all crossover frequencies, so none is
missed between the points of a frequency grid.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.feedback.loop import Loop
from identification.feedback.roots import monic_roots

__all__ = ["Margins", "bandwidth", "stability_margins"]

Array = NDArray[np.float64]

_BANDWIDTH_DROP_DB: Final = 3.0


@dataclass(frozen=True)
class Margins:
    """Distances of a loop from the stability limit; each (n_loop,).

    Args:
        gain_db: Gain margin: the factor on the loop gain that reaches the stability limit [dB].
            Positive: the gain may rise by it.  Negative: the limit is at a lower gain; the gain of
            an unstable loop has to fall by it.  Of several limits the nearest counts.  Infinite if
            no gain reaches the limit.
        phase_deg: Phase margin: the lag that reaches the stability limit, the smallest in magnitude
            over all gain crossover frequencies, from -180 to 180 [deg].  Negative for an unstable
            loop.  Infinite if the loop gain is below 1 at all frequencies.
    """

    gain_db: Array
    phase_deg: Array


def stability_margins(loop: Loop) -> Margins:
    """Gain and phase margin of each loop.

    Args:
        loop: Open loops N / D.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return Margins(_gain_margin(loop), _phase_margin(loop))


def bandwidth(loop: Loop) -> Array:
    """Lowest frequency at which the closed-loop gain is 3 dB below the DC gain [rad/s].

    NaN if the DC gain is zero or not finite.  3 dB is the factor 10^(3/20), not the root of 2.

    Args:
        loop: The loops; the bandwidth is meaningful for stable ones only.
    """
    closed = _squared_modulus(loop.closed_denominator)
    with np.errstate(divide="ignore", invalid="ignore"):
        wanted = 10 ** (_BANDWIDTH_DROP_DB / 10) / loop.final_value**2
        has_value = np.isfinite(wanted)
        closed[:, 1:] -= np.where(has_value, wanted, 0.0)[:, None] * _numerator_modulus(loop)
    return np.where(has_value, np.nanmin(_positive(closed), axis=1, initial=np.inf), np.nan)


def _phase_margin(loop: Loop) -> Array:
    crossing = _squared_modulus(loop.open_denominator)
    crossing[:, 1:] -= _numerator_modulus(loop)
    frequency = _positive(crossing)
    lead = np.angle(-_open_loop(loop, frequency), deg=True)
    margin = _nearest_to_zero(lead)
    return np.where(np.isnan(margin), np.inf, margin)


def _gain_margin(loop: Loop) -> Array:
    """Gain margin at the phase crossovers, where Im N conj(D) = 0 and Re N conj(D) < 0.

    The imaginary part is omega times a quadratic in x.
    """
    numerator_even, numerator_odd = _parts(loop.numerator)
    even, odd = _parts(loop.open_denominator)
    phase = _product(numerator_odd, even) - _product(numerator_even, odd)
    c, b, a = phase.T
    root = np.sqrt(b**2 - 4 * a * c)
    far = -(b + np.copysign(root, b)) / 2
    crossings = np.sqrt(np.stack([far / a, c / far], axis=1))
    crossings[~np.isfinite(crossings) | (crossings <= 0)] = np.nan
    if loop.numerator.shape[1] == 2:
        # Without an integrator the DC loop gain is finite and may be negative, so omega = 0 is a
        # candidate.
        crossings = np.pad(crossings, ((0, 0), (1, 0)))
    value = _open_loop(loop, crossings).real
    margin = _nearest_to_zero(np.where(value < 0, -20 * np.log10(-value), np.nan))
    return np.where(np.isnan(margin), np.inf, margin)


def _nearest_to_zero(candidates: Array) -> Array:
    """Entry of smallest magnitude in each row; NaN if the row has none."""
    size = np.where(np.isnan(candidates), np.inf, np.abs(candidates))
    rows = np.arange(candidates.shape[0])
    return np.asarray(candidates[rows, size.argmin(axis=1)])


def _open_loop(loop: Loop, frequency: Array) -> NDArray[np.complex128]:
    """L(j omega) of each loop at its own frequencies, (n_loop, n_frequency) [rad/s]."""
    s = 1j * frequency
    value = [np.zeros_like(s), np.zeros_like(s)]
    for k, polynomial in enumerate((loop.numerator, loop.open_denominator)):
        for coefficient in polynomial.T:
            value[k] = value[k] * s + coefficient[:, None]
    return np.asarray(value[0] / value[1], dtype=np.complex128)


def _positive(squared: Array) -> Array:
    """Falling frequencies omega > 0 whose square is a root, (n_loop, n_root), padded with NaN."""
    roots = monic_roots(squared)
    usable = (roots.imag == 0) & (roots.real > 0)
    return -np.sort(-np.sqrt(np.where(usable, roots.real, np.nan)), axis=1)


def _parts(falling: Array) -> tuple[Array, Array]:
    """Even and odd part of P(j omega) = even(x) + j omega odd(x), rising powers of x, two each."""
    rising = np.pad(falling[:, ::-1], ((0, 0), (0, 4 - falling.shape[1])))
    signs = np.array([1.0, -1.0])
    return rising[:, 0::2] * signs, rising[:, 1::2] * signs


def _product(left: Array, right: Array) -> Array:
    """Product of two polynomials of two coefficients each, rising powers."""
    middle = left[:, 0] * right[:, 1] + left[:, 1] * right[:, 0]
    return np.stack([left[:, 0] * right[:, 0], middle, left[:, 1] * right[:, 1]], axis=1)


def _squared_modulus(falling: Array) -> Array:
    """|P(j omega)|^2 as a polynomial in x, falling powers, of the degree that P has in s."""
    even, odd = _parts(falling)
    rising = np.pad(_product(even, even), ((0, 0), (0, 1)))
    rising[:, 1:] += _product(odd, odd)
    return rising[:, falling.shape[1] - 1 :: -1]


def _numerator_modulus(loop: Loop) -> Array:
    """|N(j omega)|^2 as a polynomial in x, of one degree less than that of D."""
    return _squared_modulus(loop.numerator)
