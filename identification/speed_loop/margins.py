"""Gain margin, phase margin and bandwidth from the roots of polynomials.

On the imaginary axis, the squared modulus and the phase condition of a rational function are
polynomials in x = omega^2.  Their positive real roots are all crossover frequencies, so none is
missed between the points of a frequency grid.

A delay tau leaves the gain crossovers, and each phase margin falls by exactly omega tau.  The phase
crossovers are then roots of a transcendental equation; they are bracketed on a logarithmic
frequency grid up to the Nyquist frequency and refined by bisection.

Source: Astrom and Wittenmark, Computer-Controlled Systems, 1997, section 1.3 (hold as a delay of
half a sample time).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.arrays import Array, Complex
from identification.speed_loop.loop import Loop
from identification.speed_loop.roots import monic_roots

__all__ = ["Margins", "bandwidth", "delayed_margins", "stability_margins"]

_BANDWIDTH_DROP_DB: Final = 3.0
_DECADES: Final = 5.0
_POINTS: Final = 160
_HALVINGS: Final = 30
_AT_ONCE: Final = 2000


@dataclass(frozen=True)
class Margins:
    """Distances of a loop from the stability limit; each (n_loop,)."""

    gain_db: Array
    """Gain margin: the factor on the loop gain that reaches the stability limit [dB]. Positive: the
    gain may rise by it.  Negative: the limit is at a lower gain; the gain of an unstable loop has
    to fall by it.  Of several limits the nearest counts.  Infinite if no gain reaches the limit."""
    phase_deg: Array
    """Phase margin: the lag that reaches the stability limit, the smallest in magnitude over all
    gain crossover frequencies, from -180 to 180 [deg].  Negative for an unstable loop.  Infinite if
    the loop gain is below 1 at all frequencies."""


def stability_margins(loop: Loop) -> Margins:
    """Gain and phase margin of each open loop N / D."""
    with np.errstate(divide="ignore", invalid="ignore"):
        phase = np.angle(-_open_loop(loop, _gain_crossovers(loop)), deg=True)
        return Margins(_gain_margin(loop), _nearest_to_zero(phase))


def delayed_margins(loop: Loop, delay: float, highest: float) -> Margins:
    """Margins of each open loop N / D with a delay [s]; the smallest over all crossovers.

    A sampled controller delays by its computing time and half a sample time of the hold.  `highest`
    is the largest frequency of a phase crossover, the Nyquist frequency [rad/s].
    """
    with np.errstate(all="ignore"):
        frequency = _gain_crossovers(loop)
        lag = 180.0 + _phase(loop, frequency) - np.rad2deg(frequency * delay)
        phase = np.where(np.isnan(lag), np.inf, lag).min(axis=1, initial=np.inf)
        blocks = [slice(k, k + _AT_ONCE) for k in range(0, phase.size, _AT_ONCE)]
        some = [Loop(loop.numerator[rows], loop.open_denominator[rows]) for rows in blocks]
        gain = np.concatenate([_delayed_gain_margin(one, delay, highest) for one in some])
    return Margins(gain, phase)


def bandwidth(loop: Loop) -> Array:
    """Lowest frequency at which the closed-loop gain is 3 dB below the DC gain [rad/s].

    NaN if the DC gain is zero or not finite; meaningful for stable loops only. 3 dB is the factor
    10^(3/20), not the root of 2.
    """
    closed = _squared_modulus(loop.closed_denominator)
    with np.errstate(divide="ignore", invalid="ignore"):
        wanted = 10 ** (_BANDWIDTH_DROP_DB / 10) / loop.final_value**2
        has_value = np.isfinite(wanted)
        numerator = _squared_modulus(loop.closed_numerator)
        closed[:, 1:] -= np.where(has_value, wanted, 0.0)[:, None] * numerator
    return np.where(has_value, np.nanmin(_positive(closed), axis=1, initial=np.inf), np.nan)


def _open_loop(loop: Loop, frequency: Array) -> Complex:
    """L(j omega) of each loop at its own frequencies, (n_loop, n_frequency) [rad/s]."""
    s = 1j * frequency
    value = [np.zeros_like(s), np.zeros_like(s)]
    for k, polynomial in enumerate((loop.numerator, loop.open_denominator)):
        for coefficient in polynomial.T:
            value[k] = value[k] * s + coefficient[:, None]
    return np.asarray(value[0] / value[1], dtype=np.complex128)


def _phase(loop: Loop, frequency: Array) -> Array:
    """Phase of L(j omega), continuous from frequency zero, (n_loop, n_frequency) [deg].

    It is -180 degrees at frequency zero if the static gain is negative.  A phase modulo 360 degrees
    would take a loop that leads for one that lags by more than 180 degrees.
    """
    numerator, denominator = (
        _turn(part, frequency) for part in (loop.numerator, loop.open_denominator)
    )
    return np.asarray(np.rad2deg(numerator - denominator))


def _turn(polynomials: Array, frequency: Array) -> Array:
    """Angle of each P(j omega), continuous from that of P(j 0), (n_loop, n_frequency) [rad].

    Each root adds a continuous angle; that of P(j 0) is 0, -pi if P(0) is negative, and pi / 2 for
    each root at zero.
    """
    angle = np.zeros(frequency.shape)
    leading = (polynomials != 0).argmax(axis=1)
    for first in np.unique(leading[leading < polynomials.shape[1] - 1]):
        rows = leading == first
        some = polynomials[rows, first:]
        for root in monic_roots(some / some[:, :1]).T[:, :, None]:
            side = np.where(root.real > 0, -1.0, 1.0)
            angle[rows] += side * np.arctan2(frequency[rows] - root.imag, np.abs(root.real))
    rising = polynomials[:, ::-1]
    static = rising[np.arange(len(rising)), (rising != 0).argmax(axis=1)]
    return angle - np.where(static < 0, np.pi, 0.0)[:, None]


def _gain_crossovers(loop: Loop) -> Array:
    """Frequencies at which the open-loop gain is 1, (n_loop, n_root), padded with NaN [rad/s]."""
    crossing = _squared_modulus(loop.open_denominator)
    crossing[:, 1:] -= _squared_modulus(loop.numerator)
    return _positive(crossing)


def _gain_margin(loop: Loop) -> Array:
    """Gain margin at the phase crossovers, where Im N conj(D) = 0 and Re N conj(D) < 0.

    The imaginary part is omega times a polynomial in x of degree n_pole - 1 at most.
    """
    numerator_even, numerator_odd = _parts(loop.numerator)
    even, odd = _parts(loop.open_denominator)
    phase = np.zeros_like(loop.numerator)
    for sign, product in ((1, _product(numerator_odd, even)), (-1, _product(numerator_even, odd))):
        phase[:, : product.shape[1]] += sign * product
    # Without an integrator the DC loop gain is finite and may be negative.
    at_rest = np.where(loop.open_denominator[:, -1:] == 0, np.nan, 0.0)
    crossings = np.concatenate([at_rest, _positive(phase[:, ::-1])], axis=1)
    value = _open_loop(loop, crossings).real
    return _nearest_to_zero(np.where(value < 0, -20 * np.log10(-value), np.nan))


def _delayed_gain_margin(loop: Loop, delay: float, highest: float) -> Array:
    grid = np.geomspace(highest * 10**-_DECADES, highest, _POINTS)
    count = loop.numerator.shape[0]
    value = _open_loop(loop, np.broadcast_to(grid, (count, _POINTS))) * np.exp(-1j * grid * delay)
    is_above = value.imag > 0
    # The phase passes -180 degrees where the imaginary part changes its sign left of the origin.
    turns = (is_above[:, :-1] != is_above[:, 1:]) & (value.real[:, 1:] < 0)
    rows, first = np.nonzero(turns)
    some = Loop(loop.numerator[rows], loop.open_denominator[rows])
    low, high, begin = grid[first], grid[first + 1], is_above[rows, first]
    for _ in range(_HALVINGS):
        middle = np.sqrt(low * high)
        at = _open_loop(some, middle[:, None])[:, 0] * np.exp(-1j * middle * delay)
        is_before = (at.imag > 0) == begin
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    found = _open_loop(some, high[:, None])[:, 0]
    margin = np.full(count, np.inf)
    np.minimum.at(margin, rows, -20 * np.log10(np.abs(found)))
    return margin


def _nearest_to_zero(candidates: Array) -> Array:
    """Entry of smallest magnitude in each row; infinite if the row has none."""
    known = np.where(np.isnan(candidates), np.inf, candidates)
    return np.asarray(known[np.arange(known.shape[0]), np.abs(known).argmin(axis=1)])


def _positive(squared: Array) -> Array:
    """Frequencies omega > 0 whose square is a root of a polynomial, (n_loop, n_root), falling.

    The polynomials (n_loop, n_root + 1) are in falling powers, leading coefficients may be 0; NaN
    pads missing roots.
    """
    frequencies = np.full((squared.shape[0], squared.shape[1] - 1), np.nan)
    leading = (squared != 0).argmax(axis=1)
    for first in np.unique(leading[leading < squared.shape[1] - 1]):
        rows = leading == first
        roots = monic_roots(squared[rows, first:] / squared[rows, first, None])
        usable = (roots.imag == 0) & (roots.real > 0)
        frequencies[rows, first:] = np.sqrt(np.where(usable, roots.real, np.nan))
    return -np.sort(-frequencies, axis=1)


def _parts(falling: Array) -> tuple[Array, Array]:
    """Even and odd part of P(j omega) = even(x) + j omega odd(x), rising powers of x."""
    even, odd = falling[:, ::-2], falling[:, -2::-2]
    signs = (-1.0) ** np.arange(even.shape[1])
    return even * signs, odd * signs[: odd.shape[1]]


def _product(left: Array, right: Array) -> Array:
    """Product of polynomials in rising powers."""
    product = np.zeros((left.shape[0], left.shape[1] + right.shape[1] - 1))
    for k in range(left.shape[1]):
        product[:, k : k + right.shape[1]] += left[:, k, None] * right
    return product


def _squared_modulus(falling: Array) -> Array:
    """|P(j omega)|^2 as a polynomial in x, falling powers, of the degree that P has in s."""
    even, odd = _parts(falling)
    rising = np.zeros_like(falling)
    for first, part in ((0, _product(even, even)), (1, _product(odd, odd))):
        rising[:, first : first + part.shape[1]] += part
    return rising[:, ::-1]
