"""Polynomials of the loop, compared with the circuit equations."""

from __future__ import annotations

import numpy as np
import pytest

from identification.errors import OptionError
from identification.speed_loop.controller import parse_controller
from identification.speed_loop.loop import close, motor_draws, plant
from identification.speed_loop.step_response import StepResponse

PAPER = {
    "Ra25": 0.59,
    "alpha_Ra": 0.004,
    "Kt25": 0.071,
    "alpha_Kt": -0.002,
    "J": 0.01,
    "b": 0.1,
    "L": 0.5,
}


@pytest.mark.parametrize(("temperature", "ra", "kt"), [(25.0, 0.59, 0.071), (125.0, 0.826, 0.0568)])
def test_plant_solves_the_two_balances_at_a_frequency(
    temperature: float, ra: float, kt: float
) -> None:
    """Reference: complex balances of the circuit at 3 rad/s, solved as a linear system."""
    s = 3j
    balances = np.array([[0.5 * s + ra, kt], [-kt, 0.01 * s + 0.1]])
    expected = np.linalg.solve(balances, [1, 0])[1]

    gain, denominator = plant(motor_draws(PAPER, [temperature]), temperature)

    assert gain[0] / np.polyval(denominator[0], s) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("temperature", [25.0, 125.0])
@pytest.mark.parametrize(
    ("text", "gains"),
    [("P:3", (3, 0, 0)), ("PI:3,2", (3, 2, 0)), ("PID:3,2,0.1", (3, 2, 0.1)),
     ("PID:3,0,0.1", (3, 0, 0.1))],
)  # fmt: skip
def test_closed_loop_is_the_open_one_over_one_plus_it(
    text: str, gains: tuple[float, float, float], temperature: float
) -> None:
    """T = C G / (1 + C G), with each factor evaluated separately at 2 + 3j."""
    s, controller = 2 + 3j, parse_controller(text)
    motors = motor_draws(PAPER, [temperature])
    gain, denominator = plant(motors, temperature)
    action = gains[0] + gains[1] / s + gains[2] * s
    forward = action * gain[0] / np.polyval(denominator[0], s)

    loop = close(motors, [temperature], controller)

    closed = np.polyval(loop.numerator[0], s) / np.polyval(loop.closed_denominator[0], s)
    assert closed == pytest.approx(forward / (1 + forward), rel=1e-12)


def test_loops_are_in_the_order_of_the_temperatures() -> None:
    """The draws vary fastest: the loops of one temperature form a block."""
    motors = motor_draws(PAPER | {"J": np.array([0.01, 0.02, 0.03])}, [25.0, 125.0])
    controller = parse_controller("P:1")

    both = close(motors, [25.0, 125.0], controller)

    hot = close(motors, [125.0], controller)
    assert both.numerator.shape == (6, 2)
    np.testing.assert_array_equal(both.open_denominator[3:], hot.open_denominator)


def test_integral_of_zero_adds_no_pole() -> None:
    """A PID with ki = kd = 0 is a P controller, because its integrator would cancel."""
    motors = motor_draws(PAPER, [25.0])

    pid, p = (close(motors, [25.0], parse_controller(text)) for text in ("PID:2,0,0", "P:2"))

    np.testing.assert_array_equal(pid.closed_denominator, p.closed_denominator)


def test_motor_without_inductance_is_the_limit_of_a_small_one() -> None:
    """With L = 0 and P = 1, the pole is (R b + Kt^2 + Kt) / (R J) in closed form."""
    pole = (0.59 * 0.1 + 0.071**2 + 0.071) / (0.59 * 0.01)

    poles = StepResponse(
        close(motor_draws(PAPER | {"L": 0.0}, [25.0]), [25.0], parse_controller("P:1"))
    ).poles

    assert poles[0, 1].real == pytest.approx(-pole, rel=1e-7)
    assert poles[0, 0].real < -1e6 * pole


def test_coefficients_may_be_missing_at_25_degrees_only() -> None:
    """At 25 degC the coefficients are multiplied by zero; elsewhere they are required."""
    cold = {name: value for name, value in PAPER.items() if not name.startswith("alpha")}

    assert motor_draws(cold, [25.0])["alpha_Ra"] == 0.0
    with pytest.raises(OptionError, match="no value for alpha_Ra, alpha_Kt; expected Ra25"):
        motor_draws(cold, [25.0, 125.0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"J": 0.0}, r"J is 0 kg m\^2; expected a finite number above 0"),
        ({"Ra25": -0.59}, "Ra25 is -0.59 ohm; expected a finite number above 0"),
        ({"L": -1e-3}, "L is -0.001 H; expected a finite number of at least 0"),
        ({"b": np.nan}, "b is nan N m s/rad; expected a finite number of at least 0"),
        ({"alpha_Kt": np.inf}, "alpha_Kt is inf 1/K; expected a finite number$"),
        ({"b": np.ones(2), "J": np.ones(3)}, r"b has shape \(2,\); expected .* 3 draws"),
        ({"b": np.ones((2, 2))}, r"b has shape \(2, 2\)"),
        ({"b": np.array([])}, r"b has shape \(0,\)"),
    ],
)
def test_values_that_no_motor_has_are_refused(change: dict[str, object], message: str) -> None:
    """Sign, size or shape of each value is physically impossible or inconsistent."""
    with pytest.raises(OptionError, match=message):
        motor_draws(PAPER | change, [25.0])  # type: ignore[arg-type]
