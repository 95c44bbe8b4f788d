"""Controllers of any degree: the example of docs/write-a-controller.md and textbook structures."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from identification.speed_loop import AbstractController, TransferFunction, feedback_metrics
from identification.speed_loop.closed_loop import ClosedLoop, simulated_loop
from identification.speed_loop.loop import close, motor_draws
from identification.speed_loop.margins import stability_margins
from identification.speed_loop.sampled import sampled_metrics
from identification.speed_loop.step_response import StepResponse, step_metrics

PAGE = Path(__file__).parents[2] / "docs" / "write-a-controller.md"
MOTOR = {"Ra25": 0.59, "alpha_Ra": 0.004, "Kt25": 0.071, "alpha_Kt": -0.002, "J": 0.01, "b": 0.1,
         "L": 0.5}  # fmt: skip


@dataclass(frozen=True)
class AnyController(AbstractController):
    """A controller given by its transfer function."""

    text: str
    function: TransferFunction

    def transfer_function(self) -> TransferFunction:
        """The one given."""
        return self.function


CONTROLLERS = [
    AnyController("filtered PI", TransferFunction((1, 2), (0.05, 1, 0), (0.05, 1.1, 2))),
    AnyController("lead-lag", TransferFunction((4.0, 12.0, 8.0), (0.1, 2.05, 1.0))),
    AnyController("PDF", TransferFunction((1.0, 3.0), (1.0, 0.0), (3.0,))),
    AnyController("PID with two filters", TransferFunction((0.3, 3, 5), (1e-4, 0.02, 1, 0))),
    AnyController("PI with Padé delay", TransferFunction((-0.02, 0.96, 2), (0.02, 1, 0))),
    AnyController("notch", TransferFunction((2.0, 0.2, 50.0), (1.0, 8.0, 25.0))),
    AnyController("differentiating PI", TransferFunction((0.2, 3, 5), (2.0, 0), (0.1, 3, 5))),
]
each_controller = pytest.mark.parametrize("controller", CONTROLLERS, ids=lambda c: str(c.text))


def motor_matrices() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """d/dt (i, w) = A (i, w) + B v of the source's motor at 25 degC."""
    ra, kt, j, b, inductance = (MOTOR[name] for name in ("Ra25", "Kt25", "J", "b", "L"))
    return np.array([[-ra / inductance, -kt / inductance], [kt / j, -b / j]]), np.array(
        [[1 / inductance], [0.0]]
    )


def test_example_of_the_page_prints_what_the_page_shows() -> None:
    """The code block runs on its own, and its output stands below it."""
    code, output = re.findall(r"```(?:python|text)\n(.*?)```", PAGE.read_text("utf-8"), re.S)

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert done.stdout == output


@each_controller
def test_step_of_any_controller_is_that_of_scipy(controller: AnyController) -> None:
    """SciPy's step of Nr G / (D + N G), from polynomial products of its own, on 20,001 instants."""
    function = controller.function
    matrix, column = motor_matrices()
    gain, motor = signal.ss2tf(matrix, column, [[0.0, 1.0]], [[0.0]])
    gain = gain[0][-1]
    closed = np.polyadd(
        np.polymul(function.denominator, motor), gain * np.array(function.numerator)
    )
    reference = function.numerator if function.reference is None else function.reference
    loop = close(motor_draws(MOTOR, [25.0]), [25.0], controller)
    step = step_metrics(StepResponse(loop))
    time = np.linspace(0, 1.5 * np.fmax(step.settling_time, step.peak_time)[0], 20_001)

    _, speed = signal.step((gain * np.array(reference), closed), T=time)

    np.testing.assert_allclose(StepResponse(loop).at(time)[0], speed, atol=1e-8)
    relative = speed / step.steady_state[0]
    last = np.flatnonzero(np.abs(relative - 1) > 0.02)[-1]
    rise = time[np.argmax(relative >= 0.9)] - time[np.argmax(relative >= 0.1)]
    assert step.settling_time[0] == pytest.approx(time[last], abs=2 * time[1])
    assert step.rise_time[0] == pytest.approx(rise, abs=2 * time[1])
    assert step.overshoot[0] == pytest.approx(max(0, 100 * (relative.max() - 1)), abs=1e-4)


@each_controller
def test_margins_of_any_controller_are_those_of_a_fine_grid(controller: AnyController) -> None:
    """The crossings of a million frequencies; the definitions need no polynomials."""
    function = controller.function
    matrix, column = motor_matrices()
    frequency = np.geomspace(1e-3, 1e4, 1_000_001)
    s = 1j * frequency
    motor = (
        column[0, 0]
        * matrix[1, 0]
        / ((s - matrix[0, 0]) * (s - matrix[1, 1]) - matrix[0, 1] * matrix[1, 0])
    )
    gain = np.polyval(function.numerator, s) / np.polyval(function.denominator, s) * motor
    at_one = np.flatnonzero(np.diff(np.sign(np.abs(gain) - 1)))
    at_axis = np.flatnonzero((np.diff(np.sign(gain.imag)) != 0) & (gain.real[1:] < 0))
    phases = np.angle(-gain[at_one], deg=True)
    decibels = -20 * np.log10(-gain.real[at_axis])

    margins = stability_margins(close(motor_draws(MOTOR, [25.0]), [25.0], controller))

    phase = phases[np.abs(phases).argmin()] if phases.size else np.inf
    decibel = decibels[np.abs(decibels).argmin()] if decibels.size else np.inf
    assert margins.phase_deg[0] == pytest.approx(phase, abs=0.01)
    assert margins.gain_db[0] == pytest.approx(decibel, abs=0.01)


@each_controller
def test_simulated_loop_of_any_controller_has_the_exact_metrics(controller: AnyController) -> None:
    """State equations of the simulation against the transfer functions of the linear loop."""
    (exact,) = feedback_metrics(MOTOR, [25.0], [controller])
    time = np.linspace(0.0, 12 * exact["settling_time_s"]["median"], 8001)
    values = np.array(list(MOTOR.values()))[:, None]

    (run,) = simulated_loop(
        ClosedLoop((), controller=controller), values, np.zeros(0), 10.0, [(25.0, 25.0)], time
    )
    found = sampled_metrics(run.time, run.speed / 10.0, run.acceleration / 10.0)

    for name, metric in (("rise_time", "rise_time_s"), ("settling_time", "settling_time_s"),
                         ("peak", "peak"), ("steady_state", "steady_state")):  # fmt: skip
        assert getattr(found, name)[0] == pytest.approx(exact[metric]["median"], rel=1e-4)
