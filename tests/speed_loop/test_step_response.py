"""Step responses: table of the source, textbook closed forms, simulation, and properties."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from identification.speed_loop.controller import parse_controller
from identification.speed_loop.loop import Loop, close, motor_draws
from identification.speed_loop.metrics import StepMetrics
from identification.speed_loop.step_response import (
    StepResponse,
    step_metrics,
)
from tests.speed_loop.loops import loop_with

Array = NDArray[np.float64]

PAPER = {
    "Ra25": 0.59,
    "alpha_Ra": 0.004,
    "Kt25": 0.071,
    "alpha_Kt": -0.002,
    "J": 0.01,
    "b": 0.1,
    "L": 0.5,
}


def metrics(
    numerator: list[float], closed: Sequence[float] | NDArray[np.floating[Any]]
) -> StepMetrics:
    """Characteristics of the step response of one loop."""
    return step_metrics(StepResponse(loop_with(numerator, closed)))


def second_order(damping: float, frequency: float = 1.0) -> StepMetrics:
    """Characteristics of the textbook system w^2 / (s^2 + 2 zeta w s + w^2)."""
    return metrics([0, frequency**2], [1, 2 * damping * frequency, frequency**2])


@pytest.mark.parametrize(("frequency", "rise"), [(50.0, np.log(9.0)), (1e3, np.nan)])
def test_a_rise_that_takes_hundreds_of_oscillations_is_undefined(
    frequency: float, rise: float
) -> None:
    """A real mode of 1 s rises in log 9; a pair with a hundredth of its damping is superimposed.

    The ripple of amplitude 1/frequency shifts the 90 % crossing, where the slope is 0.1, by
    10/frequency. At 1,000 rad/s the rise contains 350 oscillations; at 1e6 rad/s the search took
    minutes.
    """
    closed = np.convolve([1, 1], [1, 0.02, frequency**2])

    found = metrics([0, 0, frequency**2], closed).rise_time[0]

    assert found == pytest.approx(rise, abs=10.0 / frequency, nan_ok=True)


def test_a_loop_with_almost_no_damping_has_no_settling_time() -> None:
    """With damping 1e-17 the search would pass 1e17 oscillations, beyond floating-point phase."""
    found = metrics([0, 1.7e126], [1, 7.4e45, 1.7e126])

    assert np.isnan(found.settling_time[0])
    assert found.overshoot[0] == pytest.approx(100.0)


def test_table_of_the_source_is_reproduced_to_four_digits() -> None:
    """Reference: table 1 of the source at 25 and 125 degC, computed to more digits."""
    motors = motor_draws(PAPER, [25.0, 125.0])

    step = step_metrics(StepResponse(close(motors, [25.0, 125.0], parse_controller("P:1"))))

    assert step.rise_time == pytest.approx([0.7193, 0.7144], abs=5e-5)
    assert step.settling_time == pytest.approx([1.2826, 1.2781], abs=5e-5)
    assert step.steady_state == pytest.approx([0.5258, 0.3982], abs=5e-5)
    assert list(step.overshoot) == [0, 0]
    assert list(step.peak) == list(step.steady_state)
    assert np.isnan(step.peak_time).all()


@pytest.mark.parametrize("damping", [0.001, 0.1, 0.456, 0.7, 0.95])
def test_underdamped_peak_is_the_textbook_one(damping: float) -> None:
    """Overshoot exp(-pi zeta / sqrt(1 - zeta^2)) at pi / (w sqrt(1 - zeta^2))."""
    root = np.sqrt(1 - damping**2)

    step = second_order(damping, frequency=3.0)

    assert step.overshoot[0] == pytest.approx(100 * np.exp(-np.pi * damping / root), rel=1e-12)
    assert step.peak_time[0] == pytest.approx(np.pi / (3 * root), rel=1e-12)
    assert step.peak[0] == pytest.approx(1 + np.exp(-np.pi * damping / root), rel=1e-12)


@pytest.mark.parametrize("damping", [0.001, 0.05, 0.3, 0.8])
def test_underdamped_settling_is_the_last_time_outside_the_band(damping: float) -> None:
    """The decay of the extrema gives the half wave in which the response settles.

    Extremum k has the magnitude exp(-k pi zeta / root); the last one above 2 % has the largest such
    integer k.
    """
    root = np.sqrt(1 - damping**2)
    last = np.floor(np.log(50) * root / (np.pi * damping))

    settling = second_order(damping).settling_time[0] * root / np.pi

    assert last < settling < last + 1


def test_critically_damped_loop_solves_its_own_equation() -> None:
    """Reference: bisection of 1 - (1 + t) exp(-t) for the rise and settling times."""

    def instant(share: float) -> float:
        """Time at which the closed form reaches a fraction of its final value."""
        low, high = 0.0, 50.0
        for _ in range(200):
            middle = (low + high) / 2
            reached = 1 - (1 + middle) * np.exp(-middle) >= share
            low, high = (low, middle) if reached else (middle, high)
        return high

    step = second_order(1.0)

    assert step.rise_time[0] == pytest.approx(instant(0.9) - instant(0.1), rel=1e-12)
    assert step.settling_time[0] == pytest.approx(instant(0.98), rel=1e-12)
    assert step.overshoot[0] == 0


def test_triple_pole_solves_its_own_equation() -> None:
    """The step response of 1 / (s + 1)^3 is 1 - (1 + t + t^2 / 2) exp(-t)."""
    step = metrics([0, 0, 1], [1, 3, 3, 1])

    t = step.settling_time[0]
    assert (1 + t + t**2 / 2) * np.exp(-t) == pytest.approx(0.02, rel=1e-9)
    assert step.overshoot[0] == 0


@pytest.mark.parametrize("rate", [11.988857219675438, 1.7, 0.3])
def test_double_pole_with_a_zero_has_the_peak_of_its_closed_form(rate: float) -> None:
    """With a zero at -rate / 3, y = 1 - (1 - 2 x) exp(-x) for x = rate t, highest at x = 1.5.

    The computed poles differ by rounding, so that partial fractions of them have no digit left.
    """
    loop = loop_with([3 * rate, rate**2], [1.0, 2 * rate, rate**2])

    step = step_metrics(StepResponse(loop))

    assert step.peak_time[0] == pytest.approx(1.5 / rate, rel=1e-6)
    assert step.overshoot[0] == pytest.approx(200 * np.exp(-1.5), rel=1e-9)


def test_fast_second_pole_leaves_the_first_order_times() -> None:
    """For exp(-t), rise log 9 and settling log 50; the other pole is nine decades away."""
    step = metrics([0, 1e9], [1, 1e9 + 1, 1e9])

    assert step.rise_time[0] == pytest.approx(np.log(9), rel=1e-8)
    assert step.settling_time[0] == pytest.approx(np.log(50), rel=1e-8)


def test_overshoot_within_the_band_is_found_after_settling() -> None:
    """A damping of 0.9 gives an overshoot of 0.15 %, which occurs after the settling time."""
    step = second_order(0.9)

    assert step.peak_time[0] > step.settling_time[0]
    assert 0 < step.overshoot[0] < 0.2


def test_late_overshoot_of_three_real_poles_is_found() -> None:
    """Slow zero and slower pole: y = 1 + 0.01 exp(-t/1000) - ..., computed by hand.

    The residues of T = (s/900 + 1) / ((1000 s + 1)... ) let the slow mode decay from above.
    """
    slow, fast, faster = 1e-3, 1.0, 7.0
    zero = 0.99e-3
    closed = np.poly([-slow, -fast, -faster])
    gain = slow * fast * faster / zero

    step = metrics([0, gain, gain * zero], closed)

    # At the peak the fast modes have decayed: 1 + c exp(-t slow) with c = (slow - zero) / zero.
    expected = 100 * (slow - zero) / zero * 7 / 6.993 * 1 / 0.999
    assert step.overshoot[0] == pytest.approx(expected, rel=0.02)
    assert step.rise_time[0] < 5


@pytest.mark.parametrize("ratio", [1e3, 1e7])
def test_slow_creep_after_a_fast_oscillation_is_found_without_a_search(ratio: float) -> None:
    """PI with weak integral action: creep at rate 1, oscillation at `ratio` that decays quickly.

    Only the creep remains at the settling time, which is therefore log(share / 0.02) for its share.
    """
    closed = np.real(np.poly([-1.0, ratio * (-0.2 + 1j), ratio * (-0.2 - 1j)]))
    start = 0.4

    step = metrics([0, start * closed[2], closed[3]], closed)

    residue = 1 - start  # amplitude of the creep, accurate to 1 / ratio
    assert step.settling_time[0] == pytest.approx(np.log(residue / 0.02), rel=5 / ratio)


@pytest.mark.parametrize("scale", [1e-5, 1e-2, 1e3])
@pytest.mark.parametrize(("kp", "ki", "kd"), [(1, 0, 0), (1, 2, 0), (1, 2, 0.1)])
def test_times_scale_with_the_time_constants(kp: float, ki: float, kd: float, scale: float) -> None:
    """With J, L and gains scaled so that s becomes scale * s, every time grows by `scale`."""
    controller = parse_controller(f"PID:{kp},{ki},{kd}")
    slow = motor_draws(PAPER | {"J": 0.01 * scale, "L": 0.5 * scale}, [25.0])
    gains = f"{kp},{ki / scale},{kd * scale}"

    expected = step_metrics(StepResponse(close(motor_draws(PAPER, [25.0]), [25.0], controller)))
    step = step_metrics(StepResponse(close(slow, [25.0], parse_controller(f"PID:{gains}"))))

    assert step.rise_time == pytest.approx(expected.rise_time * scale, rel=1e-9)
    assert step.settling_time == pytest.approx(expected.settling_time * scale, rel=1e-9)
    assert step.overshoot == pytest.approx(expected.overshoot, rel=1e-7)


@pytest.mark.parametrize("text", ["P:0.1", "P:50", "PI:1,2", "PI:20,40", "PID:3,5,0.2"])
@pytest.mark.parametrize("temperature", [-40.0, 25.0, 125.0])
def test_response_and_its_events_agree_with_a_fine_simulation(
    text: str, temperature: float
) -> None:
    """Reference: scipy's state-space step at 100,001 instants, to a step of that grid."""
    loop = close(motor_draws(PAPER, [temperature]), [temperature], parse_controller(text))
    step = step_metrics(StepResponse(loop))
    time = np.linspace(0, 1.5 * np.fmax(step.settling_time, step.peak_time)[0], 100_001)
    _, speed = signal.step(
        (np.trim_zeros(loop.numerator[0], "f"), loop.closed_denominator[0]), T=time
    )
    relative = speed / step.steady_state[0]

    simulated = time[np.argmax(relative >= 0.9)] - time[np.argmax(relative >= 0.1)]

    tolerance = 2 * time[1]
    np.testing.assert_allclose(StepResponse(loop).at(time)[0], speed, atol=1e-9)
    assert step.rise_time[0] == pytest.approx(simulated, abs=tolerance)
    last = np.flatnonzero(np.abs(relative - 1) > 0.02)[-1]
    assert step.settling_time[0] == pytest.approx(time[last], abs=tolerance)
    assert step.overshoot[0] == pytest.approx(max(0, 100 * (relative.max() - 1)), abs=1e-5)


def test_unstable_loop_has_no_times() -> None:
    """By Routh, s^3 + 2 s^2 + 3 s + c is unstable for c > 6."""
    responses = [StepResponse(loop_with([0, 0, c], [1, 2, 3, c])) for c in (5.99, 6.01)]

    border = [step_metrics(response) for response in responses]

    assert [bool(response.is_stable[0]) for response in responses] == [True, False]
    assert np.isfinite(border[0].settling_time[0])
    assert np.isnan([border[1].rise_time, border[1].settling_time, border[1].peak]).all()
    assert np.isnan(border[1].steady_state[0])


def test_negative_final_value_is_approached_like_a_positive_one() -> None:
    """Times equal those of the mirrored response; the peak has the sign of the final value."""
    mirrored = metrics([0, -4.0], [1, 0.4, 4])

    step = metrics([0, 4.0], [1, 0.4, 4])

    assert mirrored.rise_time == pytest.approx(step.rise_time)
    assert mirrored.settling_time == pytest.approx(step.settling_time)
    assert mirrored.peak[0] == pytest.approx(-step.peak[0])


def test_peak_of_two_ringing_pairs_is_that_of_a_fine_grid() -> None:
    """The first maximum lies in the first window, where the slope begins at 0, but for rounding.

    A time scale from 1 to 2 rounds it to either sign in some of 64 loops.
    """
    poles = [-0.4443 + 2.666j, -0.4443 - 2.666j, -9.445 + 28.33j, -9.445 - 28.33j]
    powers = np.linspace(1, 2, 64)[:, None] ** np.arange(5)
    closed, numerator = (
        np.real(np.poly(poles)) * powers,
        np.array([0, 1771.7, 110.5, 9030.8]) * powers[:, 1:],
    )
    denominator = closed - np.pad(numerator, ((0, 0), (1, 0)))
    response = StepResponse(Loop(numerator, denominator))

    step = step_metrics(response)

    highest = response.at(np.linspace(0, 0.2, 10_001)).max(axis=1)
    assert step.peak == pytest.approx(highest, rel=1e-6)


def test_cancelled_pole_makes_no_overshoot_out_of_rounding() -> None:
    """A zero cancels a pole, which leaves 1 / (s + 1)^2 with a monotonic step response."""
    step = metrics([0, 1, 0.3], np.poly([-0.3, -1, -1]))

    assert step.overshoot[0] == 0
    assert np.isnan(step.peak_time[0])
