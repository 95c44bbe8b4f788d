"""Blame for uncertainty, and limit cycles of the loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.effects.friction import CoulombFriction, StribeckFriction
from identification.model.composite import MotorModel
from identification.speed_loop.controller import parse_controller
from identification.tuning import UncertainMotor, motor_of, parse_specification, tune
from identification.tuning.blame import blamed, known
from identification.tuning.hunting import hunting
from identification.tuning.judge import Judge
from identification.tuning.search import gains_of
from tests.tuning.test_drive import SERVO

DRY = UncertainMotor(
    MotorModel((CoulombFriction(0.4, 0.1), StribeckFriction(0.4, 300.0, 0.1))),
    np.array([*SERVO.values(), 0.02, 0.0, 0.06, 2.0, 2.0])[:, None],
)
"""Servo with 0.02 N m of Coulomb friction and 0.06 N m more that fade at 2 rad/s."""


def spread(**relative: float) -> UncertainMotor:
    """Servo with independent relative standard deviations of some parameters, 100 draws."""
    rng = np.random.default_rng(2)
    return motor_of(
        {k: v * np.exp(relative.get(k, 0.0) * rng.standard_normal(100)) for k, v in SERVO.items()}
    )


def behaviour(motor: UncertainMotor, controller: str, step: float = 100.0) -> dict[float, str]:
    """Kind of behaviour at each reference where the speed does not rest."""
    specification = parse_specification(
        "settling_time=0.1,sample_time=1e-3,delay=5e-4,voltage=24,current=8"
    )
    judge = Judge(motor, specification, [25.0], step)
    found = hunting(judge, gains_of(parse_controller(controller)), judge.samples())
    return {entry["reference_rad_s"]: entry["kind"] for entry in found}


def test_the_only_spread_that_matters_is_blamed() -> None:
    """The rise with P control varies with the inertia; known exactly, all draws rise equally."""
    motor = spread(J=0.3, b=0.3)
    text = "sample_time=1e-3,rise_time="
    gains = gains_of(parse_controller("PI:0.1,8"))
    judge = Judge(motor, parse_specification(f"{text}1"), [25.0], 100.0)
    rises = judge.judged(gains[:, None]).metrics["rise_time"][0, 0]
    limit = float(np.median(rises)) * 1.03
    found = tune(
        motor, parse_specification(f"{text}{limit}"),
        temperatures=[25.0], controllers=["PI:0.1,8"], step=100.0,
    )["controllers"][0]  # fmt: skip

    first, second = found["blame"]
    assert not found["meets"]
    assert first["parameter"] == "J"
    assert first["probability"] == 1.0
    assert first["rise"] > 0.2
    assert abs(second["rise"]) < 0.05
    assert first["sobol"] > 0.8
    assert second["sobol"] < 0.1
    assert "the uncertainty of J is most to blame" in found["statement"]


def test_two_temperatures_are_blamed_at_their_middle() -> None:
    """Cold and hot rise times differ; a limit between them and that at 75 degC fails at one end."""
    motor, gains = spread(b=0.01), gains_of(parse_controller("PI:0.1,8"))
    required = parse_specification("sample_time=1e-3,rise_time=1")
    ends = Judge(motor, required, [25.0, 75.0, 125.0], 100.0)
    cold, middle, hot = ends.judged(gains[:, None]).metrics["rise_time"][0].mean(axis=1)
    limit = 0.5 * (middle + max(cold, hot))
    judge = Judge(motor, replace(required, rise_time=float(limit)), [25.0, 125.0], 100.0)

    found = {one["parameter"]: one for one in blamed(judge, gains, judge.samples(), 0.95)}

    assert found["temperature"]["probability"] == 1.0
    assert found["temperature"]["rise"] == 1.0


def test_correlated_parameters_are_conditioned_together() -> None:
    """Kt, J and b in a fixed ratio leave one freedom: with one known, the others are known."""
    rng = np.random.default_rng(3)
    factor = np.exp(0.2 * rng.standard_normal(50))
    scaled = {k: v * factor if k in {"Kt25", "J", "b"} else v for k, v in SERVO.items()}
    motor = known(motor_of(scaled), list(SERVO).index("J"))
    for name in ("Kt25", "J", "b"):
        values = motor.draws[name]
        assert np.ptp(values) < 1e-12 * values[0]


def test_few_draws_blame_nothing() -> None:
    """One draw has no variance to divide."""
    judge = Judge(motor_of(SERVO), parse_specification("overshoot=1"), [25.0], 100.0)
    assert blamed(judge, gains_of(parse_controller("PI:0.1,8")), 100, 0.95) == []


def test_integral_action_with_stribeck_friction_gives_stick_slip() -> None:
    """At 1 rad/s the friction falls faster with speed than loop and back-EMF damp.

    Its slope reaches 0.86 x 0.06 / 2 = 0.026 N m s, the damping Kt (Kt + kp) / Ra 0.014 N m s.  At
    30 rad/s and above the Stribeck friction has faded.
    """
    found = behaviour(DRY, "PI:0.02,2")
    assert found[1.0] == "stick-slip"
    assert not {30.0, 100.0} & set(found)


def test_proportional_control_does_not_break_dry_friction() -> None:
    """At 1 rad/s the torque kp r Kt / Ra is 0.01 N m, below the 0.08 N m at standstill."""
    assert behaviour(DRY, "P:0.1")[1.0] == "standstill"


@pytest.mark.parametrize("controller", ["P:0.1", "PI:0.1,3"])
def test_linear_motor_rests_at_every_reference(controller: str) -> None:
    """A stable linear loop has no limit cycle."""
    assert behaviour(motor_of(SERVO), controller) == {}


def test_unstable_loop_ends_in_a_limit_cycle_of_its_voltage_limit() -> None:
    """Beyond its gain margin the loop oscillates until the saturated voltage bounds it."""
    assert behaviour(motor_of(SERVO), "PI:2.5,20")[100.0] == "limit cycle"
