"""Simulated sampled loop: exact for linear motors, physical at its limits."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from identification.speed_loop.controller import PID, TransferFunction, parse_controller
from identification.speed_loop.loop import close, motor_draws
from identification.speed_loop.step_response import StepResponse
from identification.tuning.drive import Drive, Response
from identification.tuning.judge import Judge
from identification.tuning.motor import UncertainMotor, motor_of
from identification.tuning.search import gains_of
from identification.tuning.specification import parse_specification

Array = NDArray[np.float64]

SERVO = {
    "Ra25": 1.1,
    "alpha_Ra": 0.0039,
    "Kt25": 0.115,
    "alpha_Kt": -0.0012,
    "J": 1.2e-4,
    "b": 6e-5,
    "L": 2.6e-3,
}


def simulated(
    controller: str,
    drive: str,
    *,
    step: float = 100.0,
    samples: int = 200,
    anti_windup: bool = True,
) -> Response:
    """Response of the servo at 25 degC."""
    specification = parse_specification(f"overshoot=10,{drive}")
    loop = Drive(motor_of(SERVO), specification, anti_windup=anti_windup)
    return loop.responses(gains_of(parse_controller(controller)), step, [25.0], samples)[0]


@pytest.mark.parametrize("delay", [0.0, 0.25, 0.5, 1.0, 2.5])
def test_sampled_loop_is_exact_at_the_sampling_instants(delay: float) -> None:
    """Reference: matrix exponentials of the motor between the changes of the held voltage."""
    kp, ki, kd, kff, period = 0.05, 2.0, 1e-5, 0.03, 2e-3
    specification = parse_specification(
        {"overshoot": 10, "sample_time": period, "delay": delay * period}
    )
    drive = Drive(motor_of(SERVO), specification)
    found = drive.responses(np.array([kp, ki, kd, kff]), 100.0, [25.0], 40)[0]
    ra, kt, inertia, friction, inductance = (SERVO[k] for k in ("Ra25", "Kt25", "J", "b", "L"))
    a = np.array([[-ra / inductance, -kt / inductance], [kt / inertia, -friction / inertia]])
    whole = np.zeros((3, 3))
    whole[:2, :2], whole[0, 2] = a, 1 / inductance
    step = period / 4
    transition = expm(whole * step)
    state, integral, before, last, queue = np.zeros(2), 0.0, 0.0, 0.0, []
    expected, voltage = [], 0.0
    for k in range(40 * 4):
        if k % 4 == 0:
            expected.append(state[1])
            error = 100.0 - state[1]
            integral += 0.5 * period * ki * (error + before)
            output = kp * error + integral + kff * 100.0 - kd * (state[1] - last) / period
            queue.append((k + round(4 * delay), output))
            before, last = error, state[1]
        voltage = next((u for when, u in queue if when == k), voltage)
        state = (transition @ [*state, voltage])[:2]
    assert found.speed[:: drive.substeps, 0] == pytest.approx(expected, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("text", ["P:0.1", "PI:0.1,3", "PI+FF:0.1,3,0.05", "PID:0.1,3,0.0001"])
def test_short_sample_times_give_the_continuous_response(text: str) -> None:
    """Without limits and effects the response tends to the exact linear one, at first order."""
    gains = gains_of(parse_controller(text))
    specification = parse_specification("overshoot=10,sample_time=2e-5")
    found = Drive(motor_of(SERVO), specification).responses(gains, 1.0, [60.0], 2500)[0]
    controller = parse_controller(text)
    if gains[2]:
        controller = SpeedDerivative(text, *gains[:3])
    exact = StepResponse(close(motor_draws(SERVO, [60.0]), [60.0], controller))
    assert found.speed[:, 0] == pytest.approx(exact.at(found.time)[0], abs=0.01)


class SpeedDerivative(PID):
    """PID controller whose derivative acts on the speed."""

    def transfer_function(self) -> TransferFunction:
        """The reference passes the proportional and the integral part alone."""
        return TransferFunction(
            (self.kd, self.kp, self.ki),
            (1.0, 0.0),
            (0.0, self.kp, self.ki),
        )


def test_limits_hold() -> None:
    """The drive applies at most its voltage, and the chopper keeps the current at 5 A."""
    found = simulated("PI:1,30", "voltage=24,current=5")
    assert np.abs(found.voltage).max() <= 24.0
    assert 4.9 < np.abs(found.current).max() < 5.1
    assert found.limited.max() == 1.0


def test_limits_that_are_not_reached_change_nothing() -> None:
    """Reference: the drive without limits."""
    free = simulated("PI:0.1,3", "sample_time=1e-3")
    wide = simulated("PI:0.1,3", "sample_time=1e-3,voltage=1000,current=1000")
    assert wide.speed == pytest.approx(free.speed, rel=1e-9)


@pytest.mark.parametrize("limit", ["voltage=14", "current=2"])
def test_anti_windup_reduces_overshoot(limit: str) -> None:
    """A saturated drive integrates a large error; the integral without anti-windup must unwind."""
    peaks = [
        simulated("PI:0.3,12", limit, anti_windup=kept, samples=1000).speed.max()
        for kept in (True, False)
    ]
    assert peaks[0] < 0.7 * (peaks[1] - 100.0) + 100.0


def test_current_limit_bounds_the_acceleration() -> None:
    """With constant current the speed rises by Kt i / J, less the friction, which is small here.

    The chopper acts once a substep, so the rising back-EMF keeps the current up to 2 % lower.
    """
    found = simulated("P:10", "current=2,voltage=1000", samples=30)
    slope = found.acceleration[20, 0]
    assert slope == pytest.approx(SERVO["Kt25"] * 2.0 / SERVO["J"], rel=0.03)


def test_delay_costs_phase_margin_and_overshoot() -> None:
    """The phase margin falls by exactly the crossover frequency times the delay."""
    judges = [
        Judge(motor_of(SERVO), parse_specification(f"overshoot=10,sample_time=1e-4,{d}"), [25.0], 1)
        for d in ("delay=0", "delay=1e-3")
    ]
    gains = gains_of(PID("", 0.2, 20.0))[:, None]
    soon, late = (judge.judged(gains, 2000).metrics for judge in judges)
    loop = close(motor_draws(SERVO, [25.0]), [25.0], PID("", 0.2, 20.0))
    frequency = np.geomspace(1, 1e4, 200_001)
    s = 1j * frequency
    value = np.polyval(loop.numerator[0], s) / np.polyval(loop.open_denominator[0], s)
    crossover = frequency[np.argmin(np.abs(np.abs(value) - 1))]
    lost = soon["phase_margin"] - late["phase_margin"]
    assert lost[0, 0, 0] == pytest.approx(np.rad2deg(crossover * 1e-3), rel=1e-3)
    assert late["overshoot"][0, 0, 0] > soon["overshoot"][0, 0, 0]


def test_gain_margin_is_the_factor_that_makes_the_loop_oscillate() -> None:
    """With 3 % less than the gain margin the simulated loop settles, with 3 % more it does not."""
    motor: UncertainMotor = motor_of(SERVO)
    specification = parse_specification("overshoot=10,sample_time=2e-4,delay=2e-3")
    judge = Judge(motor, specification, [25.0], 1.0)
    gains = gains_of(PID("", 0.1, 2.0))[:, None]
    margin = judge.margins(gains)["gain_margin"][0, 0, 0]
    scale = 10 ** (margin / 20)
    settles = [
        judge.judged(f * scale * gains, 10_000).metrics["settling_time"] for f in (0.97, 1.03)
    ]
    assert np.isfinite(settles[0]).all()
    assert np.isnan(settles[1]).all()
