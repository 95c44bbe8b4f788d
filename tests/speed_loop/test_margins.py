"""Stability margins and bandwidth, compared with definitions and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from identification.speed_loop.loop import Loop
from identification.speed_loop.margins import bandwidth, delayed_margins, stability_margins
from identification.speed_loop.roots import monic_roots

GAINS = st.floats(-2, 3).map(lambda exponent: 10.0**exponent)


def loop_of(numerator: list[float], open_denominator: list[float]) -> Loop:
    """Loop with numerator N and denominator D."""
    return Loop(np.array([numerator], dtype=float), np.array([open_denominator], dtype=float))


def open_gain(loop: Loop, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """L(j omega), evaluated by numpy's polynomials."""
    s = 1j * frequency
    return np.asarray(np.polyval(loop.numerator[0], s) / np.polyval(loop.open_denominator[0], s))


def test_gain_margin_is_the_distance_to_the_stability_limit() -> None:
    """Routh: K / (s (s + 1)(s + 2)) has the limit K = 6, so K = 2 has a margin of a factor of 3."""
    margins = stability_margins(loop_of([0, 0, 2], [1, 3, 2, 0]))

    assert margins.gain_db[0] == pytest.approx(20 * np.log10(3), rel=1e-12)


def test_margins_of_an_unstable_loop_are_negative() -> None:
    """The same loop with K = 12 reaches the stability limit when the gain is halved."""
    margins = stability_margins(loop_of([0, 0, 12], [1, 3, 2, 0]))

    assert margins.gain_db[0] == pytest.approx(-20 * np.log10(2), rel=1e-12)
    assert margins.phase_deg[0] < 0


@pytest.mark.parametrize("damping", [0.05, 0.3, 0.7, 1.5])
def test_phase_margin_of_the_textbook_servo(damping: float) -> None:
    """w^2 / (s (s + 2 zeta w)): atan(2 zeta / sqrt(sqrt(1 + 4 zeta^4) - 2 zeta^2))."""
    inner = np.sqrt(np.sqrt(1 + 4 * damping**4) - 2 * damping**2)

    margins = stability_margins(loop_of([0, 9.0], [1, 6 * damping, 0]))

    assert margins.phase_deg[0] == pytest.approx(np.degrees(np.arctan(2 * damping / inner)))
    assert margins.gain_db[0] == np.inf


def test_loop_gain_below_one_everywhere_has_an_infinite_phase_margin() -> None:
    """For 0.5 / ((s + 1)(s + 1)), |L| starts at 0.5 and falls."""
    margins = stability_margins(loop_of([0, 0.5], [1, 2, 1]))

    assert margins.phase_deg[0] == np.inf


def test_negative_static_gain_has_a_finite_gain_margin() -> None:
    """-0.5 / ((s + 1)(s + 1)) becomes unstable, without oscillation, when the gain doubles."""
    margins = stability_margins(loop_of([0, -0.5], [1, 2, 1]))

    assert margins.gain_db[0] == pytest.approx(20 * np.log10(2))


@st.composite
def open_loops(draw: st.DrawFn) -> Loop:
    """Motors with any two poles under a P, PD, PI or PID controller with positive gains."""
    poles = [-draw(GAINS), -draw(GAINS)]
    kp, ki, kd = (draw(GAINS) for _ in range(3))
    kd *= draw(st.sampled_from([0, 0.01]))
    scale = poles[0] * poles[1]
    denominator = list(np.poly(poles))
    if draw(st.booleans()):
        return loop_of([kd * scale, kp * scale, ki * scale], [*denominator, 0.0])
    return loop_of([kd * scale, kp * scale], denominator)


def closed_poles(loop: Loop, factor: complex) -> NDArray[np.complex128]:
    """Closed-loop poles with the loop gain times `factor`, by numpy's roots."""
    polynomial = loop.open_denominator[0].astype(complex)
    polynomial[1:] += factor * loop.numerator[0]
    return np.asarray(np.roots(polynomial), dtype=complex)


@settings(deadline=None, max_examples=100)
@given(open_loops())
def test_a_finite_margin_puts_a_pole_on_the_imaginary_axis(loop: Loop) -> None:
    """Definition of both margins: with that gain or lag, a pole is on the imaginary axis."""
    margins = stability_margins(loop)
    gain = 10 ** (margins.gain_db / 20)
    lag = np.radians(margins.phase_deg[np.isfinite(margins.phase_deg)])

    for factor in [*gain[np.isfinite(gain)], *np.exp(-1j * lag)]:
        poles = closed_poles(loop, factor)
        assert np.min(np.abs(poles.real) / np.abs(poles)) < 1e-6


@settings(deadline=None, max_examples=100)
@given(open_loops())
def test_no_crossing_is_missed(loop: Loop) -> None:
    """Crossings on a grid of 20,001 frequencies never give a smaller margin than the roots."""
    margins = stability_margins(loop)
    gain = open_gain(loop, np.geomspace(1e-5, 1e7, 20_001))
    # A static gain of one touches the limit at frequency zero; rounding makes it a crossing.
    gain = gain[np.abs(np.abs(gain) - 1) > 1e-9]

    crosses_one = np.flatnonzero(np.diff(np.sign(np.abs(gain) - 1)))
    crosses_axis = np.flatnonzero((np.diff(np.sign(gain.imag)) != 0) & (gain.real[1:] < 0))

    if crosses_one.size:
        seen = np.min(np.abs(np.angle(-gain[crosses_one], deg=True)))
        assert abs(margins.phase_deg[0]) <= seen + 1.0
    if crosses_axis.size:
        assert (
            abs(margins.gain_db[0]) <= np.min(np.abs(20 * np.log10(-gain.real[crosses_axis]))) + 1
        )


@settings(deadline=None, max_examples=100)
@given(open_loops())
def test_signs_of_the_margins_agree_with_stability(loop: Loop) -> None:
    """For a stable motor and positive gains, a negative phase margin means an unstable loop."""
    margins = stability_margins(loop)
    closed = monic_roots(loop.closed_denominator)

    if abs(margins.phase_deg[0]) > 1e-6 and abs(margins.gain_db[0]) > 1e-6:
        assert bool((closed.real < 0).all()) == bool(margins.phase_deg[0] > 0)


@settings(deadline=None, max_examples=100)
@given(open_loops())
def test_a_vanishing_delay_leaves_the_phase_margin_of_a_stable_loop(loop: Loop) -> None:
    """A crossing at which the loop leads needs a lag of more than 180 degrees, not a lead."""
    margins = stability_margins(loop)
    delayed = delayed_margins(loop, 1e-12, 1e12).phase_deg[0]

    if margins.phase_deg[0] > 1e-3:
        assert delayed >= margins.phase_deg[0] - 1e-3
    else:
        assert delayed <= 1e-3


def test_lead_of_a_derivative_is_not_a_missing_margin() -> None:
    """(5000 s^2 + 20 s + 5) / (s (s + 1)(s + 1000)) leads by 77 degrees where its gain rises.

    The reference unwraps the phase on a grid from low frequency on.
    """
    loop = loop_of([5000.0, 20.0, 5.0], [1.0, 1001.0, 1000.0, 0.0])
    frequency = np.geomspace(1e-3, 1e4, 200_001)
    gain = open_gain(loop, frequency) * np.exp(-1e-4j * frequency)
    crossings = np.flatnonzero(np.diff(np.sign(np.abs(gain) - 1)))
    lags = 180 + np.unwrap(np.angle(gain))[crossings] * 180 / np.pi

    found = delayed_margins(loop, 1e-4, 1e5).phase_deg

    assert found[0] == pytest.approx(lags.min(), abs=0.01)


@settings(deadline=None, max_examples=100)
@given(open_loops())
def test_closed_loop_is_three_decibels_down_at_the_bandwidth_and_not_before(loop: Loop) -> None:
    """Reference: |T| evaluated at the bandwidth and on a grid below it."""
    frequency = bandwidth(loop)[0]
    s = 1j * np.append(np.geomspace(1e-6, 1 - 1e-9, 2001), 1.0) * frequency

    closed = np.polyval(loop.numerator[0], s) / np.polyval(loop.closed_denominator[0], s)

    relative = 20 * np.log10(np.abs(closed) / loop.final_value[0])
    assert relative[-1] == pytest.approx(-3, abs=1e-6)
    assert (relative[:-1] > -3 - 1e-6).all()


@pytest.mark.parametrize("damping", [0.1, 0.5, 1.0, 3.0])
def test_bandwidth_of_the_textbook_loop(damping: float) -> None:
    """Closed form: w sqrt(1 - 2 z^2 + sqrt((1 - 2 z^2)^2 - 1 + k)), with k = 10^0.3 for 3 dB."""
    part = 1 - 2 * damping**2
    expected = 3 * np.sqrt(part + np.sqrt(part**2 - 1 + 10**0.3))

    found = bandwidth(loop_of([0, 9.0], [1, 6 * damping, 0]))

    assert found[0] == pytest.approx(expected, rel=1e-10)


def test_loop_without_static_gain_has_no_bandwidth() -> None:
    """With derivative action only, the final speed is 0, and the 3 dB level is undefined."""
    assert np.isnan(bandwidth(loop_of([1.0, 0.0], [1, 2, 1]))[0])
