"""PI controller by the magnitude optimum: known limits, and the loops that it gives."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.speed_loop import feedback_metrics
from identification.speed_loop.loop import suited_controller

SERVO = {
    "Ra25": 1.1, "alpha_Ra": 0.0039, "Kt25": 0.115, "alpha_Kt": -0.0012,
    "J": 1.2e-4, "b": 6e-5, "L": 2.6e-3,
}  # fmt: skip


def test_the_gains_are_those_of_kessler_for_well_separated_time_constants() -> None:
    """T1 >> T2 gives kp = T1 / (2 K T2) and a reset time of T1, as in textbooks on drives."""
    motor = SERVO | {"J": 0.05, "b": 0.0}
    slow = motor["J"] * motor["Ra25"] / motor["Kt25"] ** 2
    fast = motor["L"] / motor["Ra25"]

    controller = suited_controller(motor, interval=1e-9)

    assert controller is not None
    assert controller.kp == pytest.approx(slow * motor["Kt25"] / (2 * fast), rel=0.01)
    assert controller.kp / controller.ki == pytest.approx(slow, rel=0.01)


@given(
    inertia=st.floats(0.6, 30.0), inductance=st.floats(0.01, 1.0), interval=st.floats(1e-5, 2e-3)
)
def test_the_loop_of_a_damped_motor_is_well_damped(
    inertia: float, inductance: float, interval: float
) -> None:
    """The step overshoots by at most 10 % and ends at the reference; the optimum has 4 %."""
    motor = SERVO | {"J": SERVO["J"] * inertia, "L": SERVO["L"] * inductance}
    controller = suited_controller(motor, interval)
    assert controller is not None

    (entry,) = feedback_metrics(motor, [25.0], [controller])

    assert entry["steady_state"]["median"] == pytest.approx(1.0)
    assert entry["overshoot_percent"]["median"] < 10.0
    assert entry["phase_margin_deg"]["median"] > 45.0


def test_a_motor_that_oscillates_gets_no_controller_by_this_rule() -> None:
    """With an electrical time constant of a hundred mechanical ones the damping is 0.05."""
    motor = SERVO | {"L": 1.0}

    assert suited_controller(motor, interval=1e-4) is None


def test_a_motor_without_inductance_gets_finite_gains() -> None:
    """The delay of the digital controller bounds the gains."""
    controller = suited_controller(SERVO | {"L": 0.0}, interval=1e-3)

    assert controller is not None
    assert np.isfinite([controller.kp, controller.ki]).all()
    assert controller.text == f"PI:{controller.kp:.3g},{controller.ki:.3g}"
