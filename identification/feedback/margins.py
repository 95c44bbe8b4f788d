"""Gain margin, phase margin and bandwidth, from roots of polynomials.

On the imaginary axis the squared modulus and the phase condition of a rational function are
polynomials in x = omega^2.  Their positive real roots are all crossings there are, so nothing
hides between the points of a frequency grid.
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
    """How far a loop is from the border of stability; each (n_loop,).

    Args:
        gain_db: Factor on the loop gain that leads to the border.  Positive: the gain may rise by
            it; negative: the border lies at a lower gain, which for an unstable loop says by how
            much the gain has to fall.  Of several borders the nearest counts.  Infinite where no
            gain leads there [dB].
        phase_deg: Lag that leads to the border, the smallest over all frequencies where the loop
            gain is 1, from -180 to 180; negative for an unstable loop.  Infinite where the loop
            gain is below 1 everywhere, so that no lag can lead there [deg].
    """

    gain_db: Array
    phase_deg: Array


def stability_margins(loop: Loop) -> Margins:
    """Both margins of each loop.

    Args:
        loop: Open loops N / D.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return Margins(_gain_margin(loop), _phase_margin(loop))


def bandwidth(loop: Loop) -> Array:
    """Lowest frequency at which the closed loop's gain is 3 dB below its gain at rest [rad/s].

    NaN where the gain at rest is zero.  3 dB are a factor of 10^(3/20), not the root of 2.

    Args:
        loop: The loops, of which stable ones have a bandwidth that means something.
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
    """Where Im N conj(D) = 0 and Re N conj(D) < 0; the first is omega times a quadratic in x."""
    numerator_even, numerator_odd = _parts(loop.numerator)
    even, odd = _parts(loop.open_denominator)
    phase = _product(numerator_odd, even) - _product(numerator_even, odd)
    c, b, a = phase.T
    root = np.sqrt(b**2 - 4 * a * c)
    far = -(b + np.copysign(root, b)) / 2
    crossings = np.sqrt(np.stack([far / a, c / far], axis=1))
    crossings[~np.isfinite(crossings) | (crossings <= 0)] = np.nan
    if loop.numerator.shape[1] == 2:
        # Without an integrator the loop gain at rest is finite and may itself be negative.
        crossings = np.pad(crossings, ((0, 0), (1, 0)))
    value = _open_loop(loop, crossings).real
    margin = _nearest_to_zero(np.where(value < 0, -20 * np.log10(-value), np.nan))
    return np.where(np.isnan(margin), np.inf, margin)


def _nearest_to_zero(candidates: Array) -> Array:
    """Of each row the number of the smallest size; NaN where the row has none."""
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
    """Frequencies omega > 0 whose square is a root, (n_loop, n_root), NaN for other roots."""
    roots = monic_roots(squared)
    usable = (roots.imag == 0) & (roots.real > 0)
    return np.sqrt(np.where(usable, roots.real, np.nan))


def _parts(falling: Array) -> tuple[Array, Array]:
    """Even and odd part of P(j omega) = even(x) + j omega odd(x), powers of x rising, two each."""
    rising = np.pad(falling[:, ::-1], ((0, 0), (0, 4 - falling.shape[1])))
    signs = np.array([1.0, -1.0])
    return rising[:, 0::2] * signs, rising[:, 1::2] * signs


def _product(left: Array, right: Array) -> Array:
    """Product of two polynomials of two coefficients each, powers rising."""
    middle = left[:, 0] * right[:, 1] + left[:, 1] * right[:, 0]
    return np.stack([left[:, 0] * right[:, 0], middle, left[:, 1] * right[:, 1]], axis=1)


def _squared_modulus(falling: Array) -> Array:
    """|P(j omega)|^2 in x, powers falling, of the degree that P has in s."""
    even, odd = _parts(falling)
    rising = np.pad(_product(even, even), ((0, 0), (0, 1)))
    rising[:, 1:] += _product(odd, odd)
    return rising[:, falling.shape[1] - 1 :: -1]


def _numerator_modulus(loop: Loop) -> Array:
    """|N(j omega)|^2 in x, without the leading zero that D's would have."""
    return _squared_modulus(loop.numerator)
